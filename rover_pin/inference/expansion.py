"""A fit and what may be missing from it, to second order: evidence where a prediction costs more than a matrix.

With rows r and columns A = dr/du about u_0, Huber's weights W and the noise's scale s, of which u ~ N(0, I) beforehand:
    -2 ln p(data, u) = huber(r) / s^2 + |u_0|^2 + 2 g'd + d'H d,  d = u - u_0,
    g = A'W r / s^2 + u_0,  H = A'W A / s^2 + I,
    ln Z = -(huber(r) / s^2 + |u_0|^2 - g'H^-1 g) / 2 - ln|H| / 2 - n ln s.
Sums are kept fold by fold, so that each can be left out.
Source: MacKay, Neural Comput. 4 (1992) 415; Miller and Dunson, J. Am. Stat. Assoc. 114 (2019) 1113, for rows that hang
together beyond the noise's model, whose likelihood counts as that of fewer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import huber_losses, huber_weights
from rover_pin.inference.error_model import PRIORS

STEPS = np.linspace(-3.0, 3.0, 13)
"""Prior SDs at which the logarithm of the noise's scale is tried."""


class Laplace(NamedTuple):
    """What the data say of some numbers: ln Z, the noise's scale, mean and covariance of u."""

    log_evidence: float
    scale: float
    mean: np.ndarray
    covariance: np.ndarray


@brief
@dataclass(frozen=True, eq=False)
class Expansion:
    """A fit, and the whitened columns (n, m) of what else may move its rows by a unit of u."""

    fit: Fit = field(repr=False)
    others: np.ndarray = field(repr=False)
    is_optimum: bool = True
    "whether the fit's own numbers are where it is best: what its slopes promise besides was tried, and is not there"

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns of the fit's own numbers, then of the others (n, numbers + m)."""
        return np.concatenate([self.fit.columns, self.others], axis=1)

    @property
    def own(self) -> int:
        """How many numbers the fit has."""
        return len(self.fit.parameters)

    @cached_property
    def u(self) -> np.ndarray:
        """Where every number stands: the fit's own, then 0."""
        return np.concatenate([self.fit.u, np.zeros(self.others.shape[1])])

    @cached_property
    def weights(self) -> np.ndarray:
        """Huber's weight of each row (n,)."""
        return huber_weights(self.fit.rows)

    @cached_property
    def weighted(self) -> np.ndarray:
        """Columns by the weight of their row, W A."""
        return self.columns * self.weights[:, None]

    @cached_property
    def sums(self) -> Sums:
        """The sums over each fold, slopes at the settled rows: a fold left out takes no promise that is not there."""
        weighted = self.weighted
        fold = self.fit.task.noise.fold
        members = [np.flatnonzero(fold == at) for at in range(len(self.fit.task.experiment.folds))]
        losses = huber_losses(self.fit.rows)
        return Sums(
            np.array([losses[at].sum() for at in members]),
            np.array([weighted[at].T @ self.settled[at] for at in members]),
            np.array([weighted[at].T @ self.columns[at] for at in members]),
            np.array([len(at) for at in members]),
        )

    @cached_property
    def whole(self) -> Sums:
        """The sums over all folds, one; at an optimum the fit's own numbers pull nowhere."""
        whole = Sums(*(part.sum(axis=0, keepdims=True) for part in self.sums))
        if self.is_optimum:
            whole.slope[0, : self.own] = -self.fit.u
        return whole

    @cached_property
    def settled(self) -> np.ndarray:
        """The rows (n,), at an optimum without what a step of the fit's own numbers still promises."""
        if not self.is_optimum:
            return self.fit.rows
        return np.asarray(self.fit.rows - self.columns[:, : self.own] @ self._own_step[0])

    @cached_property
    def _own_step(self) -> tuple[np.ndarray, float]:
        """The step of the fit's own numbers, H^-1 g, and the nats g'H^-1 g / 2 that it promises."""
        own, weighted = self.columns[:, : self.own], self.weighted[:, : self.own]
        gradient = weighted.T @ self.fit.rows + self.fit.u
        step = np.linalg.solve(weighted.T @ own + np.eye(self.own), gradient)
        return step, 0.5 * float(gradient @ step)

    @property
    def promised(self) -> float:
        """How many nats a step of the fit's own numbers still promises: none at its end, as far as it is linear."""
        return self._own_step[1]

    @property
    def scales(self) -> np.ndarray:
        """The noise's scales that are tried: by its prior where it is declared, by its inflation where it is learnt."""
        noise = self.fit.task.noise
        if self.fit.task.experiment.noise() is None:
            return np.array([math.sqrt(noise.inflation)])
        return np.asarray(math.sqrt(noise.inflation) * np.exp(PRIORS["s"].sd * STEPS))

    def of_scales(self, loss: float, count: int) -> np.ndarray:
        """Return what each of the scales adds to ln Z, but for a constant: -loss / (2 s^2) - count ln s + ln p(s)."""
        return np.asarray(-0.5 * loss / self.scales**2 - count * np.log(self.scales) + self._scale_priors)

    @property
    def _scale_priors(self) -> np.ndarray:
        """Logarithm of the prior of each of the scales; nothing for the one of noise that is learnt."""
        return -0.5 * STEPS**2 - np.logaddexp.reduce(-0.5 * STEPS**2) if len(self.scales) > 1 else np.zeros(1)

    def posterior(self, extra: Sequence[int] = (), without: int | None = None) -> Laplace:
        """Return what the data say of the fit's numbers with these of the others, perhaps without a fold."""
        at = np.array([*range(self.own), *(self.own + place for place in extra)], dtype=int)
        sums = self.whole
        if without is not None:
            sums = Sums(*(total - part[without] for total, part in zip(sums, self.sums, strict=True)))
        loss, count = float(sums.loss[0]), int(sums.rows[0])
        slope, curvature = sums.slope[0][at], sums.curvature[0][np.ix_(at, at)]
        scales = self.scales
        solved = [_laplace(loss, slope, curvature, self.u[at], count, float(scale)) for scale in scales]
        totals = np.array([row.log_evidence for row in solved]) + self._scale_priors
        best = solved[int(np.argmax(totals))]
        return best._replace(log_evidence=float(np.logaddexp.reduce(totals)))


class Sums(NamedTuple):
    """Over each fold: huber(r) (folds,), A'W r (folds, m), A'W A (folds, m, m), and how many rows."""

    loss: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    rows: np.ndarray


def _laplace(loss: float, slope: np.ndarray, curvature: np.ndarray, u: np.ndarray, count: int, scale: float) -> Laplace:
    gradient = slope / scale**2 + u
    lower = np.linalg.cholesky(curvature / scale**2 + np.eye(len(u)))
    inverse = np.linalg.inv(lower)
    covariance = inverse.T @ inverse
    gain = float(np.sum((inverse @ gradient) ** 2))
    log_evidence = -0.5 * (loss / scale**2 + float(u @ u) - gain) - float(np.log(np.diag(lower)).sum())
    return Laplace(log_evidence - count * math.log(scale), scale, u - covariance @ gradient, covariance)
