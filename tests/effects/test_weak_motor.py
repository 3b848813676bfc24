"""Only the named wheel loses torque, and only its share."""

import pytest

from rover_pin.effects.effect import Drive
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.scenarios.scenario import scenario


def test_the_named_wheel_loses_its_share():
    drive = Drive(0.5, 1.0, 7.2, 24.0, 3.3, wheel=2)
    assert float(WeakMotor(g=0.25, wheel=2).torque(drive, 0.8, ())) == pytest.approx(-0.2)
    assert float(WeakMotor(g=0.25, wheel=3).torque(drive, 0.8, ())) == 0.0


def test_a_dead_motor_is_dragged_along():
    drive = scenario("flat", duration=4.0)
    model = drive.model.having(WeakMotor(g=1.0, wheel=2))
    from rover_pin.control.constant import ConstantDuty
    from rover_pin.simulation.simulate import simulate

    trace = simulate(model, ConstantDuty(0.55), 4.0)
    assert trace["torque_ml"][-1] == pytest.approx(0.0, abs=1e-9)
    assert trace["slip_ml"][-1] < 0.0 < trace["slip_mr"][-1]
