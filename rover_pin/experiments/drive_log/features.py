"""Compute the features of a logged run: half-second means of channels, measured and replayed, which the search for
missing effects compares.

`logged_run` turns one run of a log into a `LoggedRun`, which holds the measured features and the commands for a replay
(a simulation of this run). `LoggedRun.features` computes these features from a replay. Some features are channels of
the log, such as `wheel_rate_fl`; others are computed from several channels (PATH, DRIFT, HEADING, SPEED). The tracked
place itself is not compared, because its error is the sum of all errors since the start.
"""

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
from rover_pin.experiments.drive_log.excluded_rows import (
    ambiguous_steps,
    lanes_under,
    later_duties,
    on_borders,
    unaffected_rows,
    without_pose_outliers,
)
from rover_pin.logs.drive_log import DriveLog
from rover_pin.logs.run_terrain import GroundEstimate
from rover_pin.rover.rover import Rover
from rover_pin.simulation.logged_inputs import fill_gaps, means_at
from rover_pin.simulation.replay import ReplayCommands, commands
from rover_pin.simulation.sensors import GRAVITY, inertial
from rover_pin.simulation.trace.channels import ODOMETRY, is_current
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Terrain

BLOCK = 0.5
"""Time over which samples are averaged for the comparison [s]: long compared with a motor's 0.1 s, short compared with
the duration of a duty, 2.5 s."""
LEAK = 2.0
"""Time constant [s] of the decay of summed distances and turns. In a sum without decay, the first error of a run would
have the largest weight. With the decay, the noise of the ground adds up over the time constant only."""
BEGIN = 1.0
"""Time at the start of a run that is not compared [s], because tracker and wheels may already move (assumed)."""
SLOW = 0.2
"""Minimum mean wheel rate [rad/s] of a moving rover. Rows with a slower rover are not compared, because a replay does
not predict when a wheel sticks (assumed)."""
SLOW_SHARE = 0.1
"""Minimum wheel rate of a moving rover as a fraction of its fastest wheel rate, if its wheels follow their measured
rates and if this limit is smaller than SLOW. Large wheels turn slowly (assumed)."""
AFTER_TURN = 1.5
"""Time after a standstill or a reversal that is not compared [s], because the shear displacement of the soil builds up
anew (assumed)."""
MAX_MISSING = 0.5
"""Maximum fraction of a wheel rate's rows without a number. With more, the wheel rate counts as not recorded."""
WHOLE = 0.999
"""Minimum fraction of the rows of a half-second block that must be comparable, if the block is to be compared."""

PATH, DRIFT, HEADING, SPEED = "path", "drift", "heading", "speed"
"""Features that are computed from several channels. Path, drift and heading are distance along the heading, distance
across the heading, and turn, each as a sum that decays with the time constant LEAK. Speed is the speed along the
heading."""
LEVELS = ("body_z",)
"""Channels with an unknown zero, such as a height. The mean over a run is subtracted from them before the
comparison."""
OF_PLACE = (PATH, DRIFT, HEADING, SPEED, "body_z")
"""Features that are not compared if the logged place is wheel odometry, because odometry does not measure the place.
Tilts and the channels of an inertial unit have sensors of their own and are compared."""
RAW = ("body_x", "body_y", "body_yaw", "body_vx", "body_vy", "body_vz")
"""Channels that are not compared themselves, but only through the features that are computed from them."""
ATTITUDE = ("body_pitch", "body_roll", "body_z")
"""Channels for the estimate of a run's terrain. On an estimated terrain these channels are compared only if the error
of the terrain is part of the noise (`LoggedRun.ground`). Otherwise they would count twice."""


@dataclass(frozen=True, eq=False)
class LoggedRun:
    """One run of a log with its measured features and the commands for its replay.

    A feature is a half-second mean that the search for missing effects compares, with one value for each block of BLOCK
    seconds. A replay is a simulation with the logged commands, with rows at equal time steps.
    """

    name: str
    commands: ReplayCommands
    channels: tuple[str, ...]
    "names of the features"
    observed: np.ndarray = field(repr=False)
    "measured features (channels, blocks); NaN in blocks that are not compared"
    heading: np.ndarray = field(repr=False)
    """logged yaw, smoothed over a block [rad] (rows,)"""
    measured: dict[str, np.ndarray] = field(repr=False)
    """channel name -> logged values in the rows of the replay (rows,)"""
    summed_rows: np.ndarray = field(repr=False)
    """mask (rows,) of the rows whose driven distance is added to the decaying sums of path, drift and heading"""
    compared: np.ndarray = field(repr=False)
    """mask (rows,) of the rows that are compared"""
    later: tuple[np.ndarray, ...] = ()
    """change of the duties (rows, wheels) for each ambiguous duty step, if this step happens one SD later than
    assumed"""
    on_border: float = 0.0
    """total time with a wheel on the border of two lanes [s]; this time is not compared"""
    course: str = ""
    """the log's formula for the heading from the place, or ''; with a formula, the heading of a replay is computed by
    it too"""
    ground: GroundEstimate | None = field(default=None, repr=False)
    """estimate of the terrain, if the terrain was estimated and its error is part of the noise. Runs over one terrain
    have one object in common"""

    @cached_property
    def usable(self) -> np.ndarray:
        """Mask of the blocks that are compared (blocks,)."""
        return blocks(self.compared, self.commands.period) > WHOLE

    @property
    def times(self) -> np.ndarray:
        """Time at the middle of each block [s] (blocks,)."""
        return blocks(self.commands.t, self.commands.period)

    def features(self, channels: Mapping[str, np.ndarray], sensors: Sequence[SensorEffect] = ()) -> np.ndarray:
        """Return the features of a replay (channels, blocks), that is, the half-second means that the search for
        missing effects compares with the log.

        Parameters
        ----------
        channels : mapping of str to np.ndarray
            Name -> channel of the replay (rows,).
        sensors : sequence of SensorEffect
            Sensor effects of the model. Their errors are applied to the channels before the features are computed.
        """
        # The readings of an inertial unit follow from the motion of the body; then the sensor errors are applied.
        read = dict(channels)
        if self.commands.inertial and GRAVITY[0] in channels:
            read |= inertial(channels, self.commands.period)
        # A replay that did not start has no channels that a sensor could read.
        for sensor in sensors if "body_yaw" in channels else ():
            read |= sensor.read(self.commands.t, read)
        rows = dict(self._rows(read))
        means = blocks(np.array(list(rows.values())), self.commands.period)
        return np.array([remove_level(name, block, self.usable) for name, block in zip(rows, means, strict=True)])

    def measured_rows(self) -> dict[str, np.ndarray]:
        """Return each measured feature before it is averaged over half-second blocks: name -> rows (rows,)."""
        return dict(self._rows({name: fill_gaps(row) for name, row in self.measured.items()}))

    def _rows(self, channels: Mapping[str, np.ndarray]) -> list[tuple[str, np.ndarray]]:
        """Return the name of each feature and its value in each row (rows,), before values are averaged over blocks.

        The values are computed from the given channels (rows,). A feature whose channels are missing is 0.
        """
        t = self.commands.t
        if self.course:
            # A replay is drawn to the logged heading. Its place without this turn gives the heading by the formula.
            steps = np.diff(channels["body_x"], prepend=0.0) + 1j * np.diff(channels["body_y"], prepend=0.0)
            place = np.cumsum(steps * np.exp(-1j * channels.get(DRAWN, np.zeros(len(steps)))))
            columns = {**self.measured, **channels, "body_x": place.real, "body_y": place.imag, "t_s": t}
            channels = {**channels, "body_yaw": evaluate(self.course, columns, f"{self.name}: body_yaw")}
        derived_features = driven_features(channels, self.heading, self.commands.period, self.summed_rows)
        still = np.zeros(len(t))
        return [(name, derived_features.get(name, channels.get(name, still))) for name in self.channels]


def logged_run(log: Trace, rover: Rover, terrain: Terrain | None = None, course: str = "") -> LoggedRun:
    """Return one run of a log with its measured features (half-second means), ready for the comparison with replays.

    Not compared are outlying poses, ambiguous duty steps, and the time with a wheel on the border of two lanes.

    Parameters
    ----------
    log : Trace
        The logged run, in SI units.
    rover : Rover
        The rover of the log, with the names and places of its wheels.
    terrain : Terrain, optional
        The declared terrain under the run. It states the borders between lanes.
    course : str
        The log's formula for the heading from the place, as `course_of` returns it; '' if the heading is measured.
    """
    log = with_assumed_rates(without_pose_outliers(log), rover)
    wheels = tuple(wheel.name for wheel in rover.wheels)
    steered = tuple(wheel.name for wheel in rover.wheels if wheel.steer_dof is not None)
    run = commands(log, wheels, steered)
    # The logged channels in the rows of the replay, with gaps, and without gaps for the leaky sums.
    names = [name for name in log.channels if comparable(name) and np.isfinite(log[name]).any()]
    rates = [name for wheel in wheels if (name := f"wheel_rate_{wheel}") in names]
    rows = {name: means_at(log.t, log[name], run.t, run.period) for name in names}
    rows["body_yaw"] = run.place[:, 2]
    heading = uniform_filter1d(fill_gaps(rows["body_yaw"]), max(1, round(BLOCK / run.period)))
    gapless_rows = {name: fill_gaps(row) for name, row in rows.items()}
    # Rows in which a driven distance counts: a replay is then comparable, and the place is not interpolated across rows
    # that do not count.
    steps = ambiguous_steps(log)
    on_border = on_borders(run, rover, terrain)
    summed_rows = comparable_rows(run, [rows[name] for name in rates]) & ~on_border
    summed_rows &= in_whole_gaps(summed_rows, ~np.isfinite(run.place).all(axis=1))
    derived_features = driven_features(gapless_rows, heading, run.period, summed_rows)
    # Inputs of the replay are not compared, nor are features that the log does not measure.
    hidden = {*RAW, *((*rates, "battery_V") if run.rate_driven else ()), *((DRIFT,) if course else ())}
    hidden |= set(OF_PLACE) if log.attrs.get("place") == ODOMETRY else set()
    features = [name for name in (*derived_features, *rows) if name not in hidden]
    compared = summed_rows & unaffected_rows(steps, run)
    use = blocks(compared, run.period) > WHOLE
    sources = {PATH: ("body_x", "body_y"), DRIFT: ("body_x", "body_y"), HEADING: ("body_yaw",), SPEED: ("body_vx",)}
    observed = []
    for name in features:
        # A block with a gap in one of the feature's channels becomes NaN.
        good = np.all([np.isfinite(rows[channel]) for channel in sources.get(name, (name,))], axis=0)
        row = np.where(good, derived_features[name] if name in derived_features else gapless_rows[name], np.nan)
        block = blocks(row, run.period)
        observed.append(remove_level(name, np.where(use, block, np.nan), use))
    return LoggedRun(
        run_name(log),
        run,
        tuple(features),
        np.array(observed),
        heading,
        rows,
        summed_rows,
        compared,
        tuple(later_duties(step, run, wheels) for step in steps),
        run.period * float(on_border.sum()),
        course,
    )


def logged_runs(log: DriveLog, rover: Rover) -> tuple[LoggedRun, ...]:
    """Return all runs of a log with their measured features (half-second means), each run with its own terrain if it
    has one.

    If the terrain of a run is estimated from the run's attitude, the channels ATTITUDE of this run are not compared.
    """
    runs = zip(log.runs, runs_with_attitude(log, rover), strict=True)
    return tuple(without_attitude(run) if log.is_estimated(trace) else run for trace, run in runs)


def runs_with_attitude(log: DriveLog, rover: Rover) -> tuple[LoggedRun, ...]:
    """Return all runs of a log with all their measured features (half-second means), each run with its own terrain if
    it has one. The channels ATTITUDE are kept even if they were used to estimate this terrain.
    """
    shared = log.terrain()
    course = course_of(log.metadata.columns)
    runs = []
    for trace in log.runs:
        run = logged_run(trace, rover, lanes_under(log, trace, shared), course)
        runs.append(replace(run, commands=replace(run.commands, terrain=log.terrain_of(trace))))
    return tuple(runs)


def without_attitude(run: LoggedRun) -> LoggedRun:
    """Return a run without the features ATTITUDE, because they have already been used to estimate its terrain."""
    is_kept = np.array([name not in ATTITUDE for name in run.channels], dtype=bool)
    channels = tuple(name for name in run.channels if name not in ATTITUDE)
    return replace(run, channels=channels, observed=run.observed[is_kept])


def run_name(log: Trace) -> str:
    """Return the name of a run of a log: the name of its file without the ending."""
    return Path(str(log.attrs.get("file", "run"))).stem


def with_assumed_rates(log: Trace, rover: Rover) -> Trace:
    """Return a run with a rate for each wheel. A wheel without a recorded rate gets the mean rim speed of the other
    wheels on its side.

    Only a run without duties is changed, because its replay needs the rate of every wheel. A rate counts as not
    recorded if more than the fraction MAX_MISSING of its rows has no number. Assumed rates are not compared.
    """
    # With duties, the simulation computes the rates itself.
    if not log.rate_driven:
        return log
    rates = {mount.name: log.get(f"wheel_rate_{mount.name}", np.full(len(log.t), np.nan)) for mount in rover.wheels}
    recorded = {name for name, rate in rates.items() if rate.size and np.mean(~np.isfinite(rate)) <= MAX_MISSING}
    assumed = {}
    for mount in rover.wheels:
        # Wheels of one side have nearly the same rim speed, because they travel the same path.
        side = [other for other in rover.wheels if other.side == mount.side and other.name in recorded]
        if mount.name not in recorded and side:
            rim = np.mean([float(other.wheel.r) * rates[other.name] for other in side], axis=0)
            assumed[f"wheel_rate_{mount.name}"] = rim / float(mount.wheel.r)
    return replace(log, channels={**log.channels, **assumed}) if assumed else log


def comparable(name: str) -> bool:
    """Return whether models predict the channel of this name, so that measurement and prediction can be compared."""
    kinds = ("wheel_rate_", "rocker_", "bogie_", "body_", "gyro_", "accelerometer_", "battery_V")
    return name.startswith(kinds) or is_current(name)


def pose_increments(channels: Mapping[str, np.ndarray], heading: np.ndarray) -> dict[str, np.ndarray]:
    """Return the change of the pose from row to row as PATH, DRIFT and HEADING, and the speed as SPEED: feature -> rows
    (rows,).

    Parameters
    ----------
    channels : mapping of str to np.ndarray
        Channel name -> values (rows,): body_x and body_y [m], body_yaw [rad], body_vx and body_vy [m/s]. A feature
        without its channels is omitted.
    heading : np.ndarray
        Direction of PATH and SPEED [rad] (rows,); DRIFT is perpendicular to this direction, positive to the left.
    """
    rows = {}
    # The first increment is 0, because `prepend` repeats the first value.
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
    """Return the features that are computed from several channels: PATH, DRIFT and HEADING as decaying sums, and SPEED
    (rows,).

    For `channels` and `heading`, see `pose_increments`; `period` is the time between rows [s], and the mask
    `summed_rows` (rows,) marks the rows whose increments are added. The increments of all other rows are not summed,
    because each would stay in the sum and be compared in later rows. Older increments decay with the time constant
    LEAK.
    """
    rows = pose_increments(channels, heading).items()
    return {name: row if name == SPEED else leaky(summed_rows * row, period) for name, row in rows}


def leaky(steps: np.ndarray, period: float) -> np.ndarray:
    """Return the sum of increments (rows,). Older increments decay with the time constant LEAK.

    `period` is the time between two increments [s].
    """
    return np.asarray(lfilter([1.0], [1.0, -np.exp(-period / LEAK)], steps))


def blocks(rows: np.ndarray, period: float) -> np.ndarray:
    """Return the means of rows (..., rows) over blocks of BLOCK seconds, along the last axis (..., blocks).

    `period` is the time between rows [s]. Rows after the last complete block are omitted.
    """
    length = max(1, round(BLOCK / period))
    count = rows.shape[-1] // length
    return np.asarray(rows[..., : count * length], dtype=float).reshape(*rows.shape[:-1], count, length).mean(axis=-1)


def remove_level(name: str, block: np.ndarray, use: np.ndarray) -> np.ndarray:
    """Return the block means of a channel (blocks,) after subtracting their mean, if the channel has an unknown zero
    (LEVELS).

    The mean is taken over the compared blocks, which the mask `use` marks. Other channels are returned unchanged.
    """
    # If no block is compared, there is no mean to subtract.
    if name not in LEVELS or not use.any():
        return block
    return block - np.nanmean(block[use]) if np.isfinite(block[use]).any() else block


def comparable_rows(run: ReplayCommands, rates: Sequence[np.ndarray]) -> np.ndarray:
    """Return a mask of the rows (rows,) of a run that can be compared with a replay.

    A row can be compared if it is later than BEGIN after the start, and if the rover has neither stopped nor reversed
    during the last AFTER_TURN seconds. `rates` holds the rates of the wheels [rad/s], each (rows,).
    """
    t, rows = run.t, np.nan_to_num([fill_gaps(row) for row in rates])
    duty, rate = run.duty.mean(axis=1), rows.mean(axis=0)
    if run.rate_driven:
        # In a turn on the spot the mean rate is 0, so the mean absolute rate decides whether the wheels turn.
        size = np.abs(rows).mean(axis=0)
        is_reversed = np.sum(rows * np.roll(rows, 1, axis=1), axis=0) < 0.0
        standing = (size < min(SLOW, SLOW_SHARE * float(np.max(size)))) | (is_reversed & (t > t[0]))
    else:
        standing = (np.abs(rate) < SLOW) | (np.sign(rate) * np.sign(duty) < 0)
    # Time of the last row in which the rover stood or reversed, up to each row.
    since = np.where(standing, t, -np.inf)
    return np.asarray((t - t[0] >= BEGIN) & (t - np.maximum.accumulate(since) > AFTER_TURN))


def in_whole_gaps(summed_rows: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """Return a mask of the rows (rows,) whose driven distance is known: rows with a measured place, and rows of
    complete gaps.

    A gap is a sequence of rows without a place (mask `missing`). It is filled by a straight line, which spreads the
    distance over all rows of the gap. If some rows of a gap are not in `summed_rows`, the distance in its other rows is
    unknown, and the whole gap is omitted.
    """
    # The increment of the row after a gap spans a part of the gap, so this row belongs to the gap too.
    bridged = missing | np.concatenate([[False], missing[:-1]])
    gap = np.cumsum(~bridged)
    return ~bridged | (np.bincount(gap, bridged & ~summed_rows) == 0)[gap]


def course_of(columns: Mapping[str, Any]) -> str:
    """Return the formula by which a log computes the heading from the positions body_x and body_y, or an empty text if
    the log measures the heading.

    The formula is the entry of body_yaw in the log's table [columns], if this entry uses body_x and body_y. The heading
    of such a log is the direction of travel (the course) and not a measurement.
    """
    # A heading from other columns, such as a compass, is a measurement.
    entry = columns.get("body_yaw", "")
    formula = entry.get("formula", "") if isinstance(entry, Mapping) else ""
    return formula if formula and {"body_x", "body_y"} <= set(names_in(formula, "body_yaw")) else ""
