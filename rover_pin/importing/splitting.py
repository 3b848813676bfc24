"""Cut a long recording into runs at stops and gaps, and keep the most informative runs if there are too many.

The search for missing effects simulates every run hundreds of times, so runs should be short and few. Several runs are
needed, because each is predicted by a model that was fitted to the others.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from rover_pin.base.formula import change
from rover_pin.importing.evidence import mean_known
from rover_pin.rover.rover import Rover

MIN_STOP = 3.0
"""Minimum duration of a stop [s] at which a recording is cut. The stop belongs to neither of the two runs."""
MIN_GAP, MIN_GAP_STEPS = 1.0, 10.0
"""A recording is cut at a gap between two rows that is longer than MIN_GAP [s] and than MIN_GAP_STEPS times the usual
time step."""
MAX_LENGTH, MIN_LENGTH = 45.0, 8.0
"""Limits of the duration of a run [s]. A longer run is cut into several, and a shorter one is dropped."""
WANTED_RUNS = 4
"""Number of runs into which a short recording is cut if it is long enough. Several runs are needed, because each is
predicted by a model that was fitted to the others."""
MOVING_SHARE = 0.1
"""Minimum mean wheel rate of a driving rover, as a fraction of the 90th percentile of the mean wheel rate. Rows with a
lower mean wheel rate count as a stop."""
LEAD = 1.0
"""Time before the rover starts to move that is kept as part of a run [s]."""
BLOCK = 1.0
"""Duration of the blocks [s] over which the signals of a drive are averaged before the information in its runs is
compared."""


class DriveSignals(NamedTuple):
    """Signals of a recorded drive in every row (rows,). They decide where the drive is cut and which runs are kept."""

    t: np.ndarray
    rate: np.ndarray
    "mean absolute wheel rate [rad/s]"
    speed: np.ndarray
    "ground speed along the heading [m/s]"
    rim: np.ndarray
    "mean rim speed [m/s]"
    pitch: np.ndarray
    turn: np.ndarray
    "turn rate [rad/s]"


class Part(NamedTuple):
    """A run as a range of rows of its recording: from row `first` up to, but not including, row `last`."""

    first: int
    last: int


def drive_of(t: np.ndarray, values: Mapping[str, np.ndarray], rover: Rover) -> DriveSignals:
    """Return the signals for cutting a recording into runs: wheel rate, ground speed, rim speed, pitch and turn rate.

    Parameters
    ----------
    t : array (rows,)
        Time [s].
    values : mapping
        Channel -> values (rows,) in SI; body_x, body_y and body_yaw are required.
    rover : Rover
        Names and radii of the wheels. A wheel without a rate does not count in the means.
    """
    unknown = np.full(len(t), np.nan)
    rates = np.array([values.get(f"wheel_rate_{mount.name}", unknown) for mount in rover.wheels])
    x, y, yaw = (values[f"body_{name}"] for name in ("x", "y", "yaw"))
    finite = np.isfinite(x + y)
    # `change` takes differences over the second around each row, so that the speed does not amplify the tracker's
    # noise.
    dx, dy, lasts = (change(series, t, finite) for series in (x, y, t))
    speed = np.asarray((np.cos(yaw) * dx + np.sin(yaw) * dy) / np.maximum(lasts, 1e-6))
    pitch = values.get("body_pitch", np.zeros(len(t)))
    rim = mean_known(rates * rover.radii[:, None])
    return DriveSignals(t, mean_known(np.abs(rates)), speed, rim, pitch, np.gradient(yaw, t))


def parts(drive: DriveSignals) -> list[Part]:
    """Cut a recording into runs at stops and gaps, and into pieces of at most about MAX_LENGTH, and return the runs.

    A short recording is cut into about WANTED_RUNS runs, so that some of them can be held out. Stretches shorter than
    MIN_LENGTH are dropped.
    """
    # The rover moves where its wheel rate exceeds a share of the fast rates. The fast rate is the 90th percentile and
    # not the maximum, because a single spike of the rates must not hide the drive.
    step = float(np.median(np.diff(drive.t)))
    fast = float(np.nanpercentile(drive.rate, 90))
    moves = np.flatnonzero(np.nan_to_num(drive.rate) > MOVING_SHARE * fast)
    if not moves.size or fast <= 0.0:
        return []
    # Rows in motion that are more than MIN_STOP apart belong to different runs. A gap in the times separates runs too.
    # Each stretch begins LEAD seconds before the rover starts to move.
    stops = np.diff(drive.t[moves]) > MIN_STOP
    late = np.flatnonzero(np.diff(drive.t) > max(MIN_GAP, MIN_GAP_STEPS * step)) + 1
    stretches: list[Part] = []
    for group in np.split(moves, np.flatnonzero(stops) + 1):
        lead = int(np.searchsorted(drive.t, drive.t[group[0]] - LEAD))
        edges = [lead, *(int(at) for at in late if lead < at <= group[-1]), int(group[-1]) + 1]
        driven = [Part(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True) if b - a > 1]
        stretches += [part for part in driven if _duration(drive, part) >= MIN_LENGTH]
    total = sum(_duration(drive, part) for part in stretches)
    longest = min(MAX_LENGTH, max(2.0 * MIN_LENGTH, total / WANTED_RUNS))
    pieces = []
    for part in stretches:
        # The parts of a stretch have equal durations. Up to 5 % more than the maximum is not worth another cut.
        lasts = _duration(drive, part)
        count = max(1, math.ceil(lasts / longest - 0.05))
        cuts = np.searchsorted(drive.t, drive.t[part.first] + lasts * np.arange(1, count) / count).tolist()
        ends = [part.first, *cuts, part.last]
        pieces += [Part(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
    return pieces


def _duration(drive: DriveSignals, part: Part) -> float:
    """Return the duration of a run [s]."""
    return float(drive.t[part.last - 1] - drive.t[part.first])


def choose_parts(candidates: list[tuple[DriveSignals, Part]], most: int) -> list[int]:
    """Return the indices of the most informative runs in ascending order, at most `most` of them.

    The choice is a greedy D-optimal design. Runs are added one by one. Each time, the run is added that increases log
    det(sum of F^T F) most, where F is the regressor matrix of a run. The rows of F are the averages over blocks of 1,
    slip, slip^2, sin pitch, turn rate and wheel rate. All but the first are centred and divided by their SD.

    Parameters
    ----------
    candidates : list of (DriveSignals, Part)
        All runs, each with the signals of its recording.
    most : int
        Maximum number of runs.
    """
    if len(candidates) <= most:
        return list(range(len(candidates)))
    drives = {id(drive): drive for drive, _ in candidates}
    # Averages of slip, slip^2, sin pitch, turn rate and wheel rate over each block of a drive (blocks, 5). The slip is
    # NaN in a block with wheels at rest or with an unknown position.
    signals = {}
    for key, drive in drives.items():
        at, means = _blocks(drive), []
        for values in (drive.rim, drive.speed, drive.pitch, drive.turn, drive.rate):
            finite = np.isfinite(values)
            count = np.bincount(at[finite], minlength=at[-1] + 1)
            sums = np.bincount(at[finite], values[finite], at[-1] + 1)
            means.append(sums / np.where(count > 0, count, np.nan))
        # Slip is a ratio, so speeds are averaged first: a mean of ratios would be dominated by rows with slow rims.
        rim, speed, pitch, turn, rate = means
        slip = np.clip((rim - speed) / np.where(np.abs(rim) > 1e-3, rim, np.nan), -1.0, 1.0)
        sin_pitch = np.nan_to_num(np.sin(pitch))
        signals[key] = np.column_stack([slip, slip**2, sin_pitch, np.nan_to_num(turn), rate])
    table = np.concatenate(list(signals.values()))
    spread = np.maximum(np.nanstd(table, axis=0), 1e-9)
    rows = np.column_stack([np.ones(len(table)), (table - np.nanmean(table, axis=0)) / spread])
    ends = np.cumsum([0, *(len(blocks) for blocks in signals.values())])
    rows_of = {key: rows[a:b] for key, a, b in zip(signals, ends[:-1], ends[1:], strict=True)}
    # F^T F of each run is computed once; the greedy search then only adds these small matrices.
    grams = []
    for drive, part in candidates:
        of_part = rows_of[id(drive)][np.unique(_blocks(drive)[part.first : part.last])]
        complete = of_part[np.all(np.isfinite(of_part), axis=1)]
        grams.append(np.asarray(complete.T @ complete))
    # A small multiple of the unit matrix makes the first determinants finite.
    have, remaining, taken = 1e-3 * np.eye(rows.shape[1]), list(range(len(candidates))), []
    for _ in range(most):
        best = max(remaining, key=lambda at: float(np.linalg.slogdet(have + grams[at])[1]))
        have = have + grams[best]
        remaining.remove(best)
        taken.append(best)
    return sorted(taken)


def _blocks(drive: DriveSignals) -> np.ndarray:
    """Return, for each row of a drive (rows,), the number of the row's block of BLOCK seconds."""
    return np.floor((drive.t - drive.t[0]) / BLOCK).astype(int)
