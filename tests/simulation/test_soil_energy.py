"""Energy that a traction law creates is reported, in joules and percent; a law that only takes energy has no
warning."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.outcome.soil_energy import carrier_rates, energy_warning, spurious_energy

WHEELS = ("fl", "fr", "ml", "mr", "rl", "rr")
STIFF = {"soil.k": 0.0025, "effect.MotionResistance.R": 0.03}


def driven(name, **settings):
    case = scenario(name, soil="table-1", **settings)
    return case.model, case.drive()


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("flat", STIFF),
        ("slope", {"soil.k": 0.001, "soil.phi_deg": 13.0, "effect.MotionResistance.R": 0.03}),
        ("bump", {"form": "gross", "soil.k": 0.01, "effect.MotionResistance.R": 0.0}),
        ("ditch", {**STIFF, "effect.MotionResistance.R": 0.0}),
    ],
)
def test_forms_without_compaction_give_nothing_at_negative_slip(name, settings):
    """With a torque that does not pay for the pull, these forms would create 4 to 37 % of the motors' work. The energy
    account balances.
    """
    model, trace = driven(name, **settings)
    assert trace.stack("slip").min() < -0.07
    energy = spurious_energy(model, trace)
    assert energy.traction < 0.015 * trace["energy_motor"].max(), "what is left is a slip that lags"
    assert trace.energy_error() < 0.01


def test_the_rate_of_a_wheel_is_that_of_the_world():
    """In a ditch the bogies turn as fast as the wheels slip, so that the power of the torque needs the rates
    of both.
    """
    model, trace = driven("ditch", slip="algebraic", **{"soil.k": 0.0025})
    rim = 0.045 * (trace.stack("wheel_rate") + carrier_rates(model, trace))
    v = trace.stack("travel")
    slip = (rim - v) / np.maximum(rim, v)
    bare = (0.045 * trace.stack("wheel_rate") - v) / np.maximum(rim, v)
    off, off_bare = (np.median(np.abs(trace_driven - trace.stack("slip"))[60:300]) for trace_driven in (slip, bare))
    assert off < 0.3 * off_bare


@pytest.mark.parametrize("fall", [0.0, 0.02])
def test_the_energy_of_pressing_comes_back_when_a_wheel_lifts(fall):
    """The force f_n ~ h^(n + 1/2) gives the integral of f_n dh (by the trapezoidal rule). Only a larger decrease of the
    account is created energy.
    """
    model, trace = driven("flat", duration=1.0)
    h = np.concatenate([np.linspace(0.004, 0.001, 1001), np.linspace(0.001, 0.003, 1001)])
    load = 8e4 * h ** (float(model.soils[0].n) + 0.5)
    work = cumulative_trapezoid(load, h, initial=0.0)
    lost = fall * np.concatenate([np.linspace(0.0, -1.0, 1001), np.linspace(-1.0, 1.0, 1001)])
    channels = {name: np.resize(values, 2002) * 0.0 for name, values in trace.channels.items()}
    channels |= {"t_s": np.linspace(0.05, 5.0, 2002), "sinkage_fl": h, "normal_fl": load, "energy_soil": work + lost}
    changed_trace = dataclasses.replace(trace, channels=channels, attrs={})
    assert spurious_energy(model, changed_trace).soil == pytest.approx(fall, abs=2e-5)
    assert spurious_energy(model, changed_trace).traction == 0.0


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("flat", {}),
        ("incline", {"terrain.angle_deg": -9.0}),
        ("park", {}),
        ("hills", {}),
        ("turn", {"duration": 5.0}),
        ("hills", {"form": "net", "angles": "sinkage", "soil.k": 0.002}),
        ("flat", {"soil.k": 0.01, "cruise_slip": 0.05}),
    ],
)
def test_a_drive_that_pays_for_its_way_gets_no_warning(name, settings):
    _, trace = driven(name, **settings)
    assert not any(" created " in warning for warning in trace.attrs["warnings"])


def test_the_net_form_gives_nothing_at_any_slip():
    model, trace = driven("ditch", form="net", **{"soil.k": 0.005})
    assert spurious_energy(model, trace).traction == 0.0


@pytest.mark.parametrize(
    ("add", "settings", "message"),
    [
        ("MultiPass", {}, [("MultiPass", "torque")]),
        ("MultiPass", {"form": "net", "angles": "sinkage"}, []),
        ("DiggingMemory", {}, []),
        ("SlipSinkage", {"form": "gross"}, [("SlipSinkage", "spring")]),
        ("SkidSinkage", {"form": "net"}, [("SkidSinkage", "spring")]),
        ("SlipSoftening", {}, []),
        ("Ploughing", {}, []),
        ("LoadExponent", {"form": "net"}, [("LoadExponent", "net")]),
    ],
)
def test_a_drive_notes_where_sinking_or_rising_costs_nothing(add, settings, message):
    notes = scenario("flat", soil="table-1", duration=0.5, add=add, **settings).drive().summary().get("notes", [])
    assert len(notes) == len(message)
    assert all(word in note for words, note in zip(message, notes, strict=True) for word in words)


def test_traction_that_creates_energy_is_reported():
    model, trace = driven("flat", duration=1.0)
    for name in WHEELS:
        trace.channels[f"torque_{name}"] = 0.5 * trace[f"torque_{name}"]
    warning = energy_warning(model, trace)
    assert trace.attrs["traction_form"] in warning
    assert "account" not in warning


@pytest.mark.parametrize("v", [1e-4, 1e-3, 0.04])
def test_resistance_paid_by_a_pull_fades_with_travel_over_rim(v):
    """One wheel turns at 1 rad/s under 20 N, pulls by 1 N and needs no torque: the whole work of its pull is created
    energy.
    """
    model, trace = driven("flat", slip="algebraic", duration=0.1)
    (resists,) = (effect for effect in model.effects if isinstance(effect, MotionResistance))
    channels = {name: np.zeros(2) for name in trace.channels} | {"t_s": np.array([0.0, 2.0])}
    wheel = {"normal": 20.0, "tangential": 1.0, "travel": v, "wheel_rate": 1.0}
    channels |= {f"{name}_fl": np.full(2, value) for name, value in wheel.items()}
    fades = v / np.hypot(v, float(resists.fading(0.045)))
    gave = (1.0 + float(resists.R) * 20.0 * fades) * v * 2.0
    assert spurious_energy(model, dataclasses.replace(trace, channels=channels, attrs={})).traction == pytest.approx(
        gave
    )
