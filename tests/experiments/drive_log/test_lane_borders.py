"""A wheel over the step between two lanes: those rows are not compared, and the data check says so."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.experiments.drive_log.readings.lane_borders import on_borders
from rover_pin.rover.rover import load_rover
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.shapes import flat
from rover_pin.terrain.terrain import Lanes

ROVER = load_rover("nexus6")
LEFT = float(wheel_places(ROVER)["fl"][1])
X = np.array([-2.0, 0.0, 2.0])
B = float(ROVER.wheel.b)


def rows(y, x=0.5, yaw=0.0, terrain=None):
    """Return whether a wheel stands on a border where the rover stands, on lanes that part from x = 0 on."""
    lanes = Lanes((Profile(X, 0.0 * X), Profile(X, np.array([0.0, 0.0, 0.4]))), (0.0,))
    place = np.array([[x, y, yaw]])
    run = SimpleNamespace(t=np.zeros(1), place=place)
    return bool(on_borders(run, ROVER, lanes if terrain is None else terrain)[0])


@pytest.mark.parametrize("side", [LEFT, -LEFT])
def test_a_wheel_is_on_a_border_within_half_its_width(side):
    assert rows(-side)
    assert rows(-side + 0.49 * B)
    assert not rows(-side + 0.51 * B)


def test_the_middle_between_the_wheels_is_on_none():
    assert not rows(0.0)


def test_lanes_of_one_height_have_no_step():
    assert not rows(-LEFT, x=-1.0)
    assert not rows(-LEFT, terrain=flat())


def test_a_turned_rover_has_its_wheels_elsewhere():
    assert rows(0.0, yaw=math.pi / 2), "the middle wheels stand about the border"
    assert not rows(0.6, yaw=math.pi / 2)
