"""Speeds that are held: a PI servo on the rate of each wheel, and motions of the body by the rover's own kinematics."""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Self

import casadi as ca
import numpy as np

from rover_pin.base.arguments import check_arguments, spec
from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Record, quantities, quantity
from rover_pin.contact import Scalar
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.control.motion.law_control import LawControl
from rover_pin.control.steering import MOST_STEER
from rover_pin.control.torque_check import NoLimit, TorqueLimit
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import effective_track
from rover_pin.simulation.model.cruise import CRUISE_DUTY
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.timing import CONTROL_PERIOD
from rover_pin.simulation.trace.trace import Trace

LEAST_TURN = 0.5
"""Share of a commanded yaw rate below which a drive says that the rover does not follow."""
FASTEST = 1e3
"""Bound of commands [m/s, rad/s]; what the motors reach is less."""


@dataclass(frozen=True)
class Servo(Record):
    """delta = omega_d / omega_0 + k_p e + k_i int e dt, e = (omega_d - omega) / omega_0, within +-delta_max.

    The first term is the duty at which back-EMF alone lets the wheel turn at omega_d; the integral takes the load. A
    motor without lag meets (1 - k_p) +- sqrt((1 - k_p)^2 - 4 (k_i T - k_p)) over 2 at samples T apart: 0.4 +- 0.2i.
    """

    k_p: Scalar = quantity(0.2, "", "assumed: a sample of delay leaves the loop stable below 1", 0.0, 100.0, "k_p")
    k_i: Scalar = quantity(8.0, "1/s", "assumed: settles in five samples", 0.0, 1000.0, "k_i")
    delta_max: Scalar = quantity(1.0, "", "the supply's", 0.0, 1.0, "delta_max")

    def step(
        self, share: Scalar, rate_share: Scalar, integral: Scalar, lowest: Scalar, highest: Scalar, period: Scalar
    ) -> tuple[Scalar, Scalar]:
        """Return the duty, and the next integral, of a wheel that shall turn at `share` of omega_0.

        `lowest` and `highest` are what the torque limit allows. The integral goes no further than the duty has room
        (conditional integration), and comes back from there as soon as e turns.
        """
        error = share - rate_share
        least, most = ca.fmax(-self.delta_max, lowest), ca.fmin(self.delta_max, highest)
        proportional = share + self.k_p * error
        duty = ca.fmin(ca.fmax(proportional + integral, least), most)
        low, high = ca.fmin(integral, least - proportional), ca.fmax(integral, most - proportional)
        return duty, ca.fmin(ca.fmax(integral + period * self.k_i * error, low), high)


def servo_duties(
    servo: Servo, rates: ca.SX, rates_now: ca.SX, integrals: ca.SX, limits: ca.SX, omega_0: Scalar, period: Scalar
) -> tuple[ca.SX, ca.SX]:
    """Return the duties and the next integrals of all wheels, columns: `limits` are lowest, then highest duties."""
    n = rates.numel()
    steps = [
        servo.step(rates[at] / omega_0, rates_now[at] / omega_0, integrals[at], limits[at], limits[n + at], period)
        for at in range(n)
    ]
    return ca.vertcat(*(duty for duty, _ in steps)), ca.vertcat(*(after for _, after in steps))


def servo_symbols() -> tuple[Servo, ca.SX]:
    """Return a servo of symbols, and these, before omega_0 and the period."""
    symbols = ca.SX.sym("servo", len(quantities(Servo)))
    return Servo(**dict(zip(quantities(Servo), ca.vertsplit(symbols), strict=True))), symbols


@lru_cache(maxsize=16)
def _law(wheels: int, steered: int) -> ca.Function:
    """Return the law: its numbers are the servo's, omega_0, the period, rates and angles; it remembers integrals."""
    servo, symbols = servo_symbols()
    omega_0, period, rates = ca.SX.sym("omega_0"), ca.SX.sym("period"), ca.SX.sym("rates", wheels)
    angles, read, limits = ca.SX.sym("angles", steered), ca.SX.sym("read", 3 + wheels), ca.SX.sym("limits", 2 * wheels)
    integrals = ca.SX.sym("integrals", wheels)
    duties, after = servo_duties(servo, rates, read[3:], integrals, limits, omega_0, period)
    inputs = [ca.SX.sym("t"), read, limits, integrals, ca.vertcat(symbols, omega_0, period, rates, angles)]
    return ca.Function("held_speeds", inputs, [duties, angles, after])


@dataclass
class HeldSpeeds(LawControl):
    """Each wheel held at a rate by its servo, and steered to an angle; keeps one integral a wheel.

    Parameters
    ----------
    rates : tuple
        Of the wheels [rad/s].
    angles : tuple
        Of the wheels that steer [rad].
    omega_0 : float
        The motors' rate at full duty without load [rad/s].
    servo : Servo
        Gains and the greatest duty.
    limit : TorqueLimit or NoLimit
        What else limits the duties.
    motion : BodyMotion, optional
        What the rates are for: a drive that does not follow says so.
    track : float
        Between the sides as the rates were made, effective [m]; 0 where wheels steer.

    Source: a PI servo with conditional integration, as in textbooks; kinematics as in `rolling`.

    Examples
    --------
    >>> from rover_pin import scenario, simulate
    >>> model = scenario("flat", rover="cart").model
    >>> trace = simulate(model, HeldSpeeds.of(model.rover, model.motor, 0.05), 3.0)
    >>> round(float(trace["wheel_rate_front_l"][-1]) * 0.11, 3)
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
                f"a wheel would have to turn at {fastest:.3g} rad/s, and its motor reaches {self.omega_0:.3g} rad/s at "
                "full duty without load: command a lower speed or yaw rate, or set motor.gear."
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
        """Return what holds the wheels at these rates [rad/s], steered straight ahead."""
        return cls(rates, (0.0,) * sum(steers(rover)), float(motor.no_load_rate), servo, limit)

    @classmethod
    @check_arguments("control")
    def of(
        cls,
        rover: Rover,
        motor: Motor,
        speed: Annotated[float, spec("m/s", "forwards", -FASTEST, FASTEST)] = 0.0,
        yaw_rate: Annotated[float, spec("rad/s", "to the left", -FASTEST, FASTEST)] = 0.0,
        crab: Annotated[float, spec("rad", "of the way to the left of the heading", -MOST_STEER, MOST_STEER)] = 0.0,
        track: Annotated[float, spec("m", "0: `effective_track`; of no slip that of the wheels", 0.0, 1e3)] = 0.0,
        servo: Servo = Servo(),
        limit: TorqueLimit | NoLimit = NoLimit(),
    ) -> Self:
        """Return what holds a body speed and yaw rate: Ackermann's geometry, or the sides' speeds where none steers.

        Without steering v = speed -+ yaw_rate track / 2, left and right. Wheels are dragged sideways, so that the rover
        turns by less than they roll: an effective track, wider than that between the wheels, makes up for it.

        Raises ParameterError: more than the motors' speed without load, a wheel that steers beyond 75 deg, or a crab
        where none steers.
        """
        steering = steers(rover)
        if crab and not any(steering):
            raise ParameterError(f"{rover.name} cannot crab: none of its wheels steers; leave control.crab out.")
        places = turning_places(rover, 0.0 if any(steering) else track or effective_track(rover))
        motion = BodyMotion(speed * math.cos(crab), yaw_rate, speed * math.sin(crab))
        speeds, angles = rolling(places.tolist(), steering, motion)
        if max(map(abs, angles), default=0.0) > MOST_STEER:
            raise ParameterError(
                f"speed = {speed:g} m/s with yaw_rate = {yaw_rate:g} rad/s wants a wheel to steer by "
                f"{math.degrees(max(map(abs, angles))):.0f} deg; at most {math.degrees(MOST_STEER):.0f} are allowed."
            )
        rates = tuple((np.array(speeds) / rover.radii).tolist())
        wide = 0.0 if any(steering) else float(np.ptp(places[:, 1]))
        return cls(rates, tuple(angles), float(motor.no_load_rate), servo, limit, motion, wide)

    @classmethod
    def turning(cls, rover: Rover, motor: Motor, radius: float, delta: float, track: float = 0.0) -> Self:
        """Return a turn by the sides' speeds, the fastest side at the share `delta` of its speed without load."""
        track = track or effective_track(rover)
        places = turning_places(rover, track)
        fastest = delta * float(motor.no_load_rate) * float(np.min(rover.radii))
        yaw_rate = math.copysign(1.0, radius) * fastest / float(np.max(np.abs(radius - places[:, 1])))
        return cls.of(rover, motor, radius * yaw_rate, yaw_rate, track=track)

    @property
    def law(self) -> ca.Function:
        """Its law as one function."""
        return _law(len(self.rates), len(self.angles))

    @property
    def numbers(self) -> np.ndarray:
        """Servo, omega_0, period, rates, angles."""
        return np.array([*self.servo.values().values(), self.omega_0, self.period, *self.rates, *self.angles])

    @property
    def fresh(self) -> np.ndarray:
        """No integrals."""
        return np.zeros(len(self.rates))

    def yaw_rate(self, trace: Trace) -> float:
        """Return the yaw rate of a drive over its later half [rad/s], NaN where none is commanded."""
        if self.motion is None or not self.motion.yaw_rate or len(trace.t) < 4:
            return math.nan
        late = _late(trace)
        return float(np.polyfit(trace.t[late], np.unwrap(trace["body_yaw"][late]), 1)[0])

    def turn_shortfall(self, trace: Trace) -> str:
        """Return how fast a drive turned of what is commanded, and what would make up for the rest; or nothing."""
        driven = self.yaw_rate(trace)
        if math.isnan(driven) or self.motion is None:
            return ""
        full = float(np.mean(np.any(np.abs(trace.stack("duty")[_late(trace)]) >= float(self.servo.delta_max), axis=1)))
        why = f", some motor at its greatest duty {full:.0%} of the time" if full else ""
        wider = 0.0 if full or not driven else self.track * float(self.motion.yaw_rate) / driven
        remedy = f"; control.track = {wider:.2g}m, not {self.track:.2g}, would make up for scrub" if wider > 0.0 else ""
        commanded = math.degrees(self.motion.yaw_rate)
        return f"at {math.degrees(driven):.2g} deg/s where {commanded:.2g} deg/s are commanded{why}{remedy}"

    def shortfall(self, trace: Trace) -> str:
        """Return what to say of a drive whose yaw rate is less than half of what is commanded."""
        driven = self.yaw_rate(trace)
        if math.isnan(driven) or self.motion is None or driven / self.motion.yaw_rate >= LEAST_TURN:
            return ""
        return f"the rover does not follow: it turns {self.turn_shortfall(trace)}."


def _late(trace: Trace) -> np.ndarray:
    return np.asarray(trace.t >= 0.5 * (trace.t[0] + trace.t[-1]))


def cruise_speed(rover: Rover, motor: Motor) -> float:
    """Return the speed [m/s] of the rims at duty 0.55 without load."""
    return CRUISE_DUTY * float(motor.no_load_rate) * float(np.min(rover.radii))
