"""Compute the noise of the half-second means of a log from the scatter of the samples or from declared SDs. The search
for missing effects (`rover_pin.loop`) compares these means with the model.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from rover_pin.estimation.noise import MAX_MEMORY
from rover_pin.experiments.drive_log.checks.run_blocks import MIN_SAMPLES
from rover_pin.experiments.drive_log.features import BLOCK, DRIFT, HEADING, PATH, SPEED, LoggedRun
from rover_pin.logs.drive_log import SAMPLE_PERIOD, kind_of
from rover_pin.simulation.replay import PERIOD

NOISE_KINDS = {PATH: "body_position", DRIFT: "body_position", HEADING: "body_attitude", SPEED: "body_velocity"}
"""Feature that is computed from several channels -> key of the log's [noise] table that states its noise."""


def scatter(runs: Sequence[LoggedRun], channels: Sequence[str]) -> np.ndarray:
    """Return the noise SD of a half-second mean for each compared feature (channels,), from the scatter of the samples.

    Within each half-second block, the residuals of the samples from their least-squares line are described as an AR(1)
    process. Let s be the SD of a sample, rho the correlation of neighbouring samples, and g_k half the mean square of
    the differences of samples at lag k. Then g_1 = s^2 (1 - rho) and g_2 = s^2 (1 - rho^2), and the mean of n samples
    has the variance s^2 (1 + rho) / (1 - rho) / n.

    Drifts that are slower than half a second do not count, so the result is a lower bound of the noise. The SD is NaN
    if a block has fewer than MIN_SAMPLES samples, or if no block is complete.
    """
    rows = [run.measured_rows() for run in runs]
    return np.array([_sd_of_mean(runs, [measured[name] for measured in rows]) for name in channels])


def _sd_of_mean(runs: Sequence[LoggedRun], rows: Sequence[np.ndarray]) -> float:
    """Return the noise SD of a half-second mean of one feature, from its samples in each run (runs, rows); see
    `scatter`.
    """
    mean_squares: list[tuple[float, float]] = []
    length = 0
    for run, row in zip(runs, rows, strict=True):
        # Too few samples in a block do not show the correlation of neighbouring samples.
        length = max(1, round(BLOCK / run.commands.period))
        if length < MIN_SAMPLES:
            return float("nan")
        count = len(row) // length
        for samples in row[: count * length].reshape(count, length)[run.usable[:count]]:
            if np.isfinite(samples).all():
                # Half the mean squares of differences at lags 1 and 2, about the line through the block.
                t = np.arange(length) - (length - 1) / 2
                residual = samples - samples.mean() - t * (t @ samples) / (t @ t)
                g_1 = float(np.mean(np.diff(residual) ** 2) / 2)
                mean_squares.append((g_1, float(np.mean((residual[2:] - residual[:-2]) ** 2) / 2)))
    if not mean_squares:
        return float("nan")
    # The median over blocks ignores the few blocks in which the signal itself changes.
    g_1, g_2 = np.median(np.array(mean_squares), axis=0)
    rho = min(max(g_2 / g_1 - 1, 0.0), MAX_MEMORY) if g_1 > 0 else 0.0
    return float(np.sqrt(g_1 / (1 - rho) * (1 + rho) / (1 - rho) / length))


def declared_block_sd(declared: Mapping[str, float], channels: Sequence[str]) -> np.ndarray:
    """Return the noise SD of a half-second mean for each compared feature (channels,), from declared SDs of single
    samples.

    `declared` maps keys of the log's [noise] table to SDs in SI. The mean of n independent samples has the SD sd /
    sqrt(n). The slow decay of summed distances (LEAK) is neglected. The result is NaN for a feature without a declared
    SD.
    """
    # Without a declared sample period, the samples are assumed to come at the period of a replay.
    samples = max(BLOCK / declared.get(SAMPLE_PERIOD, PERIOD), 1.0)
    kinds = [NOISE_KINDS.get(name) or kind_of(name) for name in channels]
    return np.array([declared.get(kind, np.nan) for kind in kinds]) / np.sqrt(samples)
