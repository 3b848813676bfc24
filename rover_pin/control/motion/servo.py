"""Control of the wheel speeds: a PI servo for the rate of each wheel, and the wheel speeds that hold a motion of the
body.

`LawControl` is the common form of controls whose law is one CasADi function; `RouteControl` in `route.py` has this form
too.
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Protocol, Self

import casadi as ca
import numpy as np

from rover_pin.base.arguments import check_arguments, spec
from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Record, quantities, quantity
from rover_pin.contact import Scalar
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.control.open_loop import MAX_STEER
from rover_pin.control.torque_check import CUSTOM_LIMIT, NoLimit, TorqueLimit, native_limit
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import effective_track
from rover_pin.simulation.command import Command, Reading
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.native.control import CompiledController, DriveLaw
from rover_pin.simulation.stepping.timing import CONTROL_PERIOD
from rover_pin.simulation.trace.trace import Trace

MIN_TURN_RATIO = 0.5
"""Minimum ratio of the driven yaw rate to the commanded yaw rate. Below this value, a drive reports that the rover does
not follow the command."""
MAX_COMMAND = 1e3
"""Maximum speed [m/s] or rate [rad/s] that may be commanded; it is far above the speed of every motor."""


class LawControl(Protocol):
    """A control whose law is one CasADi function, which is evaluated in Python or compiled into the step of the
    simulation.

    The function `law` has the inputs (place, read, limits, memory, numbers) and the outputs (duties, steering angles,
    memory after the sample).

    - place: time t [s], and x and y of the base [m]
    - read: roll, pitch and yaw [rad], wheel rates [rad/s], motor currents [A], suspension angles [rad]
    - limits: the lowest duties of all wheels that the torque limit allows, then the highest duties [-]
    - memory: quantities that the control keeps from one sample to the next
    - numbers: constants of the law

    A law that needs only the first entries of an input may declare this input with fewer entries.
    """

    limit: TorqueLimit | NoLimit
    memory: np.ndarray

    @property
    def law(self) -> ca.Function:
        """The law of the control as a CasADi function; the class `LawControl` lists its inputs and outputs."""

    @property
    def numbers(self) -> np.ndarray:
        """The constants of the control's law, the last input of the function `law`."""

    @property
    def fresh(self) -> np.ndarray:
        """The memory of the control at the start of a drive."""

    def reset(self) -> None:
        """Set the memory of the control to its values at the start of a drive."""
        self.memory[:] = self.fresh

    def __call__(self, reading: Reading) -> Command:
        """Return the duty and the steering angle of each wheel for a reading of the sensors, and update the memory."""
        law, ones = self.law, np.ones(len(reading.wheel_rate))
        place = [reading.t, *(reading.truth.position[:2] if law.size1_in(0) > 1 else ())]
        read = np.concatenate([reading.attitude, reading.wheel_rate, reading.current, reading.suspension])
        limits = np.concatenate([self.limit.clip_duty(sense * ones, reading) for sense in (-1.0, 1.0)])
        # The law may declare its inputs shorter than they are; it then gets the first entries.
        out = law(place, read[: law.size1_in(1)], limits[: law.size1_in(2)], self.memory, self.numbers)
        duty, steer, self.memory[:] = (values.full().ravel() for values in out)
        return Command(duty, steer if steer.size else 0.0)

    def native(self, wheels: int) -> CompiledController | None:
        """Return the control in the form for the compiled simulation loop, or None if its torque limit is a class that
        a user has written, because Python code must then be called.

        The compiled loop updates the memory of this control.
        """
        limit, law = native_limit(self.limit), self.law
        if limit is CUSTOM_LIMIT:
            return None
        duty, steer = (np.zeros(law.size1_out(output)) for output in (0, 1))
        return CompiledController(duty, steer, limit=limit, law=DriveLaw(law, self.numbers, self.memory))


@dataclass(frozen=True)
class Servo(Record):
    """A PI servo for the rate of a wheel: it computes the duty delta of the motor that turns the wheel at the desired
    rate omega_d.

        delta = omega_d / omega_0 + k_p e + k_i int e dt,  e = (omega_d - omega) / omega_0,  |delta| <= delta_max

    omega is the present rate of the wheel, and omega_0 its rate at full duty without load. The first term is the duty
    at which the unloaded wheel turns at omega_d, and the integral compensates the load. For a motor without lag and the
    sampling time T, the poles of the closed loop are ((1 - k_p) +- sqrt((1 - k_p)^2 - 4 (k_i T - k_p))) / 2, which is
    0.4 +- 0.2i for the defaults.
    """

    k_p: Scalar = quantity(0.2, "", "assumed: a sample of delay leaves the loop stable below 1", 0.0, 100.0, "k_p")
    k_i: Scalar = quantity(8.0, "1/s", "assumed: settles in five samples", 0.0, 1000.0, "k_i")
    delta_max: Scalar = quantity(1.0, "", "full supply voltage", 0.0, 1.0, "delta_max")

    def step(
        self, share: Scalar, rate_share: Scalar, integral: Scalar, lowest: Scalar, highest: Scalar, period: Scalar
    ) -> tuple[Scalar, Scalar]:
        """Return the duty of a wheel's motor, and the integral part of the duty after the sample.

        The arguments may be floats or CasADi expressions. While the duty is at a limit, the integral does not grow
        further (conditional integration), so that it decreases as soon as the error of the wheel's rate changes its
        sign.

        Parameters
        ----------
        share, rate_share : Scalar
            Desired rate and present rate of the wheel, both divided by omega_0, the rate at full duty without load [-].
        integral : Scalar
            Integral part of the duty [-].
        lowest, highest : Scalar
            Lowest and highest duty that the torque limit allows [-].
        period : Scalar
            Sampling time T [s].
        """
        error = share - rate_share
        lower, upper = ca.fmax(-self.delta_max, lowest), ca.fmin(self.delta_max, highest)
        proportional = share + self.k_p * error
        duty = ca.fmin(ca.fmax(proportional + integral, lower), upper)
        # At a limit of the duty, the integral may only move away from this limit.
        low, high = ca.fmin(integral, lower - proportional), ca.fmax(integral, upper - proportional)
        return duty, ca.fmin(ca.fmax(integral + period * self.k_i * error, low), high)


def servo_duties(
    servo: Servo, rates: ca.SX, rates_now: ca.SX, integrals: ca.SX, limits: ca.SX, omega_0: Scalar, period: Scalar
) -> tuple[ca.SX, ca.SX]:
    """Return the duties of all wheels by one servo for each wheel, and the integrals of the servos after the sample.

    Parameters
    ----------
    servo : Servo
        Gains and largest duty, common to all wheels.
    rates, rates_now : column (wheels,)
        Desired rates and present rates of the wheels [rad/s].
    integrals : column (wheels,)
        Integral parts of the duties before the sample [-].
    limits : column (2 wheels,)
        Lowest duties of all wheels, then their highest duties [-].
    omega_0 : Scalar
        Rate of a wheel at full duty without load [rad/s].
    period : Scalar
        Sampling time [s].
    """
    n = rates.numel()
    steps = [
        servo.step(rates[i] / omega_0, rates_now[i] / omega_0, integrals[i], limits[i], limits[n + i], period)
        for i in range(n)
    ]
    return ca.vertcat(*(duty for duty, _ in steps)), ca.vertcat(*(after for _, after in steps))


def servo_symbols() -> tuple[Servo, ca.SX]:
    """Return a servo whose gains are CasADi symbols, and a column of these symbols.

    CasADi laws for several wheels take the gains of their servo as this column.
    """
    symbols = ca.SX.sym("servo", len(quantities(Servo)))
    return Servo(**dict(zip(quantities(Servo), ca.vertsplit(symbols), strict=True))), symbols


@lru_cache(maxsize=16)
def _held_speeds_law(wheels: int, steered: int) -> ca.Function:
    """Return the CasADi function that is the law of `HeldSpeeds`, with the inputs and outputs of `LawControl.law`.

    `wheels` is the number of wheels, and `steered` the number of wheels that steer.

    The constants of the law are the gains of the servo, the wheel rate at full duty without load, the sampling time,
    the desired wheel rates and the steering angles. Its memory contains the integrals of the servos.
    """
    servo, symbols = servo_symbols()
    omega_0, period, rates = ca.SX.sym("omega_0"), ca.SX.sym("period"), ca.SX.sym("rates", wheels)
    angles, read, limits = ca.SX.sym("angles", steered), ca.SX.sym("read", 3 + wheels), ca.SX.sym("limits", 2 * wheels)
    integrals = ca.SX.sym("integrals", wheels)
    duties, after = servo_duties(servo, rates, read[3:], integrals, limits, omega_0, period)
    inputs = [ca.SX.sym("t"), read, limits, integrals, ca.vertcat(symbols, omega_0, period, rates, angles)]
    return ca.Function("held_speeds", inputs, [duties, angles, after])


@dataclass
class HeldSpeeds(LawControl):
    """A control that holds the rate of each wheel by a PI servo, and the angle of each wheel that steers.

    `HeldSpeeds.of` computes the rates and angles for a speed and a yaw rate of the body.

    Parameters
    ----------
    rates : tuple
        Desired rates of the wheels (wheels,) [rad/s].
    angles : tuple
        Steering angles [rad], one for each wheel that steers.
    omega_0 : float
        Rate of a wheel at full duty without load [rad/s].
    servo : Servo
        Gains, and the largest duty.
    limit : TorqueLimit or NoLimit
        A torque limit that also limits the duties.
    motion : BodyMotion, optional
        Motion of the body that the rates and angles were computed for. If it is given, a drive reports when the rover
        does not follow this motion.
    track : float
        Effective distance between the two sides [m], which determined the rates; 0 if wheels steer.
    period : float
        Time between two samples [s].

    Raises
    ------
    ParameterError
        A desired rate is above omega_0.

    Source: a PI servo with conditional integration, as in textbooks, with the kinematics of `rolling`.

    Examples
    --------
    >>> from rover_pin import scenario, simulate
    >>> model = scenario("flat", rover="cart").model
    >>> trace = simulate(model, HeldSpeeds.of(model.rover, model.motor, 0.05), 3.0)
    >>> round(float(trace["wheel_rate_fl"][-1]) * 0.11, 3)
    0.05
    """

    rates: tuple[float, ...]
    angles: tuple[float, ...]
    omega_0: float
    servo: Servo = field(default_factory=Servo)
    limit: TorqueLimit | NoLimit = field(default_factory=NoLimit)
    motion: BodyMotion | None = None
    track: float = 0.0
    period: float = CONTROL_PERIOD

    def __post_init__(self) -> None:
        self.memory = self.fresh
        fastest = max(map(abs, self.rates))
        if not fastest <= self.omega_0:
            raise ParameterError(
                f"a wheel would have to turn at {fastest:.3g} rad/s, but its motor reaches only {self.omega_0:.3g} "
                "rad/s at full duty without load: command a lower speed or yaw rate, or set motor.gear."
            )

    @classmethod
    def at(
        cls,
        rover: Rover,
        motor: Motor,
        rates: Annotated[tuple[float, ...], spec("rad/s", "of the wheels, front to rear, left before right")],
        servo: Servo = Servo(),
        limit: TorqueLimit | NoLimit = NoLimit(),
    ) -> Self:
        """Return the control that holds given rates of the wheels (wheels,) [rad/s], with all wheels straight ahead.

        Raises ParameterError: a rate is above the rate of the motor at full duty without load.
        """
        return cls(rates, (0.0,) * sum(steers(rover)), float(motor.no_load_rate), servo, limit)

    @classmethod
    @check_arguments("control")
    def of(
        cls,
        rover: Rover,
        motor: Motor,
        speed: Annotated[float, spec("m/s", "forwards", -MAX_COMMAND, MAX_COMMAND)] = 0.0,
        yaw_rate: Annotated[float, spec("rad/s", "to the left", -MAX_COMMAND, MAX_COMMAND)] = 0.0,
        crab: Annotated[float, spec("rad", "angle of travel to the left of the heading", -MAX_STEER, MAX_STEER)] = 0.0,
        track: Annotated[
            float,
            spec(
                "m", "0 means `effective_track`; without lateral slip, it is the distance between the sides", 0.0, 1e3
            ),
        ] = 0.0,
        servo: Servo = Servo(),
        limit: TorqueLimit | NoLimit = NoLimit(),
    ) -> Self:
        """Return the control that holds a speed [m/s] and a yaw rate [rad/s] of the body.

        With `crab` [rad], the rover travels at this angle to the left of its heading. Wheels that steer follow
        Ackermann geometry. If no wheel steers, the wheels of the left and right side have the rim speeds speed -
        yaw_rate track / 2 and speed + yaw_rate track / 2. These wheels are dragged sideways, so that the rover turns
        more slowly than its rim speeds suggest. An effective `track` [m] that is wider than the distance between the
        sides compensates for this.

        Raises ParameterError: a wheel would have to turn faster than its motor can without load, a wheel would have to
        steer by more than 75 deg, or `crab` is given although no wheel steers.
        """
        # Without steering, all wheels point ahead, and the rover cannot travel at an angle to its heading.
        steering = steers(rover)
        if crab and not any(steering):
            raise ParameterError(
                f"{rover.name} cannot crab (drive at an angle to its heading), because none of its wheels steers. "
                "Leave control.crab out."
            )
        # The effective track matters only for a rover that turns by the speed difference of its sides.
        places = turning_places(rover, 0.0 if any(steering) else track or effective_track(rover))
        # The velocity of the body, in its own axes, points at the angle `crab` to the left of the heading.
        motion = BodyMotion(speed * math.cos(crab), yaw_rate, speed * math.sin(crab))
        speeds, angles = rolling(places.tolist(), steering, motion)
        if max(map(abs, angles), default=0.0) > MAX_STEER:
            raise ParameterError(
                f"speed = {speed:g} m/s with yaw_rate = {yaw_rate:g} rad/s would need a wheel that steers by "
                f"{math.degrees(max(map(abs, angles))):.0f} deg; the limit is {math.degrees(MAX_STEER):.0f} deg. "
                "Command a lower yaw rate or a higher speed."
            )
        # The servos hold wheel rates, so rim speeds are divided by the radius of each wheel.
        rates = tuple((np.array(speeds) / rover.radii).tolist())
        wide = 0.0 if any(steering) else float(np.ptp(places[:, 1]))
        return cls(rates, tuple(angles), float(motor.no_load_rate), servo, limit, motion, wide)

    @classmethod
    def turning(cls, rover: Rover, motor: Motor, radius: float, delta: float, track: float = 0.0) -> Self:
        """Return the control that turns a rover without steering about a centre at the distance `radius` [m] to its
        left.

        The left and the right side have different speeds. The faster side has the fraction `delta` of its speed at full
        duty without load. `track` is the effective distance between the sides [m]; 0 means `effective_track`.
        """
        # A side at the lateral position y has the speed yaw_rate (radius - y). The larger of the two is `fastest`.
        track = track or effective_track(rover)
        places = turning_places(rover, track)
        fastest = delta * float(motor.no_load_rate) * float(np.min(rover.radii))
        yaw_rate = math.copysign(1.0, radius) * fastest / float(np.max(np.abs(radius - places[:, 1])))
        return cls.of(rover, motor, radius * yaw_rate, yaw_rate, track=track)

    @property
    def law(self) -> ca.Function:
        """The law of the control as a CasADi function, with the inputs and outputs of `LawControl.law`."""
        return _held_speeds_law(len(self.rates), len(self.angles))

    @property
    def numbers(self) -> np.ndarray:
        """The constants of the law: gains of the servo, wheel rate at full duty without load [rad/s], sampling time
        [s], desired wheel rates [rad/s], steering angles [rad].
        """
        return np.array([*self.servo.values().values(), self.omega_0, self.period, *self.rates, *self.angles])

    @property
    def fresh(self) -> np.ndarray:
        """The memory of the law at the start of a drive: the integrals of the servos, all zero."""
        return np.zeros(len(self.rates))

    def yaw_rate(self, trace: Trace) -> float:
        """Return the mean yaw rate [rad/s] in the second half of a drive; NaN if no yaw rate was commanded."""
        if self.motion is None or not self.motion.yaw_rate or len(trace.t) < 4:
            return math.nan
        late = _second_half(trace)
        # The slope of a straight line through the yaw angles, from which full turns have been removed.
        return float(np.polyfit(trace.t[late], np.unwrap(trace["body_yaw"][late]), 1)[0])

    def turn_shortfall(self, trace: Trace) -> str:
        """Return a text that compares the driven yaw rate of a drive with the commanded one, and that names the cause
        of the difference or a remedy.

        The text is empty if no yaw rate was commanded.
        """
        # Without a commanded turn there is nothing to compare.
        driven = self.yaw_rate(trace)
        if math.isnan(driven) or self.motion is None:
            return ""
        # A motor at its largest duty cannot turn its wheel faster; a wider track would not help then.
        duties = np.abs(trace.stack("duty")[_second_half(trace)])
        full = float(np.mean(np.any(duties >= float(self.servo.delta_max), axis=1)))
        why = f", some motor at its largest duty {full:.0%} of the time" if full else ""
        # The driven yaw rate shows the track that would have given the commanded rate.
        wider = 0.0 if full or not driven else self.track * float(self.motion.yaw_rate) / driven
        remedy = (
            f"; control.track = {wider:.2g}m, not {self.track:.2g}, would compensate for the scrub"
            if wider > 0.0
            else ""
        )
        commanded = math.degrees(self.motion.yaw_rate)
        return f"at {math.degrees(driven):.2g} deg/s instead of the commanded {commanded:.2g} deg/s{why}{remedy}"

    def shortfall(self, trace: Trace) -> str:
        """Return a warning if the yaw rate in a drive is below half the commanded yaw rate, and an empty text
        otherwise.
        """
        # The ratio of the two yaw rates is negative if the rover turns to the wrong side.
        driven = self.yaw_rate(trace)
        if math.isnan(driven) or self.motion is None or driven / self.motion.yaw_rate >= MIN_TURN_RATIO:
            return ""
        return f"the rover does not follow: it turns {self.turn_shortfall(trace)}."


def _second_half(trace: Trace) -> np.ndarray:
    """Return for each row of a trace whether the row belongs to the second half of the drive."""
    return np.asarray(trace.t >= 0.5 * (trace.t[0] + trace.t[-1]))


def cruise_speed(rover: Rover, motor: Motor) -> float:
    """Return the rim speed [m/s] that a rover's smallest wheel has without load at the cruise duty of the paper,
    0.55.
    """
    return CRUISE_DUTY * float(motor.no_load_rate) * float(np.min(rover.radii))
