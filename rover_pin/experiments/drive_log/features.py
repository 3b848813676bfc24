"""A logged run as the loop compares it: half-second means of what a sensor says, measured and replayed alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from rover_pin.base.formula import evaluate, names_in
from rover_pin.effects.effect import SensorEffect
from rover_pin.effects.tracked_point import DRAWN
from rover_pin.experiments.drive_log.readings.ambiguous_timing import ambiguous_steps, later_duties, unaffected_rows
from rover_pin.experiments.drive_log.readings.lane_borders import lanes_under, on_borders
from rover_pin.experiments.drive_log.readings.outliers import without_pose_outliers
from rover_pin.logs.drive_log import DriveLog
from rover_pin.rover.rover import Rover
from rover_pin.simulation.logged_inputs import fill_gaps, means_at
from rover_pin.simulation.replay import Commands, commands
from rover_pin.simulation.trace.channels import ODOMETRY, is_current
from rover_pin.simulation.trace.inertial import GRAVITY, inertial
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain

BLOCK = 0.5
"""Time over which samples are averaged [s]. Why: long against a motor's 0.1 s, short against a duty's 2.5 s."""
LEAK = 2.0
"""Time over which the driven path forgets its past [s]: noise of the ground adds up no longer than that. Why: a path
that sums all would weigh the first error most."""
BEGIN = 1.0
"""Time at the start of a run that is not compared [s]: tracker and wheels may already move (assumed)."""
SLOW = 0.2
"""Mean wheel rate [rad/s] below which a rover counts as standing. Why: sticking is not comparable (assumed)."""
SLOW_SHARE = 0.1
"""The same of wheels held to their rates, as a share of the fastest: large wheels turn slowly (assumed)."""
AFTER_TURN = 1.5
"""Time after a standstill or a reversal that is not compared [s]. Why: shear builds up anew (assumed)."""

PATH, DRIFT, HEADING, SPEED = "path", "drift", "heading", "speed"
"""Features made of several channels: leaky way driven along and across the heading, leaky yaw, speed along it."""
LEVELS = ("body_z",)
"""Channels whose mean over a run is not compared: their zero is the tracker's."""


@dataclass(frozen=True, eq=False)
class LoggedRun:
    """One run of a log on the rows of its replay.

    `observed` are the measured features (channels, blocks), NaN where they are not comparable; `heading` (T,) is
    the logged yaw, smoothed.
    """

    name: str
    commands: Commands
    channels: tuple[str, ...]
    observed: np.ndarray = field(repr=False)
    heading: np.ndarray = field(repr=False)
    measured: dict[str, np.ndarray] = field(repr=False)
    "the logged channels on the rows of the replay"
    summed_rows: np.ndarray = field(repr=False)
    "in which rows what was driven counts (T,)"
    compared: np.ndarray = field(repr=False)
    "which of them are compared (T,)"
    later: tuple[np.ndarray, ...] = ()
    "by what duties (T, wheels) differ where a step of them comes one SD later than taken, for each that is in doubt"
    on_border: float = 0.0
    "how long a wheel stood on the border of two lanes, which is not compared [s]"
    course: str = ""
    "formula of a heading that was made of the place: a replay's is made so too, and no drift across it is known"

    @cached_property
    def usable(self) -> np.ndarray:
        """Which blocks are compared (blocks,)."""
        return blocks(self.compared, self.commands.period) > WHOLE

    def features(self, channels: Mapping[str, np.ndarray], sensors: Sequence[SensorEffect] = ()) -> np.ndarray:
        """Return the features (channels, blocks) of replayed channels, as the sensors would report them."""
        read = dict(channels)
        if self.commands.inertial and GRAVITY[0] in channels:
            read |= inertial(channels, self.commands.period)
        for sensor in sensors:
            read |= sensor.read(self.commands.t, read)
        rows = dict(self._rows(read))
        means = blocks(np.array(list(rows.values())), self.commands.period)
        return np.array([remove_level(name, block, self.usable) for name, block in zip(rows, means, strict=True)])

    def measured_rows(self) -> dict[str, np.ndarray]:
        """Return the features before they are averaged over blocks, as measured (T,) by name."""
        return dict(self._rows({name: fill_gaps(row) for name, row in self.measured.items()}))

    def _rows(self, channels: Mapping[str, np.ndarray]) -> list[tuple[str, np.ndarray]]:
        t = self.commands.t
        if self.course:
            columns = {**self.measured, **channels, **_own_way(channels), "t_s": t}
            channels = {**channels, "body_yaw": evaluate(self.course, columns, f"{self.name}: body_yaw")}
        derived_features = driven_features(channels, self.heading, self.commands.period, self.summed_rows)
        still = np.zeros(len(t))
        return [(name, derived_features.get(name, channels.get(name, still))) for name in self.channels]

    @property
    def times(self) -> np.ndarray:
        """Middle of each block [s]."""
        return blocks(self.commands.t, self.commands.period)


def logged_run(log: Trace, rover: Rover, terrain: Terrain | None = None, course: str = "") -> LoggedRun:
    """Return a run of a log ready for comparison, without outlying poses and duty steps at unknown times.

    Nor is compared what was driven where a wheel stood on the border of two lanes of the terrain.
    """
    log = without_pose_outliers(log)
    wheels = tuple(wheel.name for wheel in rover.wheels)
    steered = tuple(wheel.name for wheel in rover.wheels if wheel.steer_dof is not None)
    run = commands(log, wheels, steered)
    names = [name for name in log.channels if comparable(name) and np.isfinite(log[name]).any()]
    turned = [f"wheel_rate_{wheel}" for wheel in wheels]
    rows = {name: means_at(log.t, log[name], run.t, run.period) for name in names}
    rows["body_yaw"] = run.place[:, 2]
    heading = uniform_filter1d(fill_gaps(rows["body_yaw"]), max(1, round(BLOCK / run.period)))
    gapless_rows = {name: fill_gaps(row) for name, row in rows.items()}
    steps = ambiguous_steps(log)
    on_border = on_borders(run, rover, terrain)
    summed_rows = comparable_rows(run, [rows[name] for name in turned]) & ~on_border
    summed_rows &= in_whole_gaps(summed_rows, ~np.isfinite(run.place).all(axis=1))
    derived_features = driven_features(gapless_rows, heading, run.period, summed_rows)
    gaps = {PATH: ("body_x", "body_y"), DRIFT: ("body_x", "body_y"), HEADING: ("body_yaw",), SPEED: ("body_vx",)}
    hidden = {*RAW, *((*turned, "battery_V") if run.rate_driven else ()), *((DRIFT,) if course else ())}
    hidden |= set(OF_PLACE) if log.attrs.get("place") == ODOMETRY else set()
    features = [name for name in (*derived_features, *rows) if name not in hidden]
    compared = summed_rows & unaffected_rows(steps, run)
    use = blocks(compared, run.period) > WHOLE
    observed = []
    for name in features:
        good = np.all([np.isfinite(rows[channel]) for channel in gaps.get(name, (name,))], axis=0)
        row = np.where(good, derived_features[name] if name in derived_features else gapless_rows[name], np.nan)
        block = blocks(row, run.period)
        observed.append(remove_level(name, np.where(use, block, np.nan), use))
    name = Path(str(log.attrs.get("file", "run"))).stem
    known = tuple(features), np.array(observed), heading, rows, summed_rows, compared
    later = tuple(later_duties(step, run, wheels) for step in steps)
    return LoggedRun(name, run, *known, later, run.period * float(on_border.sum()), course)


WHOLE = 0.999
"""Share of a block's rows that must be compared for the block to be."""
OF_PLACE = (PATH, DRIFT, HEADING, SPEED, "body_z")
"""What wheels' odometry does not tell; tilts, and what an inertial unit reads, are of sensors of their own."""
RAW = ("body_x", "body_y", "body_yaw", "body_vx", "body_vy", "body_vz")
"""Channels that are compared through the features made of them."""


def _own_way(channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the place where a replay's own turn would have led it, which was drawn to the logged heading."""
    steps = np.diff(channels["body_x"], prepend=0.0) + 1j * np.diff(channels["body_y"], prepend=0.0)
    place = np.cumsum(steps * np.exp(-1j * channels.get(DRAWN, np.zeros(len(steps)))))
    return {"body_x": place.real, "body_y": place.imag}


def comparable(name: str) -> bool:
    """Return whether a channel of a log says something that a model predicts."""
    kinds = ("wheel_rate_", "rocker_", "bogie_", "body_", "gyro_", "accelerometer_", "battery_V")
    return name.startswith(kinds) or is_current(name)


def pose_increments(channels: Mapping[str, np.ndarray], heading: np.ndarray) -> dict[str, np.ndarray]:
    """Return way along and across the heading and turn, from row to row, and the speed along it, as far as known."""
    rows = {}
    forward = np.array([np.cos(heading), np.sin(heading)])
    if "body_x" in channels and "body_y" in channels:
        steps = np.array([np.diff(channels[f"body_{axis}"], prepend=channels[f"body_{axis}"][0]) for axis in "xy"])
        rows[PATH] = np.sum(forward * steps, axis=0)
        rows[DRIFT] = forward[0] * steps[1] - forward[1] * steps[0]
    if "body_yaw" in channels:
        rows[HEADING] = np.diff(channels["body_yaw"], prepend=channels["body_yaw"][0])
    if "body_vx" in channels and "body_vy" in channels:
        rows[SPEED] = forward[0] * channels["body_vx"] + forward[1] * channels["body_vy"]
    return rows


def driven_features(
    channels: Mapping[str, np.ndarray], heading: np.ndarray, period: float, summed_rows: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the features made of several channels: what was moved, ways and turn as leaky sums.

    What was driven in rows that are not in `summed_rows` is left out of the sums, or it would be compared later.
    """
    rows = pose_increments(channels, heading).items()
    return {name: row if name == SPEED else leaky(summed_rows * row, period) for name, row in rows}


def leaky(steps: np.ndarray, period: float) -> np.ndarray:
    """Return the sum of steps that forgets with the time constant LEAK."""
    return np.asarray(lfilter([1.0], [1.0, -np.exp(-period / LEAK)], steps))


def blocks(rows: np.ndarray, period: float) -> np.ndarray:
    """Return means over BLOCK along the last axis; what does not fill the last block is left out."""
    length = max(1, round(BLOCK / period))
    count = rows.shape[-1] // length
    return np.asarray(rows[..., : count * length], dtype=float).reshape(*rows.shape[:-1], count, length).mean(axis=-1)


def remove_level(name: str, block: np.ndarray, use: np.ndarray) -> np.ndarray:
    """Return the blocks, less their mean over the compared ones where the channel's zero means nothing."""
    if name not in LEVELS or not use.any():
        return block
    return block - np.nanmean(block[use]) if np.isfinite(block[use]).any() else block


def comparable_rows(run: Commands, rates: Sequence[np.ndarray]) -> np.ndarray:
    """Return which rows are compared: after the start, and not while or soon after the rover stands or turns round."""
    t, rows = run.t, np.nan_to_num([fill_gaps(row) for row in rates])
    duty, rate = run.duty.mean(axis=1), rows.mean(axis=0)
    if run.rate_driven:
        size = np.abs(rows).mean(axis=0)
        turned = np.sum(rows * np.roll(rows, 1, axis=1), axis=0) < 0.0
        standing = (size < min(SLOW, SLOW_SHARE * float(np.max(size)))) | (turned & (t > t[0]))
    else:
        standing = (np.abs(rate) < SLOW) | (np.sign(rate) * np.sign(duty) < 0)
    since = np.where(standing, t, -np.inf)
    return np.asarray((t - t[0] >= BEGIN) & (t - np.maximum.accumulate(since) > AFTER_TURN))


def in_whole_gaps(summed_rows: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """Return which rows are not bridged by one line with a row that does not count: the line has the way of all."""
    bridged = missing | np.concatenate([[False], missing[:-1]])
    gap = np.cumsum(~bridged)
    return ~bridged | (np.bincount(gap, bridged & ~summed_rows) == 0)[gap]


def course_of(columns: Mapping[str, Any]) -> str:
    """Return the formula of a log's heading where [columns] make it of the place; else nothing."""
    entry = columns.get("body_yaw", "")
    formula = entry.get("formula", "") if isinstance(entry, Mapping) else ""
    return formula if formula and {"body_x", "body_y"} <= set(names_in(formula, "body_yaw")) else ""


def logged_runs(log: DriveLog, rover: Rover) -> tuple[LoggedRun, ...]:
    """Return all runs of a log."""
    shared = log.terrain()
    course = course_of(log.metadata.columns)
    runs = [(trace, logged_run(trace, rover, lanes_under(log, trace, shared), course)) for trace in log.runs]
    return tuple(_on_its_ground(log, trace, run) for trace, run in runs)


TELL_GROUND = ("body_pitch", "body_roll", "body_z")
"""Channels that tell the ground where it is estimated: comparing them again would count them twice."""


def _on_its_ground(log: DriveLog, trace: Trace, run: LoggedRun) -> LoggedRun:
    """Return the run on its own ground, if it has one, without the channels that this was estimated from."""
    is_selected = [name not in TELL_GROUND or not log.is_estimated(trace) for name in run.channels]
    names = tuple(name for name, keep in zip(run.channels, is_selected, strict=True) if keep)
    commands = replace(run.commands, terrain=log.terrain_of(trace))
    return replace(run, commands=commands, channels=names, observed=run.observed[np.array(is_selected, dtype=bool)])
