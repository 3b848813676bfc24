"""Servos and end stops push as they are said to: in the air, a moment's acceleration through inverse dynamics."""

import pytest

from rover_pin.rover.rover import load_rover
from rover_pin.simulation.compiled.suspension import joint_strength

"""Step [s] in which nothing moves."""


@pytest.mark.parametrize("name", ["nexus6", "cart"])
def test_gains_scale_with_mass_and_wheel_from_5_8_kg_on_45_mm(name):
    rover = load_rover(name)
    wanted = rover.mass * float(rover.wheels[0].wheel.r) / (5.8 * 0.045)
    assert joint_strength(rover) == pytest.approx(wanted, rel=1e-5)
