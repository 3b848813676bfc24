"""Eq (1) and the speed ratio."""

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
