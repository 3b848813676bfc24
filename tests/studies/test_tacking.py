"""Tacking: when it turns, when it comes back, and a ditch that it alone gets out of."""

import math

import numpy as np
import pytest

from rover_pin.control.constant import ConstantDuty
from rover_pin.rover.rover import load_rover
from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.command import Reading
from rover_pin.simulation.simulate import simulate
from studies.shared.tacking import Tacking, TackingControl

LAW = Tacking(calm=2.0, delta=0.5, delta_climb=0.8)


def reading(t, fold, yaw=0.0, pitch=0.0):
    """What the rover reads: no truth, which the controller must not touch."""
    return Reading(t, np.zeros(6), np.ones(6), np.ones(6), np.array([0.0, fold, 0.0, fold]), (0.0, pitch, yaw), None)


@pytest.fixture
def control():
    made = TackingControl(load_rover(), LAW)
    made.reset()
    return made


def test_folded_bogies_turn_it_to_one_side_and_then_to_the_other(control):
    first = control(reading(1.0, math.radians(8)))
    assert np.max(first.duty) == pytest.approx(0.8)
    assert first.steer[0] > 0.0
    assert control(reading(2.9, 0.0)).steer[0] > 0.0
    assert set(control(reading(3.1, 0.0)).duty) == {0.5}
    assert control(reading(5.0, math.radians(8))).steer[0] < 0.0


def test_it_leaves_a_ditch_in_which_constant_duty_stays():
    """Walls of 60 deg: the bogies' wheels stand at the wall for ever, at any duty; one after the other they climb."""
    scene = scenario("ditch", **{"soil.k": 0.01, "terrain.wall_angle_deg": 60})
    straight = [simulate(scene.model, ConstantDuty(delta), 35.0, symmetric=True) for delta in (0.55, 1.0)]
    tacking = simulate(scene.model, TackingControl(scene.model.rover), 35.0)
    assert max(float(trace["body_x"][-1]) for trace in straight) < 0.85
    assert float(tacking["body_x"][-1]) > 0.95
