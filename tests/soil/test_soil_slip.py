"""Eq (1), the speed ratio, and slip over the whole travel, by hand: straight, askew and aside."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.soil.slip import (
    against_travel,
    drift,
    pushed_aside,
    rim_and_travel,
    slip_ratio,
    slip_ratios,
    speed_ratio,
    spinning,
)

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
    assert slip_ratios(*rim_and_travel(np.linspace(-1, 1, 9))) == pytest.approx(np.linspace(-1, 1, 9), abs=1e-15)


@pytest.mark.parametrize(("rim", "degrees"), [(0.03, 30.0), (0.05, 45.0), (0.2, 60.0), (0.0, 15.0), (0.05, 89.0)])
def test_slips_are_of_the_speed_that_brakes(rim, degrees):
    """u = v V / sqrt(v^2 + (v_y / 5)^2) with V = 0.05 m/s, and the greater of r omega and u divides."""
    beta = math.radians(degrees)
    v, v_y = 0.05 * math.cos(beta), 0.05 * math.sin(beta)
    u = v * 0.05 / math.hypot(v, v_y / 5)
    faster, before = max(rim, u), max(rim, v)
    S, S_y = against_travel((rim - v) / before, v_y / before)
    assert float(S) == pytest.approx((rim - u) / faster, abs=1e-9)
    assert float(S_y) == pytest.approx(v_y / faster, rel=1e-9)
    assert float(pushed_aside(S, S_y)) == pytest.approx(
        (v_y / 5) ** 2 / (min(u, faster) ** 2 + (v_y / 5) ** 2), rel=1e-6
    )


def test_a_share_of_it_lies_between_the_heading_and_the_travel():
    half, full = (float(against_travel(-0.2, 0.8, share)[0]) for share in (0.5, 1.0))
    assert float(against_travel(-0.2, 0.8, 0.0)[0]) == pytest.approx(-0.2, rel=1e-12)
    assert 0.8 / (1 + half) == pytest.approx((1.0 + 0.8 / (1 + full)) / 2)


def test_a_wheel_pushed_aside_does_not_spin():
    """1 - V / r omega of the greater of v and v_y: of a slip of 1 with v_y as fast as the rim nothing is left."""
    assert float(spinning(0.7, 0.1)) == pytest.approx(0.7, rel=1e-4)
    assert float(spinning(1.0, 0.4)) == pytest.approx(0.6, rel=1e-6)
    assert float(spinning(1.0, 3.0)) == 0.0
    assert float(spinning(-0.5, 0.3)) == 0.0


def test_drift_is_the_way_aside_per_way_ahead():
    assert float(drift(0.6, 0.2)) == pytest.approx(0.2 / math.hypot(0.4, 0.02))
    assert float(drift(-0.5, -0.3)) == pytest.approx(-0.3 / math.hypot(1.0, 0.02))
    assert float(drift(1.0, 0.0)) == 0.0
