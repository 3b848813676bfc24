"""Shear in use, Eq (2), where the arc begins, Eq (5), and the entry angle of a load."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin import SOILS, Soil, Wheel, wheel_forces
from rover_pin.base.errors import ParameterError
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.sinkage import entry_angle, sinkage
from rover_pin.soil.stress import mobilised_share
from tests.oracle.terramechanics import panel_forces

WHEEL, SOIL = Wheel(), Soil()


@given(
    load=st.floats(0.5, 12.0),
    S=st.floats(-1.0, 1.0),
    n=st.floats(0.5, 1.4),
    k=st.floats(1e-3, 0.1),
    ratio=st.floats(0.0, 1.0),
)
@settings(max_examples=60)
def test_the_entry_angle_carries_the_load(load, S, n, k, ratio):
    soil = SOIL.replace(n=n, k=k, exit_ratio=ratio)
    theta_1 = entry_angle(load, S, WHEEL, soil, steps=4)
    assert wheel_forces(S, theta_1, -ratio * theta_1, WHEEL, soil).f_n == pytest.approx(load, rel=1e-9)


@pytest.mark.parametrize("name", SOILS)
@pytest.mark.parametrize("load", [1e-3, 1.0, 9.483])
@pytest.mark.parametrize("S", [-0.5, 0.0, 1.0])
def test_three_steps_are_enough_for_every_published_soil(name, load, S):
    close = entry_angle(load, S, WHEEL, SOILS[name])
    assert math.log(close) == pytest.approx(math.log(entry_angle(load, S, WHEEL, SOILS[name], steps=8)), abs=1e-9)


def test_table_1_s_angles_carry_a_sixth_of_the_rover_at_no_slip():
    load = 5.8 * 9.81 / 6
    assert wheel_forces(0.0, SOIL.theta_1, SOIL.theta_2, WHEEL, SOIL).f_n == pytest.approx(load, rel=1e-6)
    assert entry_angle(load, 0.0, WHEEL, SOIL) == pytest.approx(math.radians(35), rel=1e-6)


def test_a_load_that_no_arc_carries_is_an_error_that_says_so():
    with pytest.raises(ParameterError, match=r"90.*load = 5000 N.*S = 0.1"):
        entry_angle(5000.0, 0.1, WHEEL, SOIL)


@pytest.mark.parametrize("name", SOILS)
def test_wheel_sunk_nearly_to_its_axle_is_carried_and_no_deeper(name):
    soil = SOILS[name]
    load = lambda deg: float(wheel_forces(0.2, *angles(deg), WHEEL, soil).f_n)  # noqa: E731
    angles = lambda deg: (math.radians(deg), -soil.exit_ratio * math.radians(deg))  # noqa: E731
    assert math.degrees(entry_angle(load(89.5), 0.2, WHEEL, soil)) == pytest.approx(89.5, rel=1e-9)
    with pytest.raises(ParameterError, match=r"entry.*90"):
        entry_angle(load(91.0), 0.2, WHEEL, soil)


def test_expressions_equal_floats_and_slopes_equal_differences():
    x = [ca.SX.sym(name) for name in ("W", "S", "k", "phi", "k_1")]
    soil = SOIL.replace(k=x[2], phi=x[3], k_1=x[4])
    angle = entry_angle(x[0], x[1], WHEEL, soil)
    f = ca.Function("f", [ca.vertcat(*x)], [angle, ca.jacobian(angle, ca.vertcat(*x))])
    point = [9.0, 0.2, 0.02, 0.5, 5e4]
    value, slope = f(point)
    there = SOIL.replace(k=0.02, phi=0.5, k_1=5e4)
    assert float(value) == pytest.approx(entry_angle(9.0, 0.2, WHEEL, there), rel=1e-12)
    for i, number in enumerate(point):
        step = 1e-5 * number
        up, down = list(point), list(point)
        up[i], down[i] = number + step, number - step
        difference = (f(up)[0] - f(down)[0]) / (2 * step)
        assert float(slope[0, i]) == pytest.approx(float(difference), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(("k", "sign", "declared"), [(0.001, 1.0, 4e-8), (0.001, -1.0, 1e-4), (0.05, -1.0, 1e-6)])
def test_the_entry_angle_is_as_good_as_its_docstring_says(k, sign, declared):
    """ln theta_1 against the load of the oracle's sum there, by d ln f_n / d ln theta_1."""
    soil, worst = SOIL.replace(k=k), 0.0
    for S in sign * np.linspace(0.02, 1.0, 50):
        theta_1 = entry_angle(9.5, float(S), WHEEL, soil)
        y, more = np.array([theta_1, 1.001 * theta_1]), (soil.c, soil.phi, k, soil.k_1, soil.n)
        at, *_ = panel_forces(S, y, -y * soil.exit_ratio, WHEEL.r, WHEEL.b, *more)
        steepness = math.log(at[1] / at[0]) / math.log(1.001)
        worst = max(worst, abs(math.log(at[0] / 9.5)) / steepness)
    assert worst < declared
    assert k == 0.05 or worst > 0.1 * declared


def test_shear_is_bounded_where_the_printed_exponential_is_not():
    printed = 1 - math.exp(30.0)
    assert printed < -1e12
    assert mobilised_share(-30.0) == pytest.approx(-1.0)
    assert mobilised_share(0.7) == pytest.approx(1 - math.exp(-0.7))
    assert mobilised_share(-0.7) == -mobilised_share(0.7)


def test_nothing_cancels_at_small_angles():
    """A parabola of pressure over the arc: r^2 k_1 int (theta_1^2 - theta^2) / 2."""
    assert sinkage(1e-6, WHEEL) == pytest.approx(WHEEL.r * 0.5e-12, rel=1e-9)
    soil = Soil(n=1.0, k_2=0.0, c=0.0, phi=0.0)
    pressed = wheel_forces(0.0, 1e-6, -1e-6, WHEEL, soil).f_n
    assert pressed == pytest.approx(WHEEL.r**2 * soil.k_1 * 2 / 3 * 1e-18, rel=1e-6)


@given(st.floats(1e-5, 1.5))
def test_sinkage_angles_invert_eq_5(theta_1):
    soil = Soil()
    angles = SinkageAngles().angles(sinkage(theta_1, WHEEL), WHEEL, soil)
    assert angles == pytest.approx((theta_1, -soil.exit_ratio * theta_1), rel=1e-9)
