"""Noise that drifts from one measurement to the next: AR(1) in the order in which samples were measured.

Samples of one channel at turns t and t' have the correlation rho^|t - t'|, the SDs that are declared. A sample depends
on those before through the last of them only, also where some are not compared, so that
e_t = (r_t - rho^g r_(t - g)) / sqrt(1 - rho^(2 g)) is white, g turns after the last.
Source: Box and Jenkins, Time Series Analysis (1970); restricted likelihood: Harville, JASA 72 (1977) 320.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from rover_pin.estimation.random_effects.random_field import spanning

STEPS = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95])
"""Correlations of successive measurements that are tried."""
RARE = 1e-3
"""Share of white noises that may seem to drift: the gain in -2 ln of the restricted likelihood is then chi2 of as many
numbers as there are channels, at most, for a correlation is not looked for below 0."""
ROUNDS = 2
"""How often each channel's correlation is sought, the others as they are."""


@dataclass(frozen=True, eq=False)
class Drift:
    """The correlation `rho` (channels,) of successive measurements, and the `turn` (folds, samples) of each."""

    rho: np.ndarray
    turn: np.ndarray = field(repr=False)
    gain: float = 0.0
    "fall of -2 ln of the restricted likelihood against noise that does not drift"

    def innovations(self, scaled: np.ndarray, good: np.ndarray) -> np.ndarray:
        """Return residuals (..., folds, channels, samples) in their SDs without what they share with those before."""
        whitened = np.where(good, scaled, 0.0)
        for channel, (fold, sample, memory) in enumerate(self._follows(good)):
            row = scaled[..., fold, channel, sample]
            steps = (row[..., 1:] - memory * row[..., :-1]) / np.sqrt(1 - memory**2)
            whitened[..., fold[1:], channel, sample[1:]] = steps
        return whitened

    def log_determinant(self, good: np.ndarray) -> float:
        """Return ln det of the correlations of what is compared."""
        return float(sum(np.sum(np.log1p(-(memory**2))) for _, _, memory in self._follows(good)))

    def _follows(self, good: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield of every channel folds and samples in their turn, and how each depends on the one before."""
        for channel, rho in enumerate(self.rho):
            fold, sample = np.nonzero(good[:, channel])
            order = np.argsort(self.turn[fold, sample])
            fold, sample = fold[order], sample[order]
            yield fold, sample, rho ** np.diff(self.turn[fold, sample])


def learnt_drift(scaled: np.ndarray, free: np.ndarray, good: np.ndarray, turn: np.ndarray) -> Drift | None:
    """Return the drift of greatest restricted likelihood, channel by channel in turn, or None where none is sure.

    `scaled` are residuals (folds, channels, samples) in their SDs, whose common scale is free, `free` what numbers and
    candidates move (columns, folds, channels, samples).
    """
    free_basis = spanning(free[:, good].T)  # once for all correlations: another rank would be no likelihood
    basis = np.zeros((free_basis.shape[1], *good.shape))
    basis[:, good] = free_basis.T

    def loss(rho: np.ndarray) -> float:
        drift = Drift(rho, turn)
        rows, columns = (drift.innovations(values, good)[..., good] for values in (scaled, basis))
        Q, s, _ = np.linalg.svd(columns.T, full_matrices=False)
        unexplained = rows - Q @ (Q.T @ rows)
        freedom = max(len(rows) - len(s), 1)
        return float(freedom * np.log(unexplained @ unexplained) + 2 * np.sum(np.log(s)) + drift.log_determinant(good))

    rho = np.zeros(good.shape[1])
    alone = least = loss(rho)
    for channel in [*range(len(rho))] * ROUNDS:
        tried = [np.where(np.arange(len(rho)) == channel, step, rho) for step in STEPS]
        losses = [loss(trial_rho) for trial_rho in tried]
        rho, least = tried[int(np.argmin(losses))], min(losses)
    return Drift(rho, turn, alone - least) if alone - least > chi2.isf(RARE, len(rho)) else None
