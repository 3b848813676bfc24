"""Effects in a motor, a sensor, a tether and a wheel's size, each by hand."""

import numpy as np
import pytest

from rover_pin import ConstantDuty, scenario, simulate
from rover_pin.contact import Load
from rover_pin.effects.dead_band import DeadBand
from rover_pin.effects.effect import Body, Drive
from rover_pin.effects.raw_current import RawCurrent
from rover_pin.effects.slip import AlgebraicSlip
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.effects.supply_sag import SupplySag
from rover_pin.effects.tacho_scale import TachoScale
from rover_pin.effects.tether_drag import TetherDrag
from rover_pin.effects.torque_saturation import TorqueSaturation
from rover_pin.effects.tracked_point import TrackedPoint
from rover_pin.effects.tracker_scale import TrackerScale
from rover_pin.effects.tracking_delay import TrackingDelay
from rover_pin.effects.viscous_friction import ViscousFriction
from rover_pin.effects.weak_motor import WeakMotor
from rover_pin.effects.wheel_scale import WheelScale
from rover_pin.effects.winding_heating import ALPHA_COPPER, WindingHeating


@pytest.mark.parametrize(
    ("delta", "reaching"), [(0.5, 0.42), (-0.5, -0.42), (0.08, 0.0), (0.03, 0.0), (-0.03, 0.0), (0.0, 0.0)]
)
def test_a_dead_band_is_taken_off_both_ways(drive, delta, reaching):
    assert float(DeadBand(delta_0=0.08).amend(drive(delta=delta), ()).delta) == pytest.approx(reaching, abs=1e-15)


def test_the_supply_falls_with_the_common_current(drive):
    assert SupplySag(R_b=2.0).amend(drive(), (0.3,)).supply == pytest.approx(6.6)


def test_six_stalled_motors_settle_at_the_divided_voltage(drive):
    """V = V_0 / (1 + R_b n delta^2 / R), with the current of the step before, even at the stiffest bounds."""
    effect, y, dt, bus, delta = SupplySag(R_b=20.0, tau=0.05), 0.0, 0.005, 0.0, 1.0
    for _ in range(400):
        amended = effect.amend(drive(delta=delta, omega=0.0, bus_current=bus), (y,))
        y += dt * effect.rate(amended, 0.0, (y,))[0] / (1 + 0.5 * dt / 0.05)
        bus = 6 * delta * amended.current
    assert amended.supply == pytest.approx(7.2 / (1 + 20.0 * 6 * delta**2 / 24.0), rel=1e-6)


def limited(effect, drive, current):
    """Return what is left of a current that is set by the duty at standstill."""
    return effect.amend(drive(omega=0.0, delta=current * 24.0 / 7.2), ()).current


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_current_is_limited_above_and_left_below(drive, sign):
    effect = TorqueSaturation(i_max=0.03)
    assert limited(effect, drive, sign * 0.01) == pytest.approx(sign * 0.01, rel=1e-4)
    assert limited(effect, drive, sign * 0.03) == pytest.approx(sign * 0.03 * 2 ** (-1 / 8))
    assert limited(effect, drive, sign * 0.3) == pytest.approx(sign * 0.03, rel=1e-8)


def test_a_back_driven_motor_is_limited_too(drive):
    """Rolling at 3 rad/s with no duty the motor would brake with 9 V / 24 ohm."""
    amended = TorqueSaturation(i_max=0.1).amend(drive(delta=0.0, omega=3.0), ())
    assert amended.current == pytest.approx(-0.1, rel=1e-4)


@pytest.mark.parametrize("omega", [-2.0, 0.0, 1.5])
def test_viscous_friction_opposes_the_rate_in_proportion(drive, omega):
    assert float(ViscousFriction(b_v=0.02).torque(drive(omega=omega), 0.3, ())) == pytest.approx(-0.02 * omega)


def test_the_named_wheel_loses_its_share():
    drive = Drive(0.5, 1.0, 7.2, 24.0, 3.3, wheel=2)
    assert float(WeakMotor(g=0.25, wheel=2).torque(drive, 0.8, ())) == pytest.approx(-0.2)
    assert float(WeakMotor(g=0.25, wheel=3).torque(drive, 0.8, ())) == 0.0


def test_a_dead_motor_is_dragged_along():
    drive = scenario("flat", duration=4.0)
    model = drive.model.having(WeakMotor(g=1.0, wheel=2))
    trace = simulate(model, ConstantDuty(0.55), 4.0)
    assert trace["torque_ml"][-1] == pytest.approx(0.0, abs=1e-9)
    assert trace["slip_ml"][-1] < 0.0 < trace["slip_mr"][-1]


def heated(effect, drive):
    y, dt = 0.0, effect.tau / 200.0
    for _ in range(4000):
        y += dt * effect.rate(effect.amend(drive, (y,)), 0.0, (y,))[0]
    return y


def test_a_winding_warms_up_at_the_rate_of_its_loss(drive):
    """At standstill: i = 3.6 V / 24 ohm = 0.15 A, 0.54 W."""
    assert WindingHeating(tau=60.0).rate(drive(omega=0.0), 0.0, (0.0,))[0] == pytest.approx(0.54 / 60.0)


def test_a_winding_s_steady_state_by_hand(drive):
    """At standstill y = (delta V)^2 / (R (1 + a y)) with a = alpha R_th: a quadratic in y."""
    effect, a = WindingHeating(R_th=100.0, tau=10.0), ALPHA_COPPER * 100.0
    stalled = drive(omega=0.0)
    y = (-1 + (1 + 4 * a * 3.6**2 / 24.0) ** 0.5) / (2 * a)
    assert heated(effect, stalled) == pytest.approx(y, rel=1e-6)
    assert effect.amend(stalled, (y,)).current == pytest.approx(0.15 / (1 + a * y))


TIMES, CURRENT = np.array([0.0, 0.1, 0.2]), np.array([0.0, 0.5, -2.0])


def test_counts_are_the_current_times_a_scale_and_a_zero():
    effect = RawCurrent(scale=200.0, offset=512.0, motor="rr", channel="adc_4")
    reading = effect.read(TIMES, {"current_rr_A": CURRENT, "current_fl_A": 7.0 * CURRENT})
    assert list(reading) == ["adc_4"]
    assert reading["adc_4"] == pytest.approx([512.0, 612.0, 112.0])


def test_what_a_sensor_misreads_can_be_undone():
    t = np.arange(0.0, 1.0, 0.1)
    channels = {"wheel_rate_fl": 1.0 + t, "wheel_rate_ml": 2.0 - t, "body_x": 3.0 + t, "body_yaw": t, "body_vx": t**2}
    late = {"body_x": 3.0 + t}
    back = TrackingDelay(d=0.2).undo(t, TrackingDelay(d=0.2).read(t, late))["body_x"]
    assert list(back[:-2]) == pytest.approx(late["body_x"][:-2])
    for sensor in (TachoScale(e=0.3), TachoScale(e=-0.2, wheel="ml"), TrackerScale(e=0.05), TrackedPoint(-0.2, 0.1)):
        read = channels | sensor.read(t, channels)
        assert {name: list(values) for name, values in sensor.undo(t, read).items()} == {
            name: pytest.approx(channels[name]) for name in sensor.read(t, channels)
        }


def test_it_comes_before_the_slip(patch):
    model = scenario("flat").model.having(WheelScale(e=0.1))
    assert [type(contact_effect).__name__ for contact_effect in model.contact_effects][:2] == [
        "WheelScale",
        "RelaxedSlip",
    ]
    contact = AlgebraicSlip().amend(WheelScale(e=0.1).amend(patch(rim=0.05, v_x=0.033), ()), ())
    assert float(contact.S) == pytest.approx(1.0 - 0.033 / 0.055)


def test_the_lever_is_the_true_one(patch):
    """Torque over tangential force of the torque form is the radius."""
    larger = WheelScale(e=0.1).amend(patch(), ())
    load = SoilTraction().load(larger, Load(), ())
    assert float(load.torque / load.f_t) == pytest.approx(1.1 * 0.045, rel=1e-9)


@pytest.mark.parametrize("e", [0.04, -0.04])
def test_speed_follows_the_rim(e):
    """On the flat, v = (1 + e) r omega (1 - S) with the slip that the soil asks for, near that of the plain wheel."""
    flat = scenario("flat").model
    plain, scaled = (simulate(model, ConstantDuty(0.55), 6.0) for model in (flat, flat.having(WheelScale(e=e))))
    rim = (1.0 + e) * 0.045 * scaled["wheel_rate_ml"][-1]
    assert scaled["body_vx"][-1] == pytest.approx(rim * (1.0 - scaled["slip_ml"][-1]), rel=1e-4)
    assert scaled["slip_ml"][-1] == pytest.approx(plain["slip_ml"][-1], abs=0.2 * abs(e))


FLAT = scenario("flat").model


def test_the_force_by_hand():
    effect = TetherDrag(f_0=0.5, f_1=0.2, x_0=1.0, y_0=2.0, v_0=1e-5)
    body = Body(4.0, 6.0, *[0.0] * 10, (), (), ())._replace(v_x=0.03, v_y=-0.04)
    push = effect.push(body)
    assert (float(push.f_x), float(push.f_y)) == pytest.approx((-1.5 * 0.6, 1.5 * 0.8), rel=1e-5)
    assert push[2:] == (0.0,) * 4 + ((), 0.0)
    still = effect.push(body._replace(v_x=0.0, v_y=0.0))
    assert (float(still.f_x), float(still.f_y)) == (0.0, 0.0)


@pytest.mark.parametrize("duty", [0.55, -0.55])
def test_what_it_takes_is_force_times_way(duty):
    """A constant pull on the straight; a growing one, int (f_0 + f_1 s) ds."""
    trace = simulate(FLAT.having(TetherDrag(f_0=1.0, f_1=0.5, v_0=1e-4)), ConstantDuty(duty), 10.0)
    way = abs(trace["body_x"][-1])
    assert way > 0.3
    assert trace["energy_body"][-1] == pytest.approx(1.0 * way + 0.25 * way**2, rel=0.01)
