"""Exit angle: both readings move alike, within their bounds, and a longer arc bears more."""

import math

import pytest

from rover_pin.effects.exit_angle import ExitAngle
from rover_pin.effects.soil_traction import SoilTraction


def test_ratio_and_angle_move_alike(patch):
    soil = ExitAngle(e_1=0.3).amend(patch(S=0.5), ()).soil
    assert float(soil.exit_ratio) == pytest.approx(1.0 / 7.0 + 0.15)
    assert float(soil.theta_2) == pytest.approx(-math.radians(5.0) - 0.15 * math.radians(35.0))
    assert float(-soil.theta_2 / soil.theta_1) == pytest.approx(float(soil.exit_ratio))


def test_a_longer_arc_bears_more_and_asks_more_torque(patch):
    short, long = (SoilTraction().load(ExitAngle(e_1=e).amend(patch(S=0.6), ()), None, ()) for e in (0.0, 0.5))
    assert float(long.f_n) > float(short.f_n)
    assert float(long.torque) > float(short.torque)
