"""A slip that lags stores energy in sheared soil and returns it: the account is compared with quadrature and closed
forms.
"""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import quad

from rover_pin import scenario, wheel_forces
from rover_pin.simulation.outcome import soil_energy
from rover_pin.simulation.outcome.soil_energy import ShearStore, shear_store, spurious_energy


@pytest.fixture(scope="module")
def flat():
    case = scenario("flat", soil="table-1", duration=1.0, **{"effect.RelaxedSlip.damping": 0.0})
    return case.model, case.drive()


def M(model, S):
    soil, wheel = model.soils[0], model.rover.wheels[0].wheel
    forces = wheel_forces(S, soil.theta_1, soil.theta_2, wheel, soil, 24)
    return float(forces.torque) / (float(wheel.r) * float(forces.f_n))


def sheared(trace, slip, load):
    """Return a trace in which only the front left wheel carries a load and has this slip."""
    rows = len(slip)
    channels = {name: np.zeros(rows) for name in trace.channels} | {"t_s": np.linspace(0.05, 1.0, rows)}
    channels |= {"slip_fl": np.asarray(slip), "normal_fl": np.broadcast_to(np.asarray(load, float), rows)}
    return dataclasses.replace(trace, channels=channels)


@pytest.mark.parametrize("top", [0.05, 0.6, -0.4, -1.0])
def test_stored_energy_comes_back_at_a_steady_load(flat, top):
    """The stored energy L f_n int M ds is computed by quadrature over a slip that rises and falls. At the end nothing
    remains stored.
    """
    model, trace = flat
    store = shear_store(model, sheared(trace, [*np.linspace(0.0, top, 40), *np.linspace(top, 0.0, 40)], 20.0))
    work = float(model.slip.length) * 20.0 * quad(lambda S: M(model, S), 0.0, top)[0]
    assert np.sum(store.taken[:40]) == pytest.approx(work, rel=2e-3)
    assert np.sum(store.taken) == pytest.approx(0.0, abs=1e-12)
    assert store.stored[39] - store.stored[0] == pytest.approx(work, rel=2e-3)
    assert store.overdrawn == 0.0


def test_a_load_that_grows_on_sheared_soil_overdraws_the_store(flat):
    """Soil that is sheared under 10 N and released under 30 N returns three times its stored energy. Two thirds of this
    are created energy.
    """
    model, trace = flat
    up, down = np.linspace(-0.1, 0.5, 40), np.linspace(0.5, -0.1, 40)
    store = shear_store(model, sheared(trace, [*up, *down], [10.0] * 40 + [30.0] * 40))
    assert store.overdrawn == pytest.approx(2.0 * store.stored[39], rel=1e-3)


def test_the_state_lags_behind_the_slip_by_its_damping(flat):
    """S = s + T ds/dt: after a step of S by 0.2, the state has reached the fraction 1 - e^(-t / T), and so has the
    stored energy.
    """
    model, trace = flat
    damped = model.having(dataclasses.replace(model.slip, damping=0.1))
    rows = 2000
    sheared_trace = sheared(trace, [0.1, *[0.3] * (rows - 1)], 20.0)
    half = int(np.searchsorted(sheared_trace.t, 0.05 + 0.1 * np.log(2.0)))
    stored = shear_store(damped, sheared_trace).stored
    there = shear_store(model, sheared(trace, [0.2] * 2, 20.0)).stored[0]
    assert stored[half] == pytest.approx(there, rel=2e-3)


@pytest.mark.parametrize(("name", "settings"), [("ditch", {"soil.k": 0.01}), ("bump", {}), ("washboard", {})])
def test_scenario_drive_regains_its_stored_energy_and_no_more(name, settings, monkeypatch):
    """Without the account of stored energy, the ditch would be warned of 0.021 J. With it, only round-off remains."""
    case = scenario(name, soil="table-1", **settings)
    trace = case.drive()
    assert not any("nowhere" in warning for warning in trace.attrs["warnings"])
    real = shear_store(case.model, trace)
    monkeypatch.setattr(soil_energy, "shear_store", lambda *value: ShearStore(0.0 * real.taken, 0.0 * real.stored))
    bare = spurious_energy(case.model, trace).traction
    assert bare > 0.004
    monkeypatch.setattr(soil_energy, "shear_store", lambda *value: ShearStore(real.taken, 1e9 + real.stored))
    assert spurious_energy(case.model, trace).traction < 0.05 * bare


def test_a_rover_that_turns_on_rocks_is_not_accused():
    assert not scenario("rocks", soil="table-1").drive().attrs["warnings"]
