"""Errors on data that were not fitted: every level predicted by a fit to the others."""

from __future__ import annotations

import numpy as np

from rover_pin.discrepancy.held_out import ChannelScore, LevelError
from rover_pin.errors import OptimisationError
from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.experiments.wheel_rig.fit import STRAY, RigFit, fit_from

DRAWS = 2000
"""Resamplings of the bootstrap."""

LOST = 1e3
"""Residual [SD] that stands for a level that the fit to the others cannot predict at all."""


def held_out(data: RigSet, fit: RigFit) -> np.ndarray:
    """Return residuals over their stated SD [channels, runs], each level predicted without itself.

    A level that the fit to the others does not predict counts as `LOST`.
    """
    residual = np.full(fit.residual.shape, np.nan)
    for number in range(len(data.level_names)):
        left_out = data.level == number
        refit = without_level(fit, ~left_out)
        if refit is not None:
            residual[:, left_out] = refit.residual[:, left_out]
    return np.where(np.isfinite(residual), residual, LOST)


def without_level(fit: RigFit, keep: np.ndarray) -> RigFit | None:
    """Return the refit to the runs `keep` [runs] from the fit to all, or None where there is none."""
    try:
        return fit_from(fit.problem.keeping(keep), [fit.u])
    except OptimisationError:
        return None


def loss(residual: np.ndarray) -> float:
    """Return the mean robust loss of residuals in SDs: 1 is the noise."""
    size = np.abs(residual)
    return float(np.mean(np.where(size > STRAY, 2 * STRAY * size - STRAY**2, size**2)))


def scores(data: RigSet, before: np.ndarray, after: np.ndarray, seed: int) -> tuple[ChannelScore, ...]:
    """Return held-out RMSE per channel before and after, with a bootstrap over levels of the paired change."""
    levels = len(data.level_names)
    draws = np.random.default_rng(seed).integers(0, levels, (DRAWS, levels))
    found = []
    for row, channel in enumerate(data.rig.channels):
        floor = float(np.sqrt(np.mean(channel.sd**2)))
        square = [(residual[row] * channel.sd) ** 2 for residual in (before, after)]
        sums = [np.bincount(data.level, part, levels) for part in square]
        ratio = np.sqrt(sums[1][draws].sum(axis=1) / np.maximum(sums[0][draws].sum(axis=1), 1e-300)) - 1
        was, now = (float(np.sqrt(np.mean(part))) for part in square)
        low, high = np.quantile(ratio, [0.025, 0.975])
        root = [np.sqrt(part / np.bincount(data.level, minlength=levels)) for part in sums]
        each = tuple(LevelError(*row) for row in zip(data.level_names, *(part.tolist() for part in root), strict=True))
        change = (now / was - 1, float(low), float(high))
        found.append(ChannelScore(channel.name, channel.unit, floor, was, now, *change, each))
    return tuple(found)
