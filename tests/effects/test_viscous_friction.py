"""Viscous friction: it dissipates, and lowers the no-load rate as by hand."""

import pytest

from rover_pin.effects.viscous_friction import ViscousFriction


@pytest.mark.parametrize("omega", [-2.0, 0.0, 1.5])
def test_it_opposes_the_rate_in_proportion(drive, omega):
    assert float(ViscousFriction(b_v=0.02).torque(drive(omega=omega), 0.3, ())) == pytest.approx(-0.02 * omega)


def test_no_load_rate(drive):
    """K (delta V - K omega) / R = b omega at omega = K delta V / (K^2 + b R)."""
    effect, omega = ViscousFriction(b_v=0.05), 3.0 * 0.5 * 7.2 / (9.0 + 0.05 * 24.0)
    idle = drive(omega=omega)
    assert 3.0 * idle.current + float(effect.torque(idle, 3.0 * idle.current, ())) == pytest.approx(0.0, abs=1e-15)
