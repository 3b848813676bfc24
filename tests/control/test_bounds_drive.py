"""The bounds of a rover on a slope and in the full simulation, with torques held at 95 % and at 105 % of a bound."""

import json
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from rover_pin import SOILS, Motor, Wheel, load_rover, load_traction_factor, scenario, simulate, torque_bounds
from rover_pin.base.errors import ParameterError
from rover_pin.cli.app import app
from rover_pin.control.rover_bounds import climbable_slope, rover_torque_bounds
from rover_pin.control.torque_bounds import TorqueBounds, TractionLimit
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.rover.statics import wheel_loads
from rover_pin.simulation.compiled.toolchain import compiler
from rover_pin.simulation.simulate import Timing
from rover_pin.soil.angles import FixedAngles
from rover_pin.soil.wheel_forces import FORMS, TorqueTraction
from tests.control.arc_torque import torque_at_slip

pytestmark = [pytest.mark.slow, pytest.mark.skipif(compiler() is None, reason="the simulator needs a C compiler")]

SOURCE = Motor(supply=100.0, resistance=12.5, gear=10.0, rotor_inertia=1e-6)
"""A motor with hardly any back-EMF and rotor: a torque source. Its torque at full duty is 1 N m."""


def uphill(slope, k, form):
    """A rover on a slope of sand whose arc follows the load, with no resistance beside the soil's own."""
    settings = {"soil": "literature-sand", "soil.k": k, "angles": "sinkage", "form": form}
    model = scenario("incline", **settings, **{"terrain.angle": slope, "terrain.start": -5.0}).model
    return model.without(MotionResistance).replace(motor=SOURCE)


def slips(model, torque):
    """The slip of each wheel in the second half of 6 s with the torque [n] of a reading, compensated for back-EMF."""

    def control(reading):
        return torque(reading) / SOURCE.stall_torque + reading.wheel_rate / SOURCE.no_load_rate

    trace = simulate(model, control, 6.0, timing=Timing(0.005, 0.005, 0.02), symmetric=True)
    assert trace.attrs["stop"] == "duration"
    half = len(trace.t) // 2
    return trace.stack("slip")[half:], trace.stack("normal")[half:]


def slip_at(share, which, soil, rover, slip_limit):
    """The slip that `share` of the bound asks of a wheel with a sixth of the weight; None beyond S = 1."""
    load = rover.mass * 9.81 / 6.0
    target = share * getattr(torque_bounds(load, soil, rover.wheel, slip_limit), which)
    if target >= torque_at_slip(load, 1.0, rover.wheel, soil):
        return None
    return brentq(lambda S: torque_at_slip(load, S, rover.wheel, soil) - target, 0.01, 1.0)


def steady_climb(share, which, form, k, slip_limit):
    """The model on the slope where this share of the bound just about balances the weight, and the slip expected."""
    flat = uphill(0.0, k, form)
    expected = slip_at(share, which, flat.soils[0], flat.rover, slip_limit)
    limit = TractionLimit(1.0 if expected is None else expected, FORMS[form])
    full, slipping = climbable_slope(flat.rover, flat.soils[0], limit)
    slope = full if expected is None else slipping - math.radians(0.3)
    return uphill(slope, k, form), slope, expected


def at_measured_loads(model, share, which, slip_limit):
    """The torques of a limiter that knows the loads."""
    bounds = TorqueBounds([mount.wheel for mount in model.rover.wheels], model.soils[0], slip_limit)
    return lambda reading: share * getattr(bounds(np.maximum(reading.truth.normal, 0.0)), which)


@pytest.mark.parametrize(("form", "slip_limit"), [("torque", 0.2), ("net", 0.2), ("gross", 0.5)])
def test_slip_stays_below_the_limit_at_95_percent_not_at_105(form, slip_limit):
    for share in (0.95, 1.05):
        model, _, expected = steady_climb(share, "limit", form, 0.005, slip_limit)
        slip, _ = slips(model, at_measured_loads(model, share, "limit", slip_limit))
        assert np.all(slip < slip_limit) if share < 1.0 else np.all(slip > slip_limit)
        # rear wheels carry twice the front's load: the same share of the bound is another slip
        assert np.mean(slip) == pytest.approx(expected, rel=0.04)


def test_the_wheels_spin_free_at_105_percent_of_saturation_only():
    for share in (0.95, 1.05):
        model, _, expected = steady_climb(share, "saturation", "torque", 0.001, 0.2)
        slip, _ = slips(model, at_measured_loads(model, share, "saturation", 0.2))
        if share < 1.0:
            assert expected < 0.2
            assert np.all(slip < 0.3)
        else:
            assert expected is None
            assert np.all(slip[-1] > 0.999)


def test_static_loads_are_a_few_percent_off_in_a_drive():
    """Statics gives every wheel one f_t / f_n; driven at 95 % of T_lim the middle wheels are lighter and slip more."""
    model, slope, _ = steady_climb(0.95, "limit", "torque", 0.005, 0.2)
    bounds = rover_torque_bounds(model.rover, model.soils[0], slope, limit=TractionLimit(0.2))
    slip, normal = slips(model, lambda reading: 0.95 * bounds.limit)
    assert 0.01 < np.max(np.abs(normal[-1] / bounds.load - 1.0)) < 0.06
    assert np.mean(slip) < 0.2 < np.max(slip[-1]) < 0.22


ROVER, WHEEL, DEG = load_rover(), Wheel(), math.pi / 180.0
SAND = SOILS["literature-sand"].replace(k=0.005)


@pytest.mark.parametrize("slope", [0.0, 12 * DEG, -8 * DEG])
def test_each_wheel_is_bounded_at_its_own_static_load(slope):
    bounds = rover_torque_bounds(ROVER, SAND, slope)
    loads = wheel_loads(ROVER, slope)
    assert bounds.load == pytest.approx(loads)
    assert np.sum(bounds.load) == pytest.approx(ROVER.mass * 9.81 * math.cos(slope))
    for i, load in enumerate(loads):
        assert (bounds.saturation[i], bounds.limit[i]) == pytest.approx(
            torque_bounds(float(load), SAND, WHEEL), rel=1e-12
        )


def test_load_transfer_raises_the_bound_light_wheels_slip_first():
    flat, steep = rover_torque_bounds(ROVER, SAND), rover_torque_bounds(ROVER, SAND, 15 * DEG)
    rear = [steep.names.index(name) for name in ("rl", "rr")]
    assert np.all(steep.limit[rear] > 1.2 * flat.limit[rear])
    least = {steep.names[i] for i in np.flatnonzero(steep.load < steep.load.min() + 1e-9)}
    assert set(steep.first_to_slip) == least
    assert least.isdisjoint({"rl", "rr"})


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_the_climbable_slope_balances_the_weight(form):
    limit = TractionLimit(0.2, form)
    full, slipping = climbable_slope(ROVER, SAND, limit)
    assert slipping < full
    for slope, which in ((full, "pull_saturation"), (slipping, "pull_limit")):
        pull = getattr(rover_torque_bounds(ROVER, SAND, slope, limit=limit), which)
        assert np.sum(pull) == pytest.approx(ROVER.mass * 9.81 * math.sin(slope), rel=1e-6)


def test_every_wheel_climbs_its_factor_angle_with_fixed_angles():
    limit = TractionLimit(0.2, TorqueTraction(), FixedAngles())
    factor = load_traction_factor(0.2, SAND, WHEEL, TorqueTraction())
    assert climbable_slope(ROVER, SAND, limit)[1] == pytest.approx(math.atan(factor), rel=1e-6)


def test_a_slope_on_which_a_wheel_lifts_is_refused_by_name():
    lift = float(brentq(lambda slope: np.min(wheel_loads(ROVER, slope)), 0.0, 1.2))
    rover_torque_bounds(ROVER, SAND, lift - 0.01)
    with pytest.raises(ParameterError, match=r"50.*-.*gentler"):
        rover_torque_bounds(ROVER, SAND, 50 * DEG)


@pytest.mark.parametrize(
    "settings",
    [{"soil": "table-1"}, {"soil": "hit-lss1", "gravity": "mars"}, {"rover": "cart", "soil": "table-1"},
     {"soil": "lunar-nominal", "form": "gross"}],
    ids=str,
)  # fmt: skip
def test_the_slope_that_the_command_says_is_what_drives_climb(settings, capsys):
    """Within 0.7 deg, at full duty from a start on the slope."""
    options = [word for name, value in settings.items() for word in (f"--{name}", value)]
    with pytest.raises(SystemExit) as exit_info:
        app(["bounds", *options, "--json"])
    assert exit_info.value.code == 0
    climbable = json.loads(capsys.readouterr().out)["climbable_deg"]

    def share(slope):
        """The share of what the wheels turn that the rover travels at the end."""
        steep = {"terrain.angle_deg": slope, "terrain.start": -9.0, "control.delta": 1.0}
        trace = scenario("incline", duration=15.0, **settings, **steep).drive(measure_error=False)
        return 1.0 - np.mean(trace.stack("slip")[-1])

    assert share(climbable - 0.7) > 0.01
    assert share(climbable + 0.7) < 0.01
