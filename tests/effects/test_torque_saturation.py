"""Current limit: transparent below, the limit above, for driving and braking alike."""

import pytest

from rover_pin.effects.torque_saturation import TorqueSaturation


def limited(effect, drive, current):
    """Return what is left of a current that is set by the duty at standstill."""
    return effect.amend(drive(omega=0.0, delta=current * 24.0 / 7.2), ()).current


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_transparent_below_and_the_limit_above(drive, sign):
    effect = TorqueSaturation(i_max=0.03)
    assert limited(effect, drive, sign * 0.01) == pytest.approx(sign * 0.01, rel=1e-4)
    assert limited(effect, drive, sign * 0.03) == pytest.approx(sign * 0.03 * 2 ** (-1 / 8))
    assert limited(effect, drive, sign * 0.3) == pytest.approx(sign * 0.03, rel=1e-8)


def test_a_back_driven_motor_is_limited_too(drive):
    """Rolling at 3 rad/s with no duty the motor would brake with 9 V / 24 ohm."""
    amended = TorqueSaturation(i_max=0.1).amend(drive(delta=0.0, omega=3.0), ())
    assert amended.current == pytest.approx(-0.1, rel=1e-4)
