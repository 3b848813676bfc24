"""A route of way-points, driven by pure pursuit: the curvature to a point ahead, held by the wheels' servos."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Self

import casadi as ca
import numpy as np

from rover_pin.base.arguments import check_arguments, spec
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.columns import read_columns
from rover_pin.contact import Scalar
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.control.motion.law_control import LawControl
from rover_pin.control.motion.servo import FASTEST, Servo, servo_duties, servo_symbols
from rover_pin.control.steering import MOST_STEER
from rover_pin.control.torque_check import NoLimit, TorqueLimit
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import effective_track
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.timing import CONTROL_PERIOD
from rover_pin.simulation.trace.trace import Trace

FAR = 1e12
"""Squared distance [m^2] of a piece of the route that is not looked at."""
MOST_POINTS = 500
"""Way-points of a route: its law has a formula for each."""
NUMBERS = ("omega_0", "period", "speed", "lookahead", "reach", "bend")


def _nearest(points: ca.SX, starts: ca.SX, x: Scalar, y: Scalar, done: Scalar, ahead: Scalar) -> Scalar:
    """Return how far along the route [m] its point nearest to x, y is, between `done` and `ahead` beyond it."""
    best, way = ca.SX(FAR), done
    for i in range(points.size1() - 1):
        length = starts[i + 1] - starts[i]
        dx, dy = (points[i + 1, 0] - points[i, 0]) / length, (points[i + 1, 1] - points[i, 1]) / length
        along = (x - points[i, 0]) * dx + (y - points[i, 1]) * dy
        low, high = ca.fmax(done - starts[i], 0.0), ca.fmin(done + ahead - starts[i], length)
        along = ca.fmin(ca.fmax(along, low), high)
        off = (points[i, 0] + along * dx - x) ** 2 + (points[i, 1] + along * dy - y) ** 2
        off = ca.if_else(low > high, FAR, off)
        best, way = ca.fmin(off, best), ca.if_else(off < best, starts[i] + along, way)
    return way


def _point_at(points: ca.SX, starts: ca.SX, way: Scalar) -> tuple[Scalar, Scalar]:
    """Return the route's point so far along it; beyond its end its last piece goes on."""
    place = (points[0, 0], points[0, 1])
    for i in range(points.size1() - 1):
        share = (way - starts[i]) / (starts[i + 1] - starts[i])
        point = (points[i, c] + share * (points[i + 1, c] - points[i, c]) for c in (0, 1))
        place = tuple(ca.if_else(share >= 0.0, new, old) for new, old in zip(point, place, strict=True))
    return place


@lru_cache(maxsize=16)
def _law(steering: tuple[bool, ...], count: int) -> ca.Function:
    """Return the law of a rover whose wheels steer or not, along `count` points, with way, arrival, integrals."""
    n = len(steering)
    place, read, limits = ca.SX.sym("place", 3), ca.SX.sym("read", 3 + n), ca.SX.sym("limits", 2 * n)
    memory, (servo, symbols) = ca.SX.sym("memory", 2 + n), servo_symbols()
    chosen, wheels, radii = ca.SX.sym("chosen", len(NUMBERS)), ca.SX.sym("wheels", 2, n), ca.SX.sym("radii", n)
    points, starts = ca.SX.sym("points", count, 2), ca.SX.sym("starts", count)
    omega_0, period, speed, lookahead, reach, bend = ca.vertsplit(chosen)
    way = _nearest(points, starts, place[1], place[2], memory[0], lookahead)
    remaining = starts[count - 1] - way
    motion = _pursuit(_point_at(points, starts, way + lookahead), place, read[2], bend)
    pace = ca.if_else(remaining > reach, speed * ca.fmin(remaining / lookahead, 1.0), 0.0)
    speeds, angles = rolling([ca.vertsplit(wheels[:, at]) for at in range(n)], steering, motion)
    rates = ca.vertcat(*speeds) / radii
    rates = rates * ca.fmin(pace, omega_0 * servo.delta_max / ca.mmax(ca.fabs(rates)))
    duties, integrals = servo_duties(servo, rates, read[3:], memory[2:], limits, omega_0, period)
    numbers = ca.vertcat(symbols, chosen, ca.vec(wheels), radii, ca.vec(points), starts)
    arrival = ca.if_else(remaining > reach, place[0], memory[1])
    out = [duties, ca.vertcat(*angles), ca.vertcat(way, arrival, integrals)]
    return ca.Function("route", [place, read, limits, memory, numbers], out)


def _pursuit(target: tuple[Scalar, Scalar], place: ca.SX, yaw: Scalar, bend: Scalar) -> BodyMotion:
    """Return the motion at unit speed on the arc through the target: kappa = 2 y / (x^2 + y^2) in the body's axes."""
    dx, dy = target[0] - place[1], target[1] - place[2]
    along, across = ca.cos(yaw) * dx + ca.sin(yaw) * dy, ca.cos(yaw) * dy - ca.sin(yaw) * dx
    kappa = 2.0 * across / (along**2 + across**2)
    sharpest = ca.if_else(across >= 0.0, bend, -bend)
    kappa = ca.if_else(along > 0.0, kappa, sharpest)
    return BodyMotion(1.0, ca.fmin(ca.fmax(kappa, -bend), bend))


@dataclass
class RouteControl(LawControl):
    """Drives a route: pure pursuit of the point `lookahead` further on, by the base's true x, y and its yaw.

    It slows down over the last `lookahead`; within `reach` of the end servos hold its wheels still. Curvature is held
    to what wheels can steer, or to the sides' track where none does. It does not know obstacles.

    Parameters
    ----------
    rover, motor : Rover, Motor
        What is driven.
    points : array
        Way-points x, y [m] (m, 2), the first where the route begins.
    speed, lookahead : float
        [m/s], [m]
    servo, limit, track
        As of `HeldSpeeds`.

    Raises
    ------
    ParameterError
        Fewer than two way-points that differ.

    Source: R. C. Coulter, Implementation of the pure pursuit path tracking algorithm, CMU-RI-TR-92-01 (1992).
    """

    rover: Rover
    motor: Motor
    points: np.ndarray
    speed: float
    lookahead: float
    servo: Servo = Servo()
    limit: TorqueLimit | NoLimit = NoLimit()
    track: float = 0.0
    period: float = CONTROL_PERIOD

    def __post_init__(self) -> None:
        steps = np.hypot(*np.diff(self.points, axis=0).T)
        self.points = self.points[np.concatenate([[True], steps > 0.0])]
        if not 2 <= len(self.points) <= MOST_POINTS:
            raise ParameterError(f"a route needs 2 to {MOST_POINTS} way-points that differ: it has {len(self.points)}.")
        self.memory = self.fresh

    @classmethod
    @check_arguments("control")
    def of(
        cls,
        rover: Rover,
        motor: Motor,
        points: np.ndarray,
        speed: Annotated[float, spec("m/s", "forwards", 1e-4, FASTEST)],
        lookahead: Annotated[float, spec("m", "assumed: twice from first to last axle", 1e-3, 1e3)],
        track: Annotated[float, spec("m", "0: `effective_track`, where no wheel steers", 0.0, 1e3)] = 0.0,
        servo: Servo = Servo(),
        limit: TorqueLimit | NoLimit = NoLimit(),
    ) -> Self:
        """Return the control, its numbers checked."""
        return cls(rover, motor, points, speed, lookahead, servo, limit, track)

    @property
    def starts(self) -> np.ndarray:
        """How far along the route each way-point is [m]."""
        return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.points, axis=0).T))])

    @property
    def reach(self) -> float:
        """How near to its end it stops [m]: a wheel's radius."""
        return float(self.rover.radii.max())

    @property
    def duration(self) -> float:
        """How long it takes at its speed [s], slowing down at the end, and as much again for slip and turns."""
        slowing = self.lookahead * math.log(max(self.lookahead / self.reach, 1.0))
        return 2.0 * (float(self.starts[-1]) + slowing) / self.speed

    @property
    def law(self) -> ca.Function:
        """Its law as one function."""
        return _law(steers(self.rover), len(self.points))

    @property
    def numbers(self) -> np.ndarray:
        """Servo, `NUMBERS`, places and radii of the wheels, way-points and how far along each is."""
        steering = steers(self.rover)
        places = turning_places(self.rover, 0.0 if any(steering) else self.track or effective_track(self.rover))
        tightest = np.max(np.abs(places[:, 1]) + np.abs(places[:, 0]) / math.tan(MOST_STEER))
        chosen = [float(self.motor.no_load_rate), self.period, self.speed, self.lookahead, self.reach, 1.0 / tightest]
        parts = [[*self.servo.values().values()], chosen, places.ravel(), self.rover.radii, self.points.T.ravel()]
        return np.concatenate([*parts, self.starts])

    @property
    def fresh(self) -> np.ndarray:
        """At the beginning, without integrals."""
        return np.zeros(2 + len(self.rover.wheels))

    @property
    def stands_since(self) -> float:
        """When it came to the end [s], where its wheels are held; infinite until then."""
        return float(self.memory[1]) if self.starts[-1] - self.memory[0] <= self.reach else math.inf

    def shortfall(self, trace: Trace) -> str:
        """Return what to say of a drive that did not come to the end of its route."""
        remaining = float(self.starts[-1] - self.memory[0])
        text = f"the route is not finished: {remaining:.2g} m of its {self.starts[-1]:.3g} m are left."
        return text if remaining > self.reach else ""


def read_route(text: str, start: tuple[float, float]) -> np.ndarray:
    """Return way-points (m, 2) [m] from the start on: `x,y x,y ...`, or a CSV or Parquet file with x_m and y_m.

    Raises DataError, ParameterError: a file without these columns, or words that are no pairs of numbers.
    """
    if "," in text:
        try:
            points = np.array([[float(number) for number in pair.split(",")] for pair in text.split()])
        except ValueError:
            points = np.zeros(0)
        if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
            raise ParameterError(
                f'control.route = {text!r} is not allowed: give a file, or pairs in metres, "1,0 2,0.5".'
            )
    else:
        table = read_columns(text)
        table.refuse_gaps("x_m", "y_m")
        points = np.column_stack(table.need("x_m", "y_m"))
    if not len(points):
        raise DataError(f"{text}: there are no way-points.")
    return np.vstack([start, points])
