"""A long recording as runs: cut where it stands or has gaps, and into parts; of many the most telling ones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

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


def parts(drive: Drive) -> list[Part]:
    """Return the parts of a recording that drive, none longer than LONGEST nor shorter than SHORTEST."""
    stretches = [part for part in _driven(drive) if _lasts(drive, part) >= SHORTEST]
    total = sum(_lasts(drive, part) for part in stretches)
    longest = min(LONGEST, max(2.0 * SHORTEST, total / WANTED))
    return [piece for part in stretches for piece in _cut(drive, part, longest)]


def _lasts(drive: Drive, part: Part) -> float:
    return float(drive.t[part.last - 1] - drive.t[part.first])


def _driven(drive: Drive) -> Iterator[Part]:
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


def _cut(drive: Drive, part: Part, longest: float) -> Iterator[Part]:
    """Yield equal parts."""
    t, lasts = drive.t, _lasts(drive, part)
    count = max(1, math.ceil(lasts / longest - 0.05))
    edges = np.searchsorted(t, t[part.first] + lasts * np.arange(1, count) / count).tolist()
    ends = [part.first, *edges, part.last]
    yield from (Part(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True))


def chosen(drive: Drive, candidates: list[Part], most: int) -> list[Part]:
    """Return at most `most` parts, the most informative, in their order.

    Parts are taken one by one, each time the one that adds most to log det(sum of F^T F), F being the blocks' 1, slip,
    slip^2, sin pitch, turn, and rate, each over its own spread (D-optimal, greedy).
    """
    if len(candidates) <= most:
        return candidates
    rows = _regressors(drive)
    block = np.floor((drive.t - drive.t[0]) / BLOCK).astype(int)
    grams = [_gram(rows[np.unique(block[part.first : part.last])]) for part in candidates]
    have, remaining, taken = 1e-3 * np.eye(rows.shape[1]), list(range(len(candidates))), []
    for _ in range(most):
        best = max(remaining, key=lambda at: float(np.linalg.slogdet(have + grams[at])[1]))
        have = have + grams[best]
        remaining.remove(best)
        taken.append(best)
    return [candidates[at] for at in sorted(taken)]


def _gram(rows: np.ndarray) -> np.ndarray:
    complete = rows[np.all(np.isfinite(rows), axis=1)]
    return np.asarray(complete.T @ complete)


def _regressors(drive: Drive) -> np.ndarray:
    """Return the regressors of all blocks (blocks, 6), centred and over their spread, the first 1."""
    at = np.floor((drive.t - drive.t[0]) / BLOCK).astype(int)

    def mean(values: np.ndarray) -> np.ndarray:
        finite = np.isfinite(values)
        count = np.bincount(at[finite], minlength=at[-1] + 1)
        return np.bincount(at[finite], values[finite], at[-1] + 1) / np.where(count > 0, count, np.nan)

    rim, speed = mean(drive.rim), mean(drive.speed)
    slip = np.clip((rim - speed) / np.where(np.abs(rim) > 1e-3, rim, np.nan), -1.0, 1.0)
    signals = [
        slip,
        slip**2,
        np.nan_to_num(np.sin(mean(drive.pitch))),
        np.nan_to_num(mean(drive.turn)),
        mean(drive.rate),
    ]
    scaled = [(signal - np.nanmean(signal)) / max(float(np.nanstd(signal)), 1e-9) for signal in signals]
    return np.column_stack([np.ones(len(rim)), *scaled])
