"""Winding heating: the temperature settles at R_th times the loss, and the torque falls with it."""

import pytest

from rover_pin.effects.winding_heating import ALPHA_COPPER, WindingHeating


def settled(effect, drive):
    y, dt = 0.0, effect.tau / 200.0
    for _ in range(4000):
        y += dt * effect.rate(effect.amend(drive, (y,)), 0.0, (y,))[0]
    return y


def test_it_warms_up_at_the_rate_of_its_loss(drive):
    """At standstill: i = 3.6 V / 24 ohm = 0.15 A, 0.54 W."""
    assert WindingHeating(tau=60.0).rate(drive(omega=0.0), 0.0, (0.0,))[0] == pytest.approx(0.54 / 60.0)


def test_steady_state_by_hand(drive):
    """At standstill y = (delta V)^2 / (R (1 + a y)) with a = alpha R_th: a quadratic in y."""
    effect, a = WindingHeating(R_th=100.0, tau=10.0), ALPHA_COPPER * 100.0
    stalled = drive(omega=0.0)
    y = (-1 + (1 + 4 * a * 3.6**2 / 24.0) ** 0.5) / (2 * a)
    assert settled(effect, stalled) == pytest.approx(y, rel=1e-6)
    assert effect.amend(stalled, (y,)).current == pytest.approx(0.15 / (1 + a * y))


def test_a_pause_cools(drive):
    assert WindingHeating().rate(drive(delta=0.0, omega=0.0), 0.0, (0.5,))[0] < 0.0
