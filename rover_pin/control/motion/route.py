"""Drive a route of waypoints by pure pursuit: the rover steers along an arc to a point that lies ahead on the route."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Self

import casadi as ca
import numpy as np

from rover_pin.base.arguments import check_arguments, spec
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.table import read_columns
from rover_pin.control.motion.kinematics import BodyMotion, rolling, steers, turning_places
from rover_pin.control.motion.servo import MAX_COMMAND, LawControl, Servo, servo_duties, servo_symbols
from rover_pin.control.open_loop import MAX_STEER
from rover_pin.control.torque_check import NoLimit, TorqueLimit
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import effective_track
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.stepping.timing import CONTROL_PERIOD
from rover_pin.simulation.trace.trace import Trace

EXCLUDED = 1e12
"""Squared distance [m^2] that replaces the distance to a segment of the route outside the search, so that this segment
is never the nearest one."""
MAX_POINTS = 500
"""Maximum number of waypoints of a route. A longer route is refused, because the compiled law has a formula for each
waypoint."""
NUMBERS = ("omega_0", "period", "speed", "lookahead", "reach", "bend")
"""Names of the constants of the route law, in their order: wheel rate at full duty without load [rad/s], sampling time
[s], speed [m/s], look-ahead distance [m], distance to the end of the route at which the rover stops [m], and largest
curvature of the rover's arc [1/m]."""


@lru_cache(maxsize=16)
def _route_law(steering: tuple[bool, ...], count: int) -> ca.Function:
    """Return the CasADi function that steers a rover along a route of `count` waypoints, with the inputs and outputs of
    `LawControl.law`.

    `steering` states for each wheel whether it can steer. The memory of the law contains the arc length that the rover
    has reached on the route [m], the time of arrival [s], and the integrals of the wheels' servos.
    """
    # The inputs of the law, see `LawControl`.
    n = len(steering)
    place, read, limits = ca.SX.sym("place", 3), ca.SX.sym("read", 3 + n), ca.SX.sym("limits", 2 * n)
    memory, (servo, symbols) = ca.SX.sym("memory", 2 + n), servo_symbols()
    chosen, wheels, radii = ca.SX.sym("chosen", len(NUMBERS)), ca.SX.sym("wheels", 2, n), ca.SX.sym("radii", n)
    points, starts = ca.SX.sym("points", count, 2), ca.SX.sym("starts", count)
    omega_0, period, speed, lookahead, reach, bend = ca.vertsplit(chosen)
    # The progress along the route is the arc length of the nearest point of the route, and never decreases. The search
    # ends `lookahead` beyond the progress so far: otherwise, the rover could continue on the wrong branch where a route
    # crosses itself. CasADi has no search, so the segments are compared one after another by formulas.
    best, arc_length = ca.SX(EXCLUDED), memory[0]
    for i in range(count - 1):
        # The nearest point of each segment, limited to the part of the segment that lies within the search.
        length = starts[i + 1] - starts[i]
        dx, dy = (points[i + 1, 0] - points[i, 0]) / length, (points[i + 1, 1] - points[i, 1]) / length
        along = (place[1] - points[i, 0]) * dx + (place[2] - points[i, 1]) * dy
        low, high = ca.fmax(memory[0] - starts[i], 0.0), ca.fmin(memory[0] + lookahead - starts[i], length)
        along = ca.fmin(ca.fmax(along, low), high)
        off = (points[i, 0] + along * dx - place[1]) ** 2 + (points[i, 1] + along * dy - place[2]) ** 2
        # A segment that lies entirely outside the search is never the nearest one.
        off = ca.if_else(low > high, EXCLUDED, off)
        best, arc_length = ca.fmin(off, best), ca.if_else(off < best, starts[i] + along, arc_length)
    remaining = starts[count - 1] - arc_length
    # The target lies `lookahead` further along the route; beyond the end, the last segment is extended.
    target = (points[0, 0], points[0, 1])
    for i in range(count - 1):
        share = (arc_length + lookahead - starts[i]) / (starts[i + 1] - starts[i])
        point = (points[i, c] + share * (points[i + 1, c] - points[i, c]) for c in (0, 1))
        target = tuple(ca.if_else(share >= 0.0, new, old) for new, old in zip(point, target, strict=True))
    # Pure pursuit: the body moves at unit speed along the arc from its position to the target. In the axes of the body
    # (x ahead, y to the left), the arc to a target at (x, y) has the curvature 2 y / (x^2 + y^2). The curvature is
    # limited to `bend`, and a target behind the rover is approached on the tightest arc.
    (dx, dy), yaw = (target[0] - place[1], target[1] - place[2]), read[2]
    along, across = ca.cos(yaw) * dx + ca.sin(yaw) * dy, ca.cos(yaw) * dy - ca.sin(yaw) * dx
    kappa = 2.0 * across / (along**2 + across**2)
    sharpest = ca.if_else(across >= 0.0, bend, -bend)
    kappa = ca.if_else(along > 0.0, kappa, sharpest)
    motion = BodyMotion(1.0, ca.fmin(ca.fmax(kappa, -bend), bend))
    # Over the last look-ahead distance the rover slows down; within `reach` of the end, the wheels are held.
    pace = ca.if_else(remaining > reach, speed * ca.fmin(remaining / lookahead, 1.0), 0.0)
    speeds, angles = rolling([ca.vertsplit(wheels[:, i]) for i in range(n)], steering, motion)
    # The motion has unit speed. It is scaled to the speed, or to the speed at which the fastest wheel has full duty.
    rates = ca.vertcat(*speeds) / radii
    rates = rates * ca.fmin(pace, omega_0 * servo.delta_max / ca.mmax(ca.fabs(rates)))
    # The servos hold the wheel rates, and the torque limit may lower their duties.
    duties, integrals = servo_duties(servo, rates, read[3:], memory[2:], limits, omega_0, period)
    numbers = ca.vertcat(symbols, chosen, ca.vec(wheels), radii, ca.vec(points), starts)
    # Until the arrival this is the present time; afterwards the memory keeps the time of arrival.
    arrival = ca.if_else(remaining > reach, place[0], memory[1])
    out = [duties, ca.vertcat(*angles), ca.vertcat(arc_length, arrival, integrals)]
    return ca.Function("route", [place, read, limits, memory, numbers], out)


@dataclass
class RouteControl(LawControl):
    """A control that drives a rover along a route of waypoints by pure pursuit.

    The rover steers along an arc to a target point, which is further along the route by the distance `lookahead`. The
    control uses the true position and yaw of the base. Over the last `lookahead` of the route the rover slows down, and
    within `reach` of the end the servos hold the wheels still. The curvature of the arc is limited by the largest
    steering angle, or, if no wheel steers, by a turn about one side of the rover. Obstacles are not considered.

    Parameters
    ----------
    rover, motor : Rover, Motor
        The rover that is driven, and its motors.
    points : array
        Waypoints x, y (points, 2) [m]; the first waypoint is the start of the route.
    speed, lookahead : float
        Speed [m/s], and look-ahead distance along the route [m].
    servo : Servo
        Gains of the servos that hold the wheel rates, and the largest duty.
    limit : TorqueLimit or NoLimit
        A torque limit that also limits the duties.
    track : float
        Effective distance between the two sides of the rover [m], used if no wheel steers; 0 means `effective_track`.
    period : float
        Time between two samples [s].

    Raises
    ------
    ParameterError
        Fewer than two waypoints differ, or there are more than `MAX_POINTS`.

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
        # A waypoint equal to its predecessor would give a segment of length 0, by which the law divides.
        steps = np.hypot(*np.diff(self.points, axis=0).T)
        self.points = self.points[np.concatenate([[True], steps > 0.0])]
        if not 2 <= len(self.points) <= MAX_POINTS:
            raise ParameterError(
                f"A route needs 2 to {MAX_POINTS} waypoints that differ from their predecessors, but this route has "
                f"{len(self.points)}. Give more waypoints, or fewer."
            )
        self.memory = self.fresh

    @classmethod
    @check_arguments("control")
    def of(
        cls,
        rover: Rover,
        motor: Motor,
        points: np.ndarray,
        speed: Annotated[float, spec("m/s", "forwards", 1e-4, MAX_COMMAND)],
        lookahead: Annotated[
            float, spec("m", "assumed: twice the distance from the first to the last axle", 1e-3, 1e3)
        ],
        track: Annotated[float, spec("m", "0 means `effective_track`; used if no wheel steers", 0.0, 1e3)] = 0.0,
        servo: Servo = Servo(),
        limit: TorqueLimit | NoLimit = NoLimit(),
    ) -> Self:
        """Return the control that drives a rover along a route, after checking that its numbers are within their
        bounds.

        Raises ParameterError: a number is out of its bounds, or the route has too few or too many waypoints.
        """
        return cls(rover, motor, points, speed, lookahead, servo, limit, track)

    @property
    def starts(self) -> np.ndarray:
        """Arc length of each waypoint along the route [m]."""
        return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.points, axis=0).T))])

    @property
    def reach(self) -> float:
        """Distance to the end of the route at which the rover stops [m]: the radius of its largest wheel."""
        return float(self.rover.radii.max())

    @property
    def duration(self) -> float:
        """Time allowed for the route [s]: twice the time that a rover would need without slip at the commanded
        speed.
        """
        # The speed decreases with the remaining distance, so that the last look-ahead distance takes a logarithmic
        # time.
        slowing = self.lookahead * math.log(max(self.lookahead / self.reach, 1.0))
        return 2.0 * (float(self.starts[-1]) + slowing) / self.speed

    @property
    def law(self) -> ca.Function:
        """The law of the control as a CasADi function, with the inputs and outputs of `LawControl.law`."""
        return _route_law(steers(self.rover), len(self.points))

    @property
    def numbers(self) -> np.ndarray:
        """The constants of the law: numbers of the servo, `NUMBERS`, wheel positions and radii, waypoints, and the
        waypoints' arc lengths.
        """
        steering = steers(self.rover)
        places = turning_places(self.rover, 0.0 if any(steering) else self.track or effective_track(self.rover))
        # The tightest turn for which the wheels steer by at most `MAX_STEER`, over all wheels.
        tightest = np.max(np.abs(places[:, 1]) + np.abs(places[:, 0]) / math.tan(MAX_STEER))
        chosen = [float(self.motor.no_load_rate), self.period, self.speed, self.lookahead, self.reach, 1.0 / tightest]
        parts = [[*self.servo.values().values()], chosen, places.ravel(), self.rover.radii, self.points.T.ravel()]
        return np.concatenate([*parts, self.starts])

    @property
    def fresh(self) -> np.ndarray:
        """The memory of the control law at the start of a drive, all zeros: arc length driven along the route, time of
        arrival (0: not yet arrived), and integrals of the wheel servos.
        """
        return np.zeros(2 + len(self.rover.wheels))

    @property
    def stands_since(self) -> float:
        """Time at which the rover arrived at the end of its route [s]; infinite before the arrival."""
        return float(self.memory[1]) if self.starts[-1] - self.memory[0] <= self.reach else math.inf

    def shortfall(self, trace: Trace) -> str:
        """Return a warning if the rover has not reached the end of its route in a drive, and an empty text
        otherwise.
        """
        remaining = float(self.starts[-1] - self.memory[0])
        text = f"the route is not finished: {remaining:.2g} m of {self.starts[-1]:.3g} m remain."
        return text if remaining > self.reach else ""


def read_route(text: str, start: tuple[float, float]) -> np.ndarray:
    """Return the waypoints (points, 2) [m] of a route that the user gives as a text. `start` becomes the first
    waypoint.

    The text is a list of pairs `x,y x,y ...` [m], or the path of a CSV or Parquet file with the columns x_m and y_m.

    Raises DataError: the file cannot be read, lacks one of these columns or has no waypoints. Raises ParameterError:
    the text has commas and is not a list of pairs of finite numbers.
    """
    # A text with a comma is a list of pairs, any other text is a path.
    if "," in text:
        try:
            points = np.array([[float(number) for number in pair.split(",")] for pair in text.split()])
        except ValueError:
            points = np.zeros(0)
        if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
            raise ParameterError(
                f"control.route = {text!r} is not allowed. Give a CSV or Parquet file with the columns x_m and y_m, or "
                'pairs x,y in metres such as "1,0 2,0.5".'
            )
    else:
        # A file has one waypoint in each row; empty cells would make a gap in the route.
        table = read_columns(text)
        table.refuse_gaps("x_m", "y_m")
        points = np.column_stack(table.need("x_m", "y_m"))
    if not len(points):
        raise DataError(f"{text}: the route has no waypoints. Give at least one row with x_m and y_m.")
    # The route begins at the rover, so that the first segment leads from the start to the first given waypoint.
    return np.vstack([start, points])
