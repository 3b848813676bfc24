"""The noise of a half-second mean: what samples scatter about a line within each block, and what a log declares."""

from collections.abc import Mapping, Sequence

import numpy as np

from rover_pin.estimation.noise import MOST_MEMORY
from rover_pin.experiments.drive_log.checks.driven import AT_LEAST
from rover_pin.experiments.drive_log.features import BLOCK, DRIFT, HEADING, PATH, SPEED, LoggedRun
from rover_pin.logs.declared_noise import SAMPLE_PERIOD, kind_of
from rover_pin.simulation.replay import PERIOD


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
        if length < AT_LEAST:
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


OF_FEATURES = {PATH: "body_position", DRIFT: "body_position", HEADING: "body_attitude", SPEED: "body_velocity"}


def declared_block_sd(declared: Mapping[str, float], channels: Sequence[str]) -> np.ndarray:
    """Return the SD of a feature's half-second mean (channels,) by declared SDs of samples, NaN where none is.

    Of n samples without memory the mean has sd / sqrt(n); what a way forgets of its beginning is left out.
    """
    samples = max(BLOCK / declared.get(SAMPLE_PERIOD, PERIOD), 1.0)
    kinds = [OF_FEATURES.get(name) or kind_of(name) for name in channels]
    return np.array([declared.get(kind, np.nan) for kind in kinds]) / np.sqrt(samples)
