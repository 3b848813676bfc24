"""Find the steady windows of a logged run, and compute for each wheel the mean slip and the mean torque divided by
load, with their SDs.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rover_pin.rover.driven_loads import configuration, determinate_groups, driven_loads, footing, turning
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_mounts
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.slip import slip_ratio

MIN_ROWS = 8
"""Minimum number of rows of the log in a window. With eight rows, the SD of the window is known to within a quarter of
its value."""


@dataclass(frozen=True)
class SteadyConditions:
    """Conditions of a steady window (all assumed).

    The first `settle` seconds of a run are omitted, and so are windows with a rim speed below `slowest` [m/s]. Within a
    window, the duty changes by at most `duty`, the rim speed by at most the fraction `rim`, and the slip by at most
    `slip` or three SDs of its noise. Wheels whose loads statics determines only together must have slips within
    `slip_spread`.
    """

    settle: float = 2.0
    slowest: float = 0.005
    duty: float = 0.02
    rim: float = 0.1
    slip: float = 0.1
    slip_spread: float = 0.05


class Window(NamedTuple):
    """Means over one steady window, for one wheel, or for several wheels if statics determines only their total load.

    The SDs are SDs of the means.
    """

    wheel: int
    """index of the wheel, or of the first wheel if the window belongs to several wheels"""
    start: float
    "beginning of the window [s]"
    slip: float
    slip_sd: float
    factor: float
    """torque factor [-]: torque T of the wheel divided by radius r and load W"""
    factor_sd: float
    factor_per_rate: float
    """decrease of the torque factor per relative error of the measured wheel rate; 0 if the torque follows from a
    measured current"""
    rim: float
    "rim speed [m/s]"
    load: float
    "load W of one wheel [N]"


class Mean(NamedTuple):
    """A straight line through a channel within a window: its value in the middle, its slope per second, and the SDs of
    both.
    """

    middle: float
    sd: float
    slope: float
    slope_sd: float


def steady_windows(trace: Trace, rover: Rover, motor: Motor, length: float, steady: SteadyConditions) -> list[Window]:
    """Return the steady windows of a run, for each wheel, or for each axle if statics determines only its total load.

    The torque T is K i with the measured current i, or K (delta V - K omega) / R from duty and wheel rate if no current
    is logged (K: gear times k_t, delta: duty, V: supply, omega: wheel rate, R: resistance). The load W balances
    attitude, link angles and torques (`driven_loads`). The slip S follows by Eq (1) of the paper from the rim speed and
    the wheel centre's speed along the terrain. Both speeds follow by least squares from the tracked position, the
    attitude and the link angles.

    Parameters
    ----------
    trace : Trace
        The run, with position, attitude, link angles, duties and wheel rates.
    rover : Rover
        The rover at the log's gravity.
    motor : Motor
        Converts current, or duty and rate, to torque.
    length : float
        Length of a window [s].
    steady : SteadyConditions
        Conditions for a window.

    Raises
    ------
    DataError
        A channel that is needed was not recorded.
    """
    # The channels are prepared once for all windows of the run.
    run = _Run(trace, rover, motor)
    t, windows = trace.t, []
    # Windows are numbered from the end of the settling time; earlier rows have negative numbers.
    number = np.floor((t - t[0] - steady.settle) / length) if len(t) else t
    for window_number in np.unique(number[number >= 0.0]):
        rows = np.flatnonzero(number == window_number)
        # A window with too few rows, or with a gap at an end, has no reliable mean.
        if len(rows) < MIN_ROWS or t[rows[-1]] - t[rows[0]] <= 0.8 * length:
            continue
        if run.complete[rows].all() and np.all(np.ptp(run.duty[rows], axis=0) <= steady.duty):
            windows += run.windows(rows, steady)
    return windows


class _Run:
    """The channels of a logged run as arrays (rows, wheels), prepared for means over windows."""

    def __init__(self, trace: Trace, rover: Rover, motor: Motor):
        names = [mount.name for mount in rover.wheels]
        self.rover, self.motor, self.t = rover, motor, trace.t
        x, y, self.roll, self.pitch, self.yaw = trace.need("body_x", "body_y", "body_roll", "body_pitch", "body_yaw")
        self.tracked_z = "body_z" in trace
        self.place = np.column_stack([x, y, trace["body_z"] if self.tracked_z else np.zeros(len(x))])
        self.duty = np.column_stack(trace.need(*(f"duty_{name}" for name in names)))
        self.rate = np.column_stack(trace.need(*(f"wheel_rate_{name}" for name in names)))
        steered = {name for name in rover.angles if name.startswith("steer_")}
        links = trace.need(*(name for name in rover.angles if name not in steered))
        self.angles = dict(zip((name for name in rover.angles if name not in steered), links, strict=True))
        self.angles |= {name: trace[name] for name in steered if name in trace}
        currents = [f"current_{name}_A" for name in names]
        # The torque of a wheel follows from its current where that is recorded, else from its duty and rate.
        self.by_current = [name in trace for name in currents]
        self.current = np.column_stack([trace.get(name, np.zeros(len(self.t))) for name in currents])
        rows = (self.place, self.duty, self.rate, self.current, self.roll, self.pitch, self.yaw, *self.angles.values())
        self.complete = np.all([np.isfinite(channel).reshape(len(self.t), -1).all(axis=1) for channel in rows], axis=0)

    def windows(self, rows: np.ndarray, steady: SteadyConditions) -> list[Window]:
        """Return the steady windows of the wheels for one window of time, given by the indices `rows` of the log.
        Wheels that were not steady are omitted.
        """
        t, motor = self.t[rows], self.motor
        # Contact directions and static loads are evaluated at the mean pose of the window.
        attitude = (float(np.mean(self.roll[rows])), float(np.mean(self.pitch[rows])), float(np.mean(self.yaw[rows])))
        q = configuration(self.rover, attitude, {name: float(np.mean(v[rows])) for name, v in self.angles.items()})
        foot, jacobians = footing(self.rover, q)
        ahead, axles = foot.forward, foot.left
        if not self.tracked_z:
            # Without a height, only the motion over the map is known: a wheel centre that moves by v along the terrain
            # in the direction t moves by v |t_xy| over the map.
            ahead = ahead * [1.0, 1.0, 0.0] / np.sum(ahead[:, :2] ** 2, axis=1)[:, None]
        # Moving links turn the wheels about their axles and shift their centres, which adds to rim and travel speed.
        # Rotation and centre of each wheel relative to the body's position, at the row of each window.
        mounts = []
        for row in rows:
            attitude = (float(self.roll[row]), float(self.pitch[row]), float(self.yaw[row]))
            angles = {name: float(values[row]) for name, values in self.angles.items()}
            mounts.append(wheel_mounts(self.rover, configuration(self.rover, attitude, angles)))
        turned = turning([rotations for rotations, _ in mounts], axles)
        centres = self.place[rows][:, None] + np.array([places for _, places in mounts])
        rates = [line(t, self.rate[rows, i]) for i in range(len(self.rover.wheels))]
        torques = []
        for i, is_measured in enumerate(self.by_current):
            # The torque follows from the current if it was measured, else from duty and rate.
            drive = motor.drive(self.duty[rows, i], self.rate[rows, i])
            torques.append(line(t, drive.constant * (self.current[rows, i] if is_measured else drive.current)))
        loads = driven_loads(self.rover, q, np.array([torque.middle for torque in torques]), foot, jacobians)
        stiff = float(motor.constant) ** 2 / float(motor.resistance)
        windows: dict[int, Window] = {}
        for i, mount in enumerate(self.rover.wheels):
            r, rate, torque = float(mount.wheel.r), rates[i], torques[i]
            distance = centres[:, i] @ ahead[i]
            path, swing = line(t, distance), line(t, turned[:, i])
            rim, span = r * (rate.middle + swing.slope), t[-1] - t[0]
            # Wheels that stand, carry no load or change their rate are not steady.
            if rim < steady.slowest or loads[i] <= 0.0 or abs(rate.slope) * span > steady.rim * rate.middle:
                continue
            slip, slip_sd = _slip(rim, r * math.hypot(rate.sd, swing.slope_sd), path.slope, path.slope_sd)
            # The slip is steady if the travel speeds of the two halves of the window agree.
            half = len(t) // 2
            first, second = (line(t[part], distance[part]).slope for part in (slice(None, half), slice(half, None)))
            if abs(second - first) / rim > max(steady.slip, 12.0 * slip_sd):
                continue
            share = 1.0 / (r * float(loads[i]))
            factor = (
                share * torque.middle,
                share * torque.sd,
                0.0 if self.by_current[i] else share * stiff * rate.middle,
            )
            windows[i] = Window(i, float(t[0]), slip, slip_sd, *factor, rim, float(loads[i]))
        together = determinate_groups(self.rover, foot, jacobians)
        groups = [[windows[i] for i in group] for group in together if all(i in windows for i in group)]
        return [pool(group) for group in groups if np.ptp([window.slip for window in group]) <= steady.slip_spread]


def pool(group: Sequence[Window]) -> Window:
    """Average the windows of several wheels of equal size, if statics determines only the sum of their loads, and
    return one window.

    The torque of wheel i is T_i = F(S_i) r W_i, with slip S_i, load W_i, radius r and factor F. The loads W_i are
    therefore the weights of the means of S and of F = T / (r W). For the mean of F, the sum of the loads is sufficient.
    For the mean of S, these weights are correct to first order in the differences of slips and loads.
    """
    if len(group) == 1:
        return group[0]
    loads = np.array([window.load for window in group])
    share = loads / loads.sum()
    # The fields from slip to rim speed are averaged; their SDs add in quadrature.
    table = np.array([window[2:-1] for window in group])
    means, sds = share @ table, np.sqrt(share**2 @ table**2)
    slip, _, factor, _, per_rate, rim = (float(value) for value in means)
    return Window(
        group[0].wheel, group[0].start, slip, float(sds[1]), factor, float(sds[3]), per_rate, rim, float(loads.mean())
    )


def line(t: np.ndarray, values: np.ndarray) -> Mean:
    """Fit a straight line to a channel (rows,) by least squares over the times `t` [s], and return its middle, slope
    and SDs.

    The SDs follow from the scatter of the rows about the line, multiplied by sqrt((1 + a) / (1 - a)) for a positive
    autocorrelation a of neighbouring rows, because correlated rows hold less information.
    """
    # With times about their mean, the middle value and the slope of the line are independent.
    centred_t = t - np.mean(t)
    middle, spread = float(np.mean(values)), float(centred_t @ centred_t)
    slope = float(centred_t @ values) / spread
    residual = values - middle - slope * centred_t
    power = float(residual @ residual)
    autocorrelation = float(np.clip(residual[1:] @ residual[:-1] / power, 0.0, 0.95)) if power > 0.0 else 0.0
    sd = math.sqrt(power / max(len(t) - 2, 1) * (1.0 + autocorrelation) / (1.0 - autocorrelation))
    return Mean(middle, sd / math.sqrt(len(t)), slope, sd / math.sqrt(spread))


def _slip(rim: float, rim_sd: float, v: float, v_sd: float) -> tuple[float, float]:
    """Return the slip ratio of a mean rim speed and a mean travel speed `v` [m/s], and the SD of the slip to first
    order.

    `rim_sd` and `v_sd` are the SDs of both speeds.
    """
    greatest = max(abs(rim), abs(v))
    smaller = min(rim, v) / greatest
    return float(slip_ratio(rim, v)), math.hypot(v_sd, rim_sd) * max(abs(smaller), 1.0 if v < rim else 0.0) / greatest
