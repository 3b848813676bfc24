"""Supply sag: the voltage falls with what all motors draw, and settles where source and motors agree."""

import pytest

from rover_pin.effects.supply_sag import SupplySag


def test_voltage_falls_with_the_common_current(drive):
    assert SupplySag(R_b=2.0).amend(drive(), (0.3,)).supply == pytest.approx(6.6)


def test_six_stalled_motors_settle_at_the_divided_voltage(drive):
    """V = V_0 / (1 + R_b n delta^2 / R), with the current of the step before, even at the stiffest bounds."""
    effect, y, dt, bus, delta = SupplySag(R_b=20.0, tau=0.05), 0.0, 0.005, 0.0, 1.0
    for _ in range(400):
        amended = effect.amend(drive(delta=delta, omega=0.0, bus_current=bus), (y,))
        y += dt * effect.rate(amended, 0.0, (y,))[0] / (1 + 0.5 * dt / 0.05)
        bus = 6 * delta * amended.current
    assert amended.supply == pytest.approx(7.2 / (1 + 20.0 * 6 * delta**2 / 24.0), rel=1e-6)
