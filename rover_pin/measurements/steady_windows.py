"""A logged run in steady windows: slip, and torque over load, of every wheel, each mean with its standard deviation."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rover_pin.rover.driven_loads import configuration, determinate_groups, driven_loads, footing, turning
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_mounts
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.slip import slip_ratio

LEAST_ROWS = 8
"""Rows that a window has at least. Why: its SD is then known within a quarter."""


@dataclass(frozen=True)
class Steady:
    """What counts as steady: not the first `settle` s, nor rims slower than `slowest` m/s.

    Over a window the duty moves by `duty` at most, the rim speed by the share `rim` and the slip by `slip`, or by
    three SDs of its noise. Slips of wheels whose loads are known only together differ by `slip_spread` at most.
    """

    settle: float = 2.0
    slowest: float = 0.005
    duty: float = 0.02
    rim: float = 0.1
    slip: float = 0.1
    slip_spread: float = 0.05


class Window(NamedTuple):
    """One wheel, or wheels whose loads are known only together, over one window; SDs are of means, from the rows."""

    wheel: int
    "the first of those whose loads are known only together"
    start: float
    "s"
    slip: float
    slip_sd: float
    factor: float
    "T / (r W)"
    factor_sd: float
    factor_per_rate: float
    "by how much the factor falls where the measured rate is too high by its own size; 0 where the current was measured"
    rim: float
    "m/s"
    load: float
    "a wheel's W [N]"


class Mean(NamedTuple):
    """A straight line through the rows of a window: middle, slope, and their SDs."""

    middle: float
    sd: float
    slope: float
    slope_sd: float


def steady_windows(trace: Trace, rover: Rover, motor: Motor, length: float, steady: Steady) -> list[Window]:
    """Return the steady windows of `length` [s] of a run, of each wheel, or axle where statics tell its load alone.

    T = K i of the measured current, or K (delta V - K omega) / R of duty and wheel rate where none is logged. W
    balances attitude, link angles and torques (`driven_loads`). S is Eq (1) of the rim and of the wheel centre's own
    speed along the ground, by least squares from tracked position, attitude and link angles.

    Raises DataError: a channel that is needed and was not recorded.
    """
    run = _Run(trace, rover, motor)
    windows = []
    for rows in _spans(trace.t, length, steady.settle):
        if run.complete[rows].all() and np.all(np.ptp(run.duty[rows], axis=0) <= steady.duty):
            windows += run.windows(rows, steady)
    return windows


def _spans(t: np.ndarray, length: float, settle: float) -> Iterator[np.ndarray]:
    number = np.floor((t - t[0] - settle) / length) if len(t) else t
    for window_number in np.unique(number[number >= 0.0]):
        rows = np.flatnonzero(number == window_number)
        if len(rows) >= LEAST_ROWS and t[rows[-1]] - t[rows[0]] > 0.8 * length:
            yield rows


class _Run:
    """The channels of a run as arrays, wheels in the rover's order."""

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
        self.by_current = all(name in trace for name in currents)
        self.current = np.column_stack(trace.need(*currents)) if self.by_current else np.zeros_like(self.rate)
        rows = (self.place, self.duty, self.rate, self.current, self.roll, self.pitch, self.yaw, *self.angles.values())
        self.complete = np.all([np.isfinite(channel).reshape(len(self.t), -1).all(axis=1) for channel in rows], axis=0)

    def windows(self, rows: np.ndarray, steady: Steady) -> list[Window]:
        """Return what the wheels did over these rows, without those that were not steady."""
        t, motor = self.t[rows], self.motor
        attitude = (float(np.mean(self.roll[rows])), float(np.mean(self.pitch[rows])), float(np.mean(self.yaw[rows])))
        q = configuration(self.rover, attitude, {name: float(np.mean(v[rows])) for name, v in self.angles.items()})
        foot, jacobians = footing(self.rover, q)
        ahead, axles = foot.forward, foot.left
        if not self.tracked_z:
            # A centre that moves by v along the ground moves by v |t_xy| over the map.
            ahead = ahead * [1.0, 1.0, 0.0] / np.sum(ahead[:, :2] ** 2, axis=1)[:, None]
        mounts = [self._mounts(row) for row in rows]
        turned = turning([rotations for rotations, _ in mounts], axles)
        centres = self.place[rows][:, None] + np.array([places for _, places in mounts])
        rates = [line(t, self.rate[rows, i]) for i in range(len(self.rover.wheels))]
        torques = [self._torque(t, rows, i) for i in range(len(self.rover.wheels))]
        loads = driven_loads(self.rover, q, np.array([torque.middle for torque in torques]), foot, jacobians)
        stiff = 0.0 if self.by_current else float(motor.constant) ** 2 / float(motor.resistance)
        windows: dict[int, Window] = {}
        for i, mount in enumerate(self.rover.wheels):
            r, rate, torque = float(mount.wheel.r), rates[i], torques[i]
            path = line(t, centres[:, i] @ ahead[i])
            swing = line(t, turned[:, i])
            rim, span = r * (rate.middle + swing.slope), t[-1] - t[0]
            if rim < steady.slowest or loads[i] <= 0.0 or abs(rate.slope) * span > steady.rim * rate.middle:
                continue
            slip, slip_sd = _slip(rim, r * math.hypot(rate.sd, swing.slope_sd), path.slope, path.slope_sd)
            if _change_of_slip(t, centres[:, i] @ ahead[i], rim) > max(steady.slip, 12.0 * slip_sd):
                continue
            share = 1.0 / (r * float(loads[i]))
            factor = (share * torque.middle, share * torque.sd, share * stiff * rate.middle)
            windows[i] = Window(i, float(t[0]), slip, slip_sd, *factor, rim, float(loads[i]))
        together = determinate_groups(self.rover, foot, jacobians)
        groups = [[windows[i] for i in group] for group in together if all(i in windows for i in group)]
        return [pool(group) for group in groups if np.ptp([window.slip for window in group]) <= steady.slip_spread]

    def _mounts(self, row: int) -> tuple[np.ndarray, np.ndarray]:
        attitude = (float(self.roll[row]), float(self.pitch[row]), float(self.yaw[row]))
        angles = {name: float(values[row]) for name, values in self.angles.items()}
        return wheel_mounts(self.rover, configuration(self.rover, attitude, angles))

    def _torque(self, t: np.ndarray, rows: np.ndarray, wheel: int) -> Mean:
        drive = self.motor.drive(self.duty[rows, wheel], self.rate[rows, wheel])
        return line(t, drive.constant * (self.current[rows, wheel] if self.by_current else drive.current))


def pool(group: Sequence[Window]) -> Window:
    """Return the window of wheels of one size whose loads are known only together.

    With T_i = F(S_i) r W_i the loads weigh the means of S and of F = T / (r W): of F by the sum of the loads alone, of
    S to first order in how slips and loads differ.
    """
    if len(group) == 1:
        return group[0]
    loads = np.array([window.load for window in group])
    share = loads / loads.sum()
    table = np.array([window[2:-1] for window in group])
    means, sds = share @ table, np.sqrt(share**2 @ table**2)
    slip, _, factor, _, per_rate, rim = (float(value) for value in means)
    return Window(
        group[0].wheel, group[0].start, slip, float(sds[1]), factor, float(sds[3]), per_rate, rim, float(loads.mean())
    )


def line(t: np.ndarray, values: np.ndarray) -> Mean:
    """Return the line through a channel by least squares.

    SDs are from the rows' scatter about it, times sqrt((1 + a) / (1 - a)) for neighbours that are alike by a > 0.
    """
    centred_t = t - np.mean(t)
    middle, spread = float(np.mean(values)), float(centred_t @ centred_t)
    slope = float(centred_t @ values) / spread
    residual = values - middle - slope * centred_t
    power = float(residual @ residual)
    autocorrelation = float(np.clip(residual[1:] @ residual[:-1] / power, 0.0, 0.95)) if power > 0.0 else 0.0
    sd = math.sqrt(power / max(len(t) - 2, 1) * (1.0 + autocorrelation) / (1.0 - autocorrelation))
    return Mean(middle, sd / math.sqrt(len(t)), slope, sd / math.sqrt(spread))


def _slip(rim: float, rim_sd: float, v: float, v_sd: float) -> tuple[float, float]:
    """Return the slip ratio of mean speeds and its SD to first order."""
    greatest = max(abs(rim), abs(v))
    smaller = min(rim, v) / greatest
    return float(slip_ratio(rim, v)), math.hypot(v_sd, rim_sd) * max(abs(smaller), 1.0 if v < rim else 0.0) / greatest


def _change_of_slip(t: np.ndarray, way: np.ndarray, rim: float) -> float:
    """Return by how much the speeds of a window's halves differ, over the rim speed."""
    half = len(t) // 2
    first, second = (line(t[part], way[part]).slope for part in (slice(None, half), slice(half, None)))
    return abs(second - first) / rim
