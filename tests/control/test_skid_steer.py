"""A rover without steering turns by its sides' speeds, dragged by the soil's side force."""

from __future__ import annotations

import numpy as np
import pytest

from rover_pin import load_rover, scenario
from rover_pin.control.open_loop import Turn
from rover_pin.effects.flank_pressure import FlankPressure

CART = load_rover("cart")
TRACK = 0.52
"""Distance of the cart's wheels left and right [m]."""


def test_side_speeds_are_proportional_to_their_distance():
    turn = Turn.of(CART, radius=1.04, delta=0.6)
    assert turn.steer == ()
    assert turn.duty == pytest.approx((0.36, 0.6, 0.36, 0.6))
    assert Turn.of(CART, -1.04, 0.6).duty == pytest.approx((0.6, 0.36, 0.6, 0.36))
    assert Turn.of(CART, 0.0, 0.6).duty == pytest.approx((-0.6, 0.6, -0.6, 0.6))
    inside = Turn.of(CART, TRACK / 4, 0.6).duty
    assert inside == pytest.approx((-0.2, 0.6, -0.2, 0.6))


def yaw_rate_and_kinematic(trace) -> tuple[float, float]:
    """The mean rates of yaw in the second half [rad/s]: driven, and as if no wheel slipped, (v_r - v_l) / track."""
    late = trace.t > 0.5 * trace.t[-1]
    rims = 0.11 * trace.stack("wheel_rate")[late]
    driven = (trace["body_yaw"][-1] - trace["body_yaw"][late][0]) / (trace.t[-1] - trace.t[late][0])
    return float(driven), float(np.mean(rims[:, 1::2]) - np.mean(rims[:, ::2])) / TRACK


def test_without_side_force_it_turns_more():
    """The scrub is the side force's: with a tenth of it the same duties turn the cart further."""
    little = {"effect.CombinedShear.share": 0.1, "effect.FlankPressure.share": 0.1 * FlankPressure().share}
    free, dragged = (
        yaw_rate_and_kinematic(scenario("point-turn", rover="cart", duration=12.0, **sides).drive())
        for sides in (little, {})
    )
    assert free[0] / free[1] > 1.1 * dragged[0] / dragged[1]


def test_motors_too_weak_for_scrub_are_said():
    """Scrubbing round takes thrust against brake on the sides; half the sized torque does not turn it on the spot."""
    sized = scenario("point-turn", rover="cart", duration=5.0)
    weak = {"motor.resistance": 3.0 * sized.model.motor.resistance}
    assert np.abs(sized.drive().stack("duty")[-1]).max() < 1.0
    warnings = scenario("point-turn", rover="cart", duration=5.0, **weak).drive().attrs["warnings"]
    assert any("does not follow" in line and "largest duty" in line for line in warnings)
