"""Find rows of a log that are not compared with a simulation: outlying poses, ambiguous duty steps, borders of lanes.

An outlying pose is a single row whose pose differs from the poses of all neighbouring rows by far more than the noise
of the tracker. If a tracker confuses the rover's marker with another one in one frame, the whole pose is wrong, so all
six numbers of the row are excluded. Two or more such rows in sequence are a jump. The data check reports a jump, but no
row is excluded.

A duty step is ambiguous if its instant is unknown. If commands are given at the rows, the duty of a row has been
applied since the row before. If rows were read late or not written, the log shows only that the duty changed between
two rows. When a wheel starts or stops, an uncertainty of half a row changes the half-second mean of its rate by several
times the noise of its tachogenerator.

If a wheel is on the border between two lanes with different heights, the height under the wheel is unknown, because the
log declares one height for each lane.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.estimation.noise import SD_OVER_MAD
from rover_pin.logs.drive_log import DriveLog
from rover_pin.logs.run_terrain import is_of_run
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.logged_inputs import is_open
from rover_pin.simulation.replay import ReplayCommands
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.terrain import Lanes, Terrain

JUMPS = {
    "body_x": 0.005, "body_y": 0.005, "body_z": 0.005, "body_roll": 0.02, "body_pitch": 0.02, "body_yaw": 0.02,
}  # fmt: skip
"""Channel of the pose -> minimum distance of an outlier from its neighbours [m for positions, rad for angles]."""
MIN_OUTLIER_SD = 6.0
"""Minimum distance of an outlier from the nearest of its neighbours, in SDs of the tracker's noise. By chance, a row
exceeds this distance once in some million rows. A wrongly excluded row costs one row, but a wrong pose that is kept
shifts the whole path after it."""
NEIGHBOURS = 2
"""Number of rows before a pose, and number of rows after it, for the comparison with the pose."""
MAX_NEIGHBOUR_TIME = 0.3
"""Maximum time from the first to the last neighbour of a pose [s]. Neighbours that are farther apart do not determine
the pose between them. Next to a gap, the neighbours on the other side must lie within half of this time."""
SD_OVER_MEDIAN = SD_OVER_MAD / np.sqrt(1.5)
"""Ratio of the SD of white noise to the median distance of a sample from the mean of its two neighbours."""

SAME_DUTY = 0.02
"""Two duties that differ by less than this value count as equal, so that the instant of the step between them does not
matter. The value is five steps of an 8-bit driver. The unknown instant of a larger step changes a half-second mean of
the wheel rate by more than 4 mrad/s."""
MIN_STEP_RATIO = 5.0
"""Minimum size of an ambiguous duty step, as a multiple of the median change of the duty from row to row (assumed). In
a duty that changes in every row, the errors of the instants average out, so no step is excluded."""
RESPONSE_TIME = 0.1
"""Time after an ambiguous duty step [s]; rows within this time are not compared. A wheel needs this time to reach its
new rate. The value belongs to a series motor with its wheel (assumed)."""

MIN_LANE_STEP = 1e-3
"""Minimum difference in height between two lanes [m] at which a wheel on their border is not compared (assumed: raked
sand is less even)."""


def pose_outliers(log: Trace) -> np.ndarray:
    """Return a mask (rows,) of the rows of a logged run whose tracked pose is an outlier.

    A pose is an outlier if one of its numbers lies on one side of the two poses before and of the two poses after it,
    and far from all four.
    """
    outliers = np.zeros(len(log.t), dtype=bool)
    # The second pass finds outliers whose neighbour was an outlier as well.
    for _ in range(2):
        for name in (channel for channel in JUMPS if channel in log):
            rows = np.flatnonzero(np.isfinite(log[name]) & ~outliers)
            if len(rows) <= 2 * NEIGHBOURS:
                continue
            t, values = log.t[rows], log[name][rows]
            # All angles have the same minimum distance in JUMPS. A step from 180 deg to -180 deg is no outlier.
            unwrapped = np.unwrap(values) if JUMPS[name] == JUMPS["body_yaw"] else values
            middle = np.arange(NEIGHBOURS, len(t) - NEIGHBOURS)
            shifts = [shift for shift in range(-NEIGHBOURS, NEIGHBOURS + 1) if shift]
            distance = np.array([unwrapped[middle] - unwrapped[middle + shift] for shift in shifts])
            one_side = (distance > 0).all(axis=0) | (distance < 0).all(axis=0)
            noise = white_noise_sd(unwrapped)
            to_neighbours = np.fmin(t[middle + NEIGHBOURS] - t[middle], t[middle] - t[middle - NEIGHBOURS])
            is_dense = to_neighbours < MAX_NEIGHBOUR_TIME / 2
            is_far = np.abs(distance).min(axis=0) > max(JUMPS[name], MIN_OUTLIER_SD * noise)
            outliers[rows[middle[one_side & is_dense & is_far]]] = True
    return outliers


def without_pose_outliers(log: Trace) -> Trace:
    """Return a logged run with NaN in place of all numbers of the outlying poses (found by `pose_outliers`)."""
    return without_poses(log, pose_outliers(log))


def without_poses(log: Trace, outliers: np.ndarray) -> Trace:
    """Return a logged run with NaN in place of all numbers of the pose, in the rows that the mask `outliers` (rows,)
    marks.
    """
    if not outliers.any():
        return log
    emptied = {name: np.where(outliers, np.nan, log[name]) for name in JUMPS if name in log}
    return Trace({**log.channels, **emptied}, log.units, log.attrs)


def white_noise_sd(values: np.ndarray) -> float:
    """Return the SD of the white noise in samples (rows,), from the distance of each sample to the mean of its two
    neighbours.

    The median distance is used, so that steps and outliers of the signal have no influence. Samples without both
    neighbours are omitted. If no sample remains, the result is 0.
    """
    # A straight line has no deviation from the mean of its neighbours, so that only noise remains.
    deviation = values[1:-1] - (values[:-2] + values[2:]) / 2
    magnitudes = np.abs(deviation[np.isfinite(deviation)])
    return SD_OVER_MEDIAN * float(np.median(magnitudes)) if magnitudes.size else 0.0


class AmbiguousStep(NamedTuple):
    """An interval between two rows of a log. At least one duty changed at an unknown instant within it."""

    begin: float
    "time of the row before the step [s]"
    end: float
    "time of the row after the step [s]"
    change: dict[str, float]
    """channel name of each duty -> change of the duty in the interval"""


def ambiguous_steps(log: Trace) -> list[AmbiguousStep]:
    """Return the duty steps of a log whose instant is unknown, because the rows around them are unevenly spaced in
    time.
    """
    # With given wheel rates, no duty acts on the simulation.
    names = [name for name in log.channels if name.startswith("duty_")]
    if log.rate_driven or not names or len(log.t) < 3:
        return []
    # A step counts if it is large, if it stands out of the usual changes, and if its two rows are unevenly spaced.
    change = np.nan_to_num(np.diff(np.column_stack([log[name] for name in names]), axis=0))
    largest = np.abs(change).max(axis=1)
    is_step = (largest > max(SAME_DUTY, MIN_STEP_RATIO * float(np.median(largest)))) & is_open(log.t)
    changes = [dict(zip(names, row.tolist(), strict=True)) for row in change]
    return [AmbiguousStep(float(log.t[row]), float(log.t[row + 1]), changes[row]) for row in np.flatnonzero(is_step)]


def unaffected_rows(steps: Sequence[AmbiguousStep], run: ReplayCommands) -> np.ndarray:
    """Return a mask of the rows of a replay (rows,) that are not affected by ambiguous duty steps (`steps`).

    A row is affected if it lies between begin and end of a step, or within RESPONSE_TIME after the end.
    """
    rows = np.ones(len(run.t), dtype=bool)
    for begin, end, _ in steps:
        rows &= (run.t < begin) | (run.t - run.period > end + RESPONSE_TIME)
    return rows


def later_duties(step: AmbiguousStep, run: ReplayCommands, wheels: Sequence[str]) -> np.ndarray:
    """Return the change of the duties of a replay (rows, wheels) if an ambiguous step happens one SD later than
    assumed.

    A replay assumes that the step happens in the middle between its two rows. The true instant is uniformly distributed
    between the rows, so its SD is the interval between the rows divided by sqrt(12).
    """
    # Fraction of each row of the replay that lies between the assumed instant and one SD later.
    middle = (step.begin + step.end) / 2
    ends = np.clip([run.t - run.period, run.t], middle, middle + (step.end - step.begin) / np.sqrt(12.0))
    return -np.outer((ends[1] - ends[0]) / run.period, [step.change[f"duty_{wheel}"] for wheel in wheels])


def lanes_under(log: DriveLog, trace: Trace, shared: Terrain) -> Terrain:
    """Return the declared terrain under a run: the terrain of the run itself, or else the terrain of the whole log.

    `shared` is the terrain of the whole log. It is also returned if the terrain is estimated from the run, because an
    estimated terrain has no lanes.
    """
    # Only a terrain that is declared as lanes has borders.
    own = trace.attrs.get("terrain")
    declared = log.terrain_of(trace) if own and not is_of_run(own) else None
    return declared or shared


def on_borders(run: ReplayCommands, rover: Rover, terrain: Terrain | None) -> np.ndarray:
    """Return a mask of the rows of a run (rows,) with a wheel on the border between two lanes of different heights.

    The result is False in all rows if the terrain has no lanes.
    """
    rows = np.zeros(len(run.t), dtype=bool)
    if not isinstance(terrain, Lanes) or not terrain.borders:
        return rows
    x, y, yaw = run.place.T
    places = wheel_places(rover)
    for wheel in rover.wheels:
        # Place of the wheel on the terrain, from its place in the axes of the body: x ahead, y to the left.
        ahead, left = places[wheel.name][:2]
        wheel_x, wheel_y = x + ahead * np.cos(yaw) - left * np.sin(yaw), y + ahead * np.sin(yaw) + left * np.cos(yaw)
        for border, right_lane, left_lane in zip(terrain.borders, terrain.profiles, terrain.profiles[1:], strict=False):
            step = np.abs(left_lane.height(wheel_x) - right_lane.height(wheel_x))
            rows |= (np.abs(wheel_y - border) < float(wheel.wheel.b) / 2) & (step > MIN_LANE_STEP)
    return rows
