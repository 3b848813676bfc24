"""The controller of section 5 by its parts, against numbers worked out by hand."""

import math

import numpy as np
import pytest

from rover_pin.body.rover import load_rover
from rover_pin.contact import Wheel
from rover_pin.control.constant import ConstantDuty
from rover_pin.control.slip_control import Gains, SlipControl
from rover_pin.control.slip_estimate import SpeedTable, TableEstimate, TrueSlip, calibrated_table
from rover_pin.control.steering import Turn, wheel_places
from rover_pin.control.torque_limit import NoLimit, TorqueLimit
from rover_pin.errors import ParameterError
from rover_pin.motion.command import Reading, Truth
from rover_pin.scenarios import scenario
from rover_pin.soil.limits import saturation_torque


def reading(duty=0.55, rate=1.0, slip=0.0, pitch=0.0, t=0.0):
    six = np.ones(6)
    truth = Truth(slip * six, 0.008 * six, 9.5 * six, 0.05 * six, np.zeros(3), np.zeros(3))
    return Reading(t, duty * six, rate * six, 0.1 * six, np.zeros(4), (0.0, pitch, 0.0), truth)


TABLE = SpeedTable((0.0, 0.5, 1.0), (0.0, 0.04, 0.09))


def test_eq_9_by_hand():
    """r omega = 0.045 * 1.2 = 0.054, v_hat(0.55) = 0.045: S_hat = 1 - 0.045 / 0.054."""
    found = TableEstimate(TABLE, 0.045).slip(reading(0.55, 1.2))
    assert found == pytest.approx(np.full(6, 1.0 - 0.045 / 0.054))


def test_the_estimate_is_odd_finite_at_rest_and_within_bounds():
    estimate = TableEstimate(TABLE, 0.045)
    assert estimate.slip(reading(-0.55, -1.2)) == pytest.approx(estimate.slip(reading(0.55, 1.2)))
    assert estimate.slip(reading(0.55, 0.0)) == pytest.approx(np.full(6, -1.0))
    assert estimate.slip(reading(0.0, 0.0)) == pytest.approx(np.ones(6))


def test_a_spinning_loaded_wheel_reads_as_gripping():
    """The estimate's flaw, section 7 of the findings: it turns slower at the same duty, so S_hat falls, not rises."""
    estimate = TableEstimate(TABLE, 0.045)
    assert estimate.slip(reading(0.55, 0.9, slip=1.0))[0] < estimate.slip(reading(0.55, 1.05, slip=0.05))[0]


def test_the_pi_law_by_hand():
    """Two periods of 0.05 s at e = -0.2: delta = 0.5 + 0.3 e + the integral of 2 e, unlimited."""
    gains = Gains(S_d=0.1, k_p=0.3, k_i=2.0, k_aw=5.0, delta_0=0.5, delta_min=-1.0, delta_max=1.0)
    control = SlipControl(gains, TrueSlip(), period=0.05)
    assert control(reading(slip=0.3)).duty == pytest.approx(np.full(6, 0.5 - 0.06))
    assert control(reading(slip=0.3)).duty == pytest.approx(np.full(6, 0.5 - 0.06 - 0.02))
    control.reset()
    assert control(reading(slip=0.3)).duty == pytest.approx(np.full(6, 0.44))


def test_the_integral_does_not_wind_up_on_the_flat():
    gains = Gains(S_d=0.1, k_p=0.1, k_i=1.0, k_aw=2.0, delta_0=0.55, delta_max=0.55)
    control = SlipControl(gains, TrueSlip())
    for _ in range(2000):
        control(reading(slip=0.05))
    assert np.all(np.abs(control.integral) < 0.1)
    control(reading(slip=1.0))
    assert control(reading(slip=1.0)).duty[0] < 0.5


def test_the_torque_limit_is_the_saturation_torque_at_the_static_load():
    model = scenario("flat").model
    limit = TorqueLimit.saturation(model)
    rover = load_rover()
    from rover_pin.body.statics import wheel_loads

    loads = wheel_loads(rover, 0.0)
    expected = [float(saturation_torque(load, Wheel(), model.soils[0])) for load in loads]
    assert limit.torque(0.0) == pytest.approx(expected, rel=1e-6)
    stall, free = float(model.motor.stall_torque), float(model.motor.no_load_rate)
    assert limit.duty(reading(rate=0.5)) == pytest.approx(np.array(expected) / stall + 0.5 / free, rel=1e-6)
    assert np.all(TorqueLimit.at_slip(model, 0.2).torque(0.0) < limit.torque(0.0))


def test_the_limit_caps_the_command():
    model = scenario("flat").model
    control = SlipControl(Gains(delta_max=1.0, delta_0=1.0), TrueSlip(), TorqueLimit.saturation(model))
    given = control(reading(rate=0.0)).duty
    assert given == pytest.approx(TorqueLimit.saturation(model).duty(reading(rate=0.0)))
    assert NoLimit().duty(reading()) == 1.0


def test_the_measured_table_has_the_paper_s_point_and_grows():
    table = calibrated_table(scenario("flat").model, (0.3, 0.55, 0.8))
    assert table.speed[2] == pytest.approx(0.05, rel=0.01)
    assert np.all(np.diff(table.speed) > 0.0)
    with pytest.raises(ParameterError, match="needs two or more duties in increasing order"):
        SpeedTable((0.5, 0.4), (0.1, 0.2))


def test_a_turn_points_every_wheel_across_its_radius():
    rover = load_rover()
    turn = Turn.of(rover, radius=0.8, delta=0.5)
    places = wheel_places(rover)
    steered = [mount for mount in rover.wheels if mount.steer_dof is not None]
    middle = places["ml"][0]
    for mount, angle in zip(steered, turn.steer, strict=True):
        to_centre = np.array([middle, 0.8]) - places[mount.name][:2]
        assert np.array([math.cos(angle), math.sin(angle)]) @ to_centre == pytest.approx(0.0, abs=1e-12)
    assert max(turn.duty) == pytest.approx(0.5)
    assert turn.duty[1] > turn.duty[0]
    assert Turn.of(rover, radius=-0.8, delta=0.5).duty[0] == pytest.approx(turn.duty[1])
    with pytest.raises(ParameterError, match="no steered wheel"):
        Turn.of(load_rover("cart"))


def test_a_duty_outside_its_range_is_refused():
    with pytest.raises(ParameterError, match=r"ConstantDuty.delta = 1.2"):
        ConstantDuty(1.2)


@pytest.mark.parametrize("control", ["eq9", "true"])
def test_control_drives_the_flat(control):
    trace = scenario("flat", control=control).drive()
    assert trace["body_vx"][-1] > 0.03
    assert trace.attrs["control"] == "SlipControl"
