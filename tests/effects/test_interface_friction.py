"""Interface friction: the rim's angle replaces the sand's, and full shear falls in proportion."""

import math

import pytest

from rover_pin.effects.interface_friction import InterfaceFriction
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.soil.angles import SinkageAngles


def test_the_rim_s_angle_replaces_that_of_the_sand(patch):
    m = math.tan(math.radians(20.0)) / math.tan(math.radians(30.0))
    soil = InterfaceFriction(m=m).amend(patch(soil=patch().soil.replace(c=100.0)), ()).soil
    assert float(soil.phi) == pytest.approx(math.radians(20.0))
    assert float(soil.c) == pytest.approx(100.0 * m)


@pytest.mark.parametrize("S", [-0.8, 0.3, 1.0])
def test_torque_falls_in_proportion_whatever_the_slip(patch, S):
    traction = SoilTraction(angles=SinkageAngles())
    whole, part = (traction.load(InterfaceFriction(m=m).amend(patch(S=S), ()), None, ()) for m in (1.0, 0.6))
    assert float(part.torque) == pytest.approx(0.6 * float(whole.torque))
