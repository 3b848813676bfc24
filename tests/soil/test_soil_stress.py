"""Shear in use, Eq (2), and where the arc begins, Eq (5)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.contact import Soil, Wheel
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.sinkage import sinkage
from rover_pin.soil.stress import mobilised
from rover_pin.soil.traction import wheel_forces

WHEEL = Wheel()


def test_shear_is_bounded_where_the_printed_exponential_is_not():
    printed = 1 - math.exp(30.0)
    assert printed < -1e12
    assert mobilised(-30.0) == pytest.approx(-1.0)
    assert mobilised(0.7) == pytest.approx(1 - math.exp(-0.7))
    assert mobilised(-0.7) == -mobilised(0.7)


def test_nothing_cancels_at_small_angles():
    """A parabola of pressure over the arc: r^2 k_1 int (theta_1^2 - theta^2) / 2."""
    assert sinkage(1e-6, WHEEL) == pytest.approx(WHEEL.r * 0.5e-12, rel=1e-9)
    soil = Soil(n=1.0, k_2=0.0, c=0.0, phi=0.0)
    pressed = wheel_forces(0.0, 1e-6, -1e-6, WHEEL, soil).f_n
    assert pressed == pytest.approx(WHEEL.r**2 * soil.k_1 * 2 / 3 * 1e-18, rel=1e-6)


@given(st.floats(1e-5, 1.5))
def test_sinkage_angles_invert_eq_5(theta_1):
    soil = Soil()
    found = SinkageAngles().angles(sinkage(theta_1, WHEEL), WHEEL, soil)
    assert found == pytest.approx((theta_1, -soil.exit_ratio * theta_1), rel=1e-9)
