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

from rover_pin.estimation.by_chance.random_field import TOLD

STEPS = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95])
"""Correlations of successive measurements that are tried."""
SURE = 10.8
"""Gain in -2 ln of the restricted likelihood from which noise drifts: chi2 of one number passes it once in 1,000."""
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
        found = np.where(good, scaled, 0.0)
        for channel, (fold, sample, memory) in enumerate(self._follows(good)):
            row = scaled[..., fold, channel, sample]
            steps = (row[..., 1:] - memory * row[..., :-1]) / np.sqrt(1 - memory**2)
            found[..., fold[1:], channel, sample[1:]] = steps
        return found

    def log_determinant(self, good: np.ndarray) -> float:
        """Return ln det of the correlations of what is compared."""
        return float(sum(np.sum(np.log1p(-(memory**2))) for _, _, memory in self._follows(good)))

    def _follows(self, good: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield of every channel folds and samples in their turn, and how each hangs on the one before."""
        for channel, rho in enumerate(self.rho):
            fold, sample = np.nonzero(good[:, channel])
            order = np.argsort(self.turn[fold, sample])
            fold, sample = fold[order], sample[order]
            yield fold, sample, rho ** np.diff(self.turn[fold, sample])


def learnt_drift(scaled: np.ndarray, free: np.ndarray, good: np.ndarray, turn: np.ndarray) -> Drift | None:
    """Return the drift of greatest restricted likelihood, or None where none is sure.

    `scaled` are residuals (folds, channels, samples) in their SDs, whose common scale is free, `free` what numbers and
    candidates move (columns, folds, channels, samples).
    """
    size = np.maximum(np.sqrt(np.sum(np.where(good, free, 0.0) ** 2, axis=(1, 2, 3), keepdims=True)), 1e-9)

    def loss(rho: np.ndarray) -> float:
        one = Drift(rho, turn)
        rows, columns = (one.innovations(each, good)[..., good] for each in (scaled, free / size))
        Q, s, _ = np.linalg.svd(columns.T, full_matrices=False)
        Q, s = Q[:, s > TOLD * s[0]], s[s > TOLD * s[0]]
        left = rows - Q @ (Q.T @ rows)
        freedom = max(len(rows) - len(s), 1)
        return float(freedom * np.log(left @ left) + 2 * np.sum(np.log(s)) + one.log_determinant(good))

    rho = np.zeros(good.shape[1])
    alone = least = loss(rho)
    for channel in [*range(len(rho))] * ROUNDS:
        tried = [np.where(np.arange(len(rho)) == channel, step, rho) for step in STEPS]
        losses = [loss(one) for one in tried]
        rho, least = tried[int(np.argmin(losses))], min(losses)
    return Drift(rho, turn, alone - least) if alone - least > SURE else None
