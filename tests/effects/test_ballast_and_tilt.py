"""What the rover weighs and where down is: statics by hand, a tilt that equals a slope, energy that follows."""

import math

import numpy as np
import pinocchio as pin
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.control.constant import ConstantDuty
from rover_pin.effects.gravity_tilt import GravityTilt
from rover_pin.effects.point_mass import PointMass
from rover_pin.rover.rover import load_rover
from rover_pin.rover.statics import wheel_loads
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.start.place import Start, settled
from rover_pin.terrain import shapes

NEXUS6 = load_rover()
FLAT = scenario("flat").model


def centre(rover):
    return pin.centerOfMass(rover.model, rover.model.createData(), pin.neutral(rover.model))


def test_static_loads_change_as_statics_says():
    """The moments about the base's origin grow by the shifted weight, and what the simulator rests on is the same."""
    effect = PointMass(m=0.5, shift_x=0.02)
    plain, loaded = wheel_loads(NEXUS6, 0.0), wheel_loads(NEXUS6.carrying(*effect.ballast()), 0.0)
    places = np.repeat([0.15, 0.0, -0.15], 2)
    assert loaded.sum() - plain.sum() == pytest.approx(0.5 * 9.81)
    assert places @ loaded - places @ plain == pytest.approx(
        9.81 * (6.3 * (centre(NEXUS6)[0] + 0.02) - 5.8 * centre(NEXUS6)[0])
    )
    trace = simulate(FLAT.having(effect), ConstantDuty(0.0), 0.5)
    assert trace.stack("normal")[-1] == pytest.approx(loaded, rel=0.02)


def test_a_tilt_is_a_slope():
    """On a bed tilted by a, all is as on the flat bed's slope of a: loads, slip, sinkage, speed, power."""
    angle = math.radians(4.0)
    slope = FLAT.replace(terrain=shapes.incline(angle, -3.0))
    traces = [simulate(each, ConstantDuty(0.6), 10.0) for each in (slope, FLAT.having(GravityTilt(rise_x=angle)))]
    for name in ("slip_fl", "normal_rl", "normal_fr", "tangential_ml", "sinkage_rr", "wheel_rate_fl", "current_mr_A"):
        assert traces[1][name][-1] == pytest.approx(traces[0][name][-1], rel=2e-3), name
    along = [trace["body_x"][-1] - trace["body_x"][0] for trace in traces]
    assert along[0] / math.cos(angle) == pytest.approx(along[1], rel=2e-3)
    risen = [trace["energy_potential"][-1] - trace["energy_potential"][0] for trace in traces]
    assert risen[1] == pytest.approx(risen[0], rel=5e-3)
    assert risen[1] == pytest.approx(5.8 * 9.81 * along[1] * math.sin(angle), rel=2e-2)


def test_a_side_tilt_loads_the_lower_wheels_as_statics_says():
    tilted = FLAT.having(GravityTilt(rise_x=0.0, rise_y=0.1))
    trace = simulate(tilted, ConstantDuty(0.0), 0.5, settled(tilted, Start()))
    loads = wheel_loads(NEXUS6, 0.0, 0.1)
    assert wheel_loads(NEXUS6.rising(0.0, 0.1), 0.0) == pytest.approx(loads, rel=1e-9)
    assert loads[1] > loads[0]
    right = trace.stack("normal")[-1][1::2].sum()
    assert right == pytest.approx(loads[1::2].sum(), rel=0.03)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: NEXUS6.carrying(-2.9), "'nexus6'.*2.9"),
        (lambda: NEXUS6.carrying(-2.85), "inertia.*body"),
        (lambda: NEXUS6.rising(1.0, 1.0), "leaves.*upper"),
        (lambda: NEXUS6.rising(2.0, 0.0), "leaves.*upper"),
    ],
)
def test_what_is_refused_is_said(call, words):
    with pytest.raises(ParameterError, match=words):
        call()


@pytest.mark.parametrize(("size", "axis"), [("shift_z=124mm", "z = 2"), ("shift_x=-0.15", "x = -"), ("m=1.5", "")])
def test_a_centre_of_mass_outside_the_rover_is_said(run, size, axis):
    code, out, _ = run("drive", "flat", "--add", f"PointMass.{size}", "--set", "duration=0.2", "--out", "here")
    assert code == 0
    assert (f"PointMass puts the base's centre of mass at {axis}" in out) == bool(axis)
