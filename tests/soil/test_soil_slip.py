"""Eq (1) and the speed ratio."""

import casadi as ca
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.soil.slip import slip_ratio, speed_ratio

SPEEDS = st.floats(1e-3, 10.0)


@given(SPEEDS, SPEEDS)
def test_slip_is_the_paper_s_two_branches(rim, v):
    printed = (rim - v) / rim if rim > v else (rim - v) / v
    assert slip_ratio(rim, v) == pytest.approx(printed, abs=1e-15)
    assert -1 <= slip_ratio(rim, v) <= 1


@given(SPEEDS, SPEEDS)
def test_slip_changes_sign_when_driving_and_braking_are_swapped(rim, v):
    assert slip_ratio(rim, v) == pytest.approx(-slip_ratio(v, rim), abs=1e-15)


@given(SPEEDS, SPEEDS)
def test_speed_ratio_inverts_slip(rim, v):
    assert speed_ratio(slip_ratio(rim, v)) == pytest.approx(v / rim, rel=1e-9)


def test_special_speeds():
    assert slip_ratio(0.0, 0.0) == 0.0
    assert slip_ratio(0.1, 0.0) == 1.0
    assert slip_ratio(0.0, 0.1) == -1.0
    assert slip_ratio(-0.1, 0.1) == -2.0
    assert slip_ratio(1e-4, 0.0, eps=1e-3) == pytest.approx(0.1)
    assert slip_ratio(0.003, 0.001) == pytest.approx(2.0 / 3.0)
    assert speed_ratio(1.0) == 0.0
    assert speed_ratio(-1.0) > 1e12


@given(st.floats(-0.999, 1.0))
def test_floats_equal_symbols_and_are_floats(S):
    x = ca.SX.sym("x")
    assert float(ca.Function("f", [x], [speed_ratio(x)])(S)) == pytest.approx(speed_ratio(S), rel=1e-12)
    assert isinstance(speed_ratio(S), float)


def test_slip_and_speed_ratio_share_one_slope_at_zero():
    x = ca.SX.sym("x")
    slope = ca.Function("f", [x], [ca.jacobian(speed_ratio(x), x), ca.jacobian(slip_ratio(1.0, 1 + x), x)])
    assert [float(part) for part in slope(0.0)] == [-1.0, -1.0]
