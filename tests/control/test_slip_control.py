"""The controller of section 5 by its parts, against numbers worked out by hand."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin import ConstantDuty, SlipControl, Wheel, load_rover, load_traction_factor, scenario, simulate
from rover_pin.base.errors import ParameterError
from rover_pin.control.open_loop import Turn
from rover_pin.control.slip_control import Gains, pi_law
from rover_pin.control.slip_estimate import SpeedTable, TableEstimate, TrueSlip, calibrated_table
from rover_pin.control.torque_check import LOST_SLIP, NoLimit, TorqueLimit, TorqueLimited
from rover_pin.effects.motion_resistance import MotionResistance
from rover_pin.rover.statics import wheel_loads
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.command import Command, Reading, Truth
from rover_pin.soil.wheel_forces import TorqueTraction
from tests.control.arc_torque import saturation_torque


def reading(duty=0.55, rate=1.0, slip=0.0, pitch=0.0, t=0.0):
    six = np.ones(6)
    truth = Truth(slip * six, 0.008 * six, 9.5 * six, 0.05 * six, np.zeros(3), np.zeros(3))
    return Reading(t, duty * six, rate * six, 0.1 * six, np.zeros(4), (0.0, pitch, 0.0), truth)


TABLE = SpeedTable((0.0, 0.5, 1.0), (0.0, 0.04, 0.09))


def test_eq_9_by_hand():
    """r omega = 0.045 * 1.2 = 0.054, v_hat(0.55) = 0.045: S_hat = 1 - 0.045 / 0.054."""
    slip = TableEstimate(TABLE, 0.045).slip(reading(0.55, 1.2))
    assert slip == pytest.approx(np.full(6, 1.0 - 0.045 / 0.054))


def test_the_estimate_is_odd_finite_at_rest_and_within_bounds():
    estimate = TableEstimate(TABLE, 0.045)
    assert estimate.slip(reading(-0.55, -1.2)) == pytest.approx(estimate.slip(reading(0.55, 1.2)))
    assert estimate.slip(reading(0.55, 0.0)) == pytest.approx(np.full(6, -1.0))
    assert estimate.slip(reading(0.0, 0.0)) == pytest.approx(np.ones(6))


def test_the_pi_law_by_hand():
    """Two periods of 0.05 s at e = -0.2: delta = 0.5 + 0.3 e + the integral of 2 e, unlimited."""
    gains = Gains(S_d=0.1, k_p=0.3, k_i=2.0, delta_0=0.5, delta_min=-1.0, delta_max=1.0)
    control = SlipControl(gains, TrueSlip(), period=0.05)
    assert control(reading(slip=0.3)).duty == pytest.approx(np.full(6, 0.5 - 0.06))
    assert control(reading(slip=0.3)).duty == pytest.approx(np.full(6, 0.5 - 0.06 - 0.02))
    control.reset()
    assert control(reading(slip=0.3)).duty == pytest.approx(np.full(6, 0.44))


def driven(control, slips, highest=()):
    """Return duty and integral of the first wheel after each slip; `highest` is the torque limit's duty at each."""
    readings = []
    for slip, high in itertools.zip_longest(slips, highest, fillvalue=1.0):
        control.limit = Cap(high)
        duty = control(reading(slip=slip)).duty[0]
        readings.append((duty, control.integral[0]))
    return np.array(readings).T


@dataclass(frozen=True)
class Cap(NoLimit):
    high: float

    def duty(self, reading):
        return self.high


SLIPS = st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=60)
CAPS = st.lists(st.floats(0.0, 1.0), min_size=60, max_size=60)


@given(slips=SLIPS, caps=CAPS, k_i=st.floats(0.01, 10.0))
def test_duty_and_integral_stay_within_their_limits(slips, caps, k_i):
    gains = Gains(k_i=k_i, delta_max=0.8)
    duty, integral = driven(SlipControl(gains, TrueSlip()), slips, caps[: len(slips)])
    most = np.minimum(0.8, caps[: len(slips)])
    assert np.all(duty <= most + 1e-12)
    assert np.all(duty >= np.minimum(0.05, most) - 1e-12)
    # what one period adds, and what e itself asks for, may stand beyond the limits: |e| <= 2
    outside = 0.005 + 2.0 * gains.k_p + 2.0 * k_i * 0.05
    assert np.all((integral < 0.8 - 0.55 + outside) & (integral > 0.05 - 0.55 - outside))


@pytest.mark.parametrize("steps", [10, 100, 2_000])
def test_a_long_saturation_is_forgotten_at_once(steps):
    """On the flat S < S_d whatever the duty: however long that lasts, a slip of 1 then takes the duty down as fast."""
    control = SlipControl(Gains(), TrueSlip())
    driven(control, [0.05] * steps)
    duty, _ = driven(control, [1.0] * 4)
    fresh, _ = driven(SlipControl(Gains(), TrueSlip()), [1.0] * 4)
    assert duty == pytest.approx(fresh, abs=0.005)


@pytest.mark.parametrize("k_i", [0.1, 1.0])
def test_noise_at_the_limit_is_no_ratchet(k_i):
    """S = 0.05 +- 0.1 under S_d = 0.1 at full duty: the integral stays within what a strong sample asks for."""
    rng = np.random.default_rng(1)
    gains = Gains(k_i=k_i)
    slips = np.clip(0.05 + 0.1 * rng.standard_normal(6_000), -1.0, 1.0)
    duty, integral = driven(SlipControl(gains, TrueSlip()), slips)
    assert integral.min() > -4.0 * 0.1 * gains.k_p - 4.0 * 0.1 * k_i * 0.05
    early, late = duty[1000:3000].mean(), duty[-2000:].mean()
    assert late == pytest.approx(early, abs=0.003)
    assert late > 0.5


@given(slip=st.floats(-1.0, 1.0), integral=st.floats(-1.0, 1.0), highest=st.floats(0.0, 1.0), k_p=st.floats(0.0, 5.0))
def test_the_integral_moves_with_the_error_or_rests(slip, integral, highest, k_p):
    """It never moves against the error, and rests only where the duty is at a limit that the error pushes against."""
    gains = Gains(k_p=k_p)
    error = float(gains.S_d - slip)
    step = pi_law(gains, slip, integral, highest)
    share = float(step.rate) / error if abs(error) > 1e-9 else 1.0
    assert -1e-12 <= share <= 1.0 + 1e-12
    wanted_duty = 0.55 + k_p * error + integral
    if (wanted_duty - float(step.duty)) * error <= 0.0:
        assert share == pytest.approx(1.0)


def test_torque_limit_is_the_saturation_torque_at_static_load():
    model = scenario("flat", soil="table-1", angles="sinkage").model
    limit = TorqueLimit.saturation(model)
    rover = load_rover()
    loads = wheel_loads(rover, 0.0)
    expected = [float(saturation_torque(load, Wheel(), model.soils[0])) for load in loads]
    assert limit.torque(0.0) == pytest.approx(expected, rel=1e-6)
    stall, free = float(model.motor.stall_torque), float(model.motor.no_load_rate)
    assert limit.duty(reading(rate=0.5)) == pytest.approx(np.array(expected) / stall + 0.5 / free, rel=1e-6)
    assert np.all(TorqueLimit.at_slip(model, 0.2).torque(0.0) < limit.torque(0.0))


@pytest.mark.parametrize("rover", ["nexus6", "cart"])
@pytest.mark.parametrize("slip", [0.2, 0.5])
def test_a_wheel_held_at_the_slip_limit_s_torque_slips_by_that(rover, slip):
    """The limit and the drive agree on what slip is, for any rover: T_lim r^-1 / W = F(S) of the torque form."""
    model = scenario("flat", rover=rover, gravity="moon", angles="fixed").model
    loads = wheel_loads(model.rover, math.radians(5.0), gravity=model.gravity)
    torque = TorqueLimit.at_slip(model, slip).torque(-math.radians(5.0))
    for load, mount, wheel_torque in zip(loads, model.rover.wheels, torque, strict=True):
        factor = load_traction_factor(slip, model.soils[0], mount.wheel, TorqueTraction())
        assert wheel_torque == pytest.approx(float(factor) * float(mount.wheel.r) * load, rel=1e-6)


def test_the_limit_is_of_the_duty_s_magnitude_and_raises_none():
    limit = TorqueLimit.at_slip(scenario("flat", soil="table-1").model, 0.2)
    most = limit.duty(reading(rate=0.4))
    assert limit.clip_duty(1.0, reading(rate=0.4)) == pytest.approx(most)
    assert limit.clip_duty(-1.0, reading(rate=-0.4)) == pytest.approx(-most)
    assert limit.clip_duty(0.01, reading(rate=0.4)) == pytest.approx(np.full(6, 0.01))
    assert limit.clip_duty(0.0, reading(rate=-1.0)) == pytest.approx(np.zeros(6))


def test_any_controller_can_be_limited():
    """Held still, a wheel gets the duty at which its motor gives T_lim; steering passes, reset reaches inside."""
    limit = TorqueLimit.at_slip(scenario("flat", soil="table-1").model, 0.2)
    control = SlipControl(Gains(), TrueSlip(), integral=3.0)
    limited = TorqueLimited(control, limit)
    limited.reset()
    assert control.integral == 0.0
    assert limited(reading(rate=0.0)).duty == pytest.approx(limit.torque(0.0) / float(limit.motor.stall_torque))
    assert TorqueLimited(lambda reading_now: Command(0.5, 0.3), NoLimit())(reading()) == Command(0.5, 0.3)
    assert TorqueLimited(lambda reading_now: 1.0, limit)(reading(rate=0.0)).duty == pytest.approx(
        limit.duty(reading(rate=0.0))
    )


def test_the_measured_table_has_the_paper_s_point_and_grows():
    table = calibrated_table(scenario("flat", soil="table-1").model, (0.3, 0.55, 0.8))
    assert table.speed[2] == pytest.approx(0.05, rel=0.01)
    assert np.all(np.diff(table.speed) > 0.0)
    with pytest.raises(ParameterError, match=r"duties.*increasing"):
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


@pytest.mark.parametrize(("S", "degrees"), [(0.2, 1.7), (LOST_SLIP, 4.7), (1.0, 8.8)])
def test_the_slope_that_a_slip_limit_holds(S, degrees):
    """What argues for the default slip limit: statics of Table 1's sand with the ready-made resistance."""
    model = scenario("flat", soil="table-1").model
    F = float(load_traction_factor(S, model.soils[0], model.rover.wheel, TorqueTraction()))
    assert math.degrees(math.atan(F - float(model.effect(MotionResistance).R))) == pytest.approx(degrees, abs=0.05)


def test_torque_limit_alone_prevents_the_slip_that_digs():
    """Up a slope beyond T_lim's the wheels turn at S_lim or less, where constant duty spins them; no slip is sensed."""
    slope = {"terrain.angle_deg": 7.0, "terrain.start": -2.0, "soil.k": 0.05, "duration": 8.0}
    free, limited = (
        scenario("incline", soil="table-1", control=control, **slope).drive() for control in ("none", "limit")
    )
    late = free.t > 3.0
    assert np.mean(free.stack("slip")[late]) > LOST_SLIP + 0.1
    limit = scenario("incline", soil="table-1", control="limit", **slope).controller.limit
    most = np.array([limit.torque(pitch) for pitch in limited["body_pitch"][late]])
    assert np.all(limited.stack("torque")[late] < 1.02 * most)
    assert np.mean(limited.stack("slip")[late]) < LOST_SLIP + 0.1


@dataclass(frozen=True)
class Own(NoLimit):
    """A user's limit: a fifth of full duty."""

    def duty(self, reading):
        return 0.2

    def clip_duty(self, duty, reading):
        return np.clip(duty, -0.2, 0.2)


@pytest.mark.parametrize("control", ["slip", "constant", "table"])
def test_a_limit_of_a_user_s_own_holds_in_a_drive(control):
    model = scenario("flat", soil="table-1").model
    controller = {
        "slip": SlipControl(Gains(), TrueSlip(), Own()),
        "table": SlipControl(Gains(), TableEstimate(TABLE, 0.045), Own()),
        "constant": TorqueLimited(ConstantDuty(0.6), Own()),
    }[control]
    assert simulate(model, controller, 0.5).stack("duty").max() == pytest.approx(0.2)


class Pessimist:
    """A user's estimate: every wheel spins on the spot."""

    def slip(self, reading):
        return np.ones_like(reading.wheel_rate)


def test_an_estimate_of_a_user_s_own_holds_in_a_drive():
    gains = Gains()
    last_duty = simulate(scenario("flat", soil="table-1").model, SlipControl(gains, Pessimist()), 2.0).stack("duty")[-1]
    assert last_duty == pytest.approx(gains.delta_min)
