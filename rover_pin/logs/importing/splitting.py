"""A long recording as runs: cut where it stands or has gaps, and into parts; of many the most telling ones."""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from rover_pin.base.formula import change
from rover_pin.logs.importing.evidence import mean_known
from rover_pin.rover.rover import Rover

STANDS = 3.0
"""A stop of at least so long [s] parts two runs; what stands is left out."""
GAP, GAPS = 1.0, 10.0
"""So does a gap in the clock [s], or of this many usual steps."""
LONGEST, SHORTEST = 45.0, 8.0
"""Parts of a run are no longer, and what is shorter is left out [s]."""
WANTED = 4
"""Runs into which a short recording is cut if it can be: some are held out."""
MOVES = 0.1
"""Share of the usual fast wheel rate from which a rover drives."""
LEAD = 1.0
"""Time before a start that belongs to the run [s]."""
BLOCK = 1.0
"""Length of the blocks [s] by which parts are weighed."""


class Drive(NamedTuple):
    """What a recording shows of a drive, row by row: by this it is cut, and its parts are weighed."""

    t: np.ndarray
    rate: np.ndarray
    "mean size of the wheels' rates [rad/s]"
    speed: np.ndarray
    "[m/s] along the heading"
    rim: np.ndarray
    "mean rim speed [m/s]"
    pitch: np.ndarray
    turn: np.ndarray
    "[rad/s]"


class Part(NamedTuple):
    """Rows first to last, the last not among them."""

    first: int
    last: int


def drive_of(t: np.ndarray, values: Mapping[str, np.ndarray], rover: Rover) -> Drive:
    """Return what a file shows of the drive."""
    rates = np.array([values[f"wheel_rate_{mount.name}"] for mount in rover.wheels])
    rim = mean_known(rates * rover.radii[:, None])
    pitch = values.get("body_pitch", np.zeros(len(t)))
    turn = np.gradient(values["body_yaw"], t)
    return Drive(t, mean_known(np.abs(rates)), _along(t, values), rim, pitch, turn)


def _along(t: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the speed along the heading [m/s], over the second around each row."""
    x, y, yaw = (values[f"body_{name}"] for name in ("x", "y", "yaw"))
    finite = np.isfinite(x + y)
    dx, dy, lasts = (change(series, t, finite) for series in (x, y, t))
    return np.asarray((np.cos(yaw) * dx + np.sin(yaw) * dy) / np.maximum(lasts, 1e-6))


def parts(drive: Drive) -> list[Part]:
    """Return the parts of a recording that drive, none longer than LONGEST nor shorter than SHORTEST."""
    stretches = [part for part in _driven_stretches(drive) if _lasts(drive, part) >= SHORTEST]
    total = sum(_lasts(drive, part) for part in stretches)
    longest = min(LONGEST, max(2.0 * SHORTEST, total / WANTED))
    return [piece for part in stretches for piece in _cut_part(drive, part, longest)]


def _lasts(drive: Drive, part: Part) -> float:
    return float(drive.t[part.last - 1] - drive.t[part.first])


def _driven_stretches(drive: Drive) -> Iterator[Part]:
    """Yield the stretches between stops and gaps."""
    step = float(np.median(np.diff(drive.t)))
    fast = float(np.nanpercentile(drive.rate, 90))
    moves = np.flatnonzero(np.nan_to_num(drive.rate) > MOVES * fast)
    if not moves.size or fast <= 0.0:
        return
    stops = np.diff(drive.t[moves]) > STANDS
    late = np.flatnonzero(np.diff(drive.t) > max(GAP, GAPS * step)) + 1
    for group in np.split(moves, np.flatnonzero(stops) + 1):
        lead = int(np.searchsorted(drive.t, drive.t[group[0]] - LEAD))
        edges = [lead, *(int(at) for at in late if lead < at <= group[-1]), int(group[-1]) + 1]
        yield from (Part(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True) if b - a > 1)


def _cut_part(drive: Drive, part: Part, longest: float) -> Iterator[Part]:
    """Yield equal parts."""
    t, lasts = drive.t, _lasts(drive, part)
    count = max(1, math.ceil(lasts / longest - 0.05))
    edges = np.searchsorted(t, t[part.first] + lasts * np.arange(1, count) / count).tolist()
    ends = [part.first, *edges, part.last]
    yield from (Part(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True))


def choose_parts(candidates: list[tuple[Drive, Part]], most: int) -> list[int]:
    """Return which parts to keep, at most `most`, the most informative, in their order.

    Parts are taken one by one, each time the one that adds most to log det(sum of F^T F), F being the blocks' 1, slip,
    slip^2, sin pitch, turn, and rate, each over its own spread (D-optimal, greedy).
    """
    if len(candidates) <= most:
        return list(range(len(candidates)))
    drives = {id(drive): drive for drive, _ in candidates}
    signals = {key: _signals(drive) for key, drive in drives.items()}
    rows = _scaled_regressors(np.concatenate(list(signals.values())))
    ends = np.cumsum([0, *(len(blocks) for blocks in signals.values())])
    own_rows = {key: rows[a:b] for key, a, b in zip(signals, ends[:-1], ends[1:], strict=True)}
    grams = [
        _gram(own_rows[id(drive)][np.unique(_blocks(drive)[part.first : part.last])]) for drive, part in candidates
    ]
    have, remaining, taken = 1e-3 * np.eye(rows.shape[1]), list(range(len(candidates))), []
    for _ in range(most):
        best = max(remaining, key=lambda at: float(np.linalg.slogdet(have + grams[at])[1]))
        have = have + grams[best]
        remaining.remove(best)
        taken.append(best)
    return sorted(taken)


def _gram(rows: np.ndarray) -> np.ndarray:
    complete = rows[np.all(np.isfinite(rows), axis=1)]
    return np.asarray(complete.T @ complete)


def _blocks(drive: Drive) -> np.ndarray:
    return np.floor((drive.t - drive.t[0]) / BLOCK).astype(int)


def _signals(drive: Drive) -> np.ndarray:
    """Return slip, slip^2, sin pitch, turn and rate of all blocks (blocks, 5)."""
    at = _blocks(drive)

    def mean(values: np.ndarray) -> np.ndarray:
        finite = np.isfinite(values)
        count = np.bincount(at[finite], minlength=at[-1] + 1)
        return np.bincount(at[finite], values[finite], at[-1] + 1) / np.where(count > 0, count, np.nan)

    rim, speed = mean(drive.rim), mean(drive.speed)
    slip = np.clip((rim - speed) / np.where(np.abs(rim) > 1e-3, rim, np.nan), -1.0, 1.0)
    pitch, turn = np.nan_to_num(np.sin(mean(drive.pitch))), np.nan_to_num(mean(drive.turn))
    return np.column_stack([slip, slip**2, pitch, turn, mean(drive.rate)])


def _scaled_regressors(signals: np.ndarray) -> np.ndarray:
    """Return regressors (blocks, 6): a 1, and signals centred and over their spread."""
    spread = np.maximum(np.nanstd(signals, axis=0), 1e-9)
    return np.column_stack([np.ones(len(signals)), (signals - np.nanmean(signals, axis=0)) / spread])
