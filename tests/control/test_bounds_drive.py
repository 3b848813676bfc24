"""The bounds in the full simulation: a rover climbs with its wheels' torques held at 95 % and at 105 % of a bound."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from rover_pin.control.bound_pull import TractionLimit
from rover_pin.control.rover_bounds import climbable_slope, rover_torque_bounds
from rover_pin.control.torque_bounds import TorqueBounds, torque_bounds
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.compiled.toolchain import compiler
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.simulate import Timing, simulate
from rover_pin.soil.traction import FORMS
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
