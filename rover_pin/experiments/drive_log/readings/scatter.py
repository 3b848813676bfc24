"""What a log's samples scatter about a line within each block: the floor that no model of the motion can beat."""

from collections.abc import Sequence

import numpy as np

from rover_pin.estimation.noise import MOST_MEMORY
from rover_pin.experiments.drive_log.features import BLOCK, LoggedRun

FEWEST = 5
"""Samples of a block from which their scatter about a line is estimated."""


def scatter(runs: Sequence[LoggedRun], channels: Sequence[str]) -> np.ndarray:
    """Return the SD of a block's mean (channels,) by the scatter of its samples, NaN where a block has too few.

    Samples about the line of their block are AR(1): with g_k the mean square of their differences at lag k over two,
    g_1 = s^2 (1 - rho), g_2 = s^2 (1 - rho^2), and the mean of n has the variance s^2 (1 + rho) / (1 - rho) / n.
    What moves faster than half a second counts as scatter, what drifts more slowly does not: so it is a floor.
    """
    rows = [run.measured_rows() for run in runs]
    return np.array(
        [
            _floor([(run, measured_rows[name]) for run, measured_rows in zip(runs, rows, strict=True)])
            for name in channels
        ]
    )


def _floor(rows: Sequence[tuple[LoggedRun, np.ndarray]]) -> float:
    mean_squares: list[tuple[float, float]] = []
    length = 0
    for run, row in rows:
        length = max(1, round(BLOCK / run.commands.period))
        if length < FEWEST:
            return float("nan")
        count = len(row) // length
        parts = row[: count * length].reshape(count, length)[run.usable[:count]]
        mean_squares += [_differences(part) for part in parts if np.isfinite(part).all()]
    if not mean_squares:
        return float("nan")
    g_1, g_2 = np.median(np.array(mean_squares), axis=0)
    rho = min(max(g_2 / g_1 - 1, 0.0), MOST_MEMORY) if g_1 > 0 else 0.0
    return float(np.sqrt(g_1 / (1 - rho) * (1 + rho) / (1 - rho) / length))


def _differences(part: np.ndarray) -> tuple[float, float]:
    """Return half the mean squares of differences at lags 1 and 2, about the line through a block."""
    at = np.arange(len(part)) - (len(part) - 1) / 2
    residual = part - part.mean() - at * (at @ part) / (at @ at)
    return float(np.mean(np.diff(residual) ** 2) / 2), float(np.mean((residual[2:] - residual[:-2]) ** 2) / 2)
