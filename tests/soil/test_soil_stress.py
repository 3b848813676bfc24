"""Shear in use, Eq (2), and where the arc begins, Eq (5)."""

import math

import casadi as ca
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.contact import Soil, Wheel
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.peak_stress import PeakAngle
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


def test_sinkage_angles_are_finite_above_soil_and_past_the_axle():
    assert 0 < SinkageAngles().angles(-0.01, WHEEL, Soil())[0] < 1e-5
    assert SinkageAngles().angles(1.0, WHEEL, Soil())[0] == pytest.approx(math.pi / 2)
    h = ca.SX.sym("h")
    slope = ca.Function("f", [h], [ca.jacobian(SinkageAngles().angles(h, WHEEL, Soil())[0], h)])
    assert all(math.isfinite(float(slope(value))) for value in (-0.01, 0.0, 0.01, 0.2))


def test_stress_peak_moves_forwards_with_slip_per_entry_angle():
    """theta_m = (a_0 + a_1 S) theta_1, Wong and Reece: 0.40 theta_1 at rest and 0.55 theta_1 at S = 1 by default."""
    assert PeakAngle().at(0.0, 0.7) == pytest.approx(0.4 * 0.7)
    assert PeakAngle().at(1.0, 0.7) == pytest.approx(0.55 * 0.7)
    assert PeakAngle(a_0=0.3, a_1=-0.2).at(-0.5, 0.6) == pytest.approx(0.4 * 0.6)
