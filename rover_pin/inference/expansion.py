"""Quadratic expansion of the loss about a fit, which gives the evidence of further causes without another prediction.

Symbols: r (n,) whitened residuals, A = dr/du their slopes at the fit's parameters u_0, W Huber's weights, s the noise
scale (factor on the noise), u the parameters in units of their prior SD with the prior N(0, I), n the number of
residuals. With d = u - u_0:

    -2 ln p(data, u) = huber(r) / s^2 + |u_0|^2 + 2 g'd + d'H d
    g = A'W r / s^2 + u_0,  H = A'W A / s^2 + I
    ln Z = -(huber(r) / s^2 + |u_0|^2 - g'H^-1 g) / 2 - ln|H| / 2 - n ln s

The sums over residuals are kept for each fold (group of samples left out together), so that leaving a fold out is a
subtraction. Source: MacKay, Neural Comput. 4 (1992) 415, for ln Z. Miller and Dunson, J. Am. Stat. Assoc. 114 (2019)
1113, for residuals with more correlation than the noise model has, whose likelihood counts as the likelihood of fewer
residuals.
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
from rover_pin.estimation.residual import huber_losses, huber_weights
from rover_pin.inference.error_model import PRIORS

SCALE_STEPS = np.linspace(-3.0, 3.0, 13)
"""Grid of noise scales (factors on the noise) in the sum of the evidence: values of the logarithm, in prior SDs. Beyond
3 SD the prior density is below 1.2 % of its maximum, and a finer grid changes the sum of a normal density by less than
rounding of the report."""


class Laplace(NamedTuple):
    """Laplace approximation of a posterior by a normal distribution.

    Fields: log evidence ln Z [nats], most probable noise scale (factor on the noise), and posterior mean and covariance
    of the parameters u.
    """

    log_evidence: float
    scale: float
    mean: np.ndarray
    covariance: np.ndarray


@brief
@dataclass(frozen=True, eq=False)
class Expansion:
    """Quadratic expansion of the loss around a fit, and the changes of the residuals that further causes would make.

    `posterior` computes the evidence of the fit together with selected further causes, without a new fit.
    """

    fit: Fit = field(repr=False)
    others: np.ndarray = field(repr=False)
    """change of the whitened residuals by each further cause, per unit of its size u (n, causes)"""
    is_optimum: bool = True
    """whether the fit is at the minimum of its loss. If its derivatives still predict a decrease of the loss although a
    further fit found none, this predicted decrease is not part of the expansion"""

    @cached_property
    def columns(self) -> np.ndarray:
        """Derivatives of the whitened residuals (n, parameters + causes): first by the fit's parameters u, then by the
        sizes of the further causes.
        """
        return np.concatenate([self.fit.columns, self.others], axis=1)

    @property
    def own(self) -> int:
        """Number of parameters of the fit."""
        return len(self.fit.parameters)

    @cached_property
    def u(self) -> np.ndarray:
        """Values of u around which the loss is expanded (parameters + causes,): the fitted u of the fit's parameters,
        and 0 for the size of each further cause.
        """
        return np.concatenate([self.fit.u, np.zeros(self.others.shape[1])])

    @cached_property
    def weights(self) -> np.ndarray:
        """Huber weight of each whitened residual (n,): 1, or less for an outlier."""
        return huber_weights(self.fit.rows)

    @cached_property
    def weighted(self) -> np.ndarray:
        """Derivatives of the whitened residuals (`columns`), with the row of each residual multiplied by its Huber
        weight (n, parameters + causes).
        """
        return self.columns * self.weights[:, None]

    @cached_property
    def sums(self) -> Sums:
        """Losses, gradients and curvatures summed over the residuals of each fold, so that a fold can be removed by
        subtraction.

        The gradients use the `settled` residuals. For these, the fit's parameters predict no further decrease of the
        loss.
        """
        weighted = self.weighted
        fold = self.fit.task.noise.fold
        # The columns and residuals are cut by folds, so that each fold has separate sums.
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
        """Losses, gradients and curvatures summed over the residuals of all folds.

        If the fit is at its minimum, the gradient of the whole loss (with the priors) by the fit's parameters is set to
        exactly zero.
        """
        whole = Sums(*(part.sum(axis=0, keepdims=True) for part in self.sums))
        if self.is_optimum:
            whole.slope[0, : self.own] = -self.fit.u
        return whole

    @cached_property
    def settled(self) -> np.ndarray:
        """Whitened residuals (n,) for the gradients.

        If the fit is at its minimum, these are the residuals after one more Newton step of the fit's parameters in the
        linear model. They contain no further decrease of the loss, because a further fit did not find the decrease that
        the derivatives predict. Otherwise they are the residuals of the fit.
        """
        if not self.is_optimum:
            return self.fit.rows
        return np.asarray(self.fit.rows - self.columns[:, : self.own] @ self._own_step[0])

    @cached_property
    def _own_step(self) -> tuple[np.ndarray, float]:
        """Newton step H^-1 g of the fit's parameters, and the decrease g'H^-1 g / 2 of half the loss [nats] that the
        linear model predicts for it.

        Here g is the gradient and H the curvature of half the loss by the fit's parameters.
        """
        # Normal equations of the fit's own parameters, with the prior N(0, I) in the curvature and u in the gradient.
        own, weighted = self.columns[:, : self.own], self.weighted[:, : self.own]
        gradient = weighted.T @ self.fit.rows + self.fit.u
        step = np.linalg.solve(weighted.T @ own + np.eye(self.own), gradient)
        return step, 0.5 * float(gradient @ step)

    @property
    def promised(self) -> float:
        """Decrease of half the loss [nats] that the linear model predicts for one more Newton step of the fit's
        parameters; 0 if the fit has reached its minimum.

        A large value shows that continuing the fit may still lower the loss.
        """
        return self._own_step[1]

    @property
    def scales(self) -> np.ndarray:
        """Noise scales (factors on the SD of the noise) over which the evidence is summed: a grid around the declared
        noise, or a single value if the noise was estimated from the residual.
        """
        # Noise that was learnt from the residual has no unknown scale any more; its inflation is part of the scale.
        noise = self.fit.task.noise
        if self.fit.task.experiment.noise() is None:
            return np.array([math.sqrt(noise.inflation)])
        return np.asarray(math.sqrt(noise.inflation) * np.exp(PRIORS["s"].sd * SCALE_STEPS))

    def of_scales(self, loss: float, count: int) -> np.ndarray:
        """Return the terms of the log evidence that depend on the noise scale s, one value for each scale in `scales`.

        They are -loss / (2 s^2) - count ln s + ln p(s), with the prior p(s), where `loss` is the sum of Huber's losses
        of `count` residuals.
        """
        return np.asarray(-0.5 * loss / self.scales**2 - count * np.log(self.scales) + self._scale_priors)

    @property
    def _scale_priors(self) -> np.ndarray:
        """Log prior probability of each noise scale in `scales`; 0 for the single scale of noise that was estimated
        from the residual.
        """
        return (
            -0.5 * SCALE_STEPS**2 - np.logaddexp.reduce(-0.5 * SCALE_STEPS**2) if len(self.scales) > 1 else np.zeros(1)
        )

    def posterior(self, extra: Sequence[int] = (), without: int | None = None) -> Laplace:
        """Return the posterior of the fit's parameters together with the sizes of some further causes, and its
        evidence.

        Parameters
        ----------
        extra : sequence of int
            Indices of the further causes among the columns of `others`.
        without : int, optional
            Index of a fold whose data are not used.
        """
        at = np.array([*range(self.own), *(self.own + place for place in extra)], dtype=int)
        # Leaving a fold out needs no new fit: its sums are subtracted.
        sums = self.whole
        if without is not None:
            sums = Sums(*(total - part[without] for total, part in zip(sums, self.sums, strict=True)))
        loss, count = float(sums.loss[0]), int(sums.rows[0])
        slope, curvature = sums.slope[0][at], sums.curvature[0][np.ix_(at, at)]
        # The evidence is summed over a grid of noise scales; mean and covariance are returned for the best scale.
        u, solved = self.u[at], []
        for scale in map(float, self.scales):
            # Laplace approximation. Prior and likelihood: the prior has its centre at u = 0 and unit curvature.
            gradient = slope / scale**2 + u
            lower = np.linalg.cholesky(curvature / scale**2 + np.eye(len(u)))
            inverse = np.linalg.inv(lower)
            covariance = inverse.T @ inverse
            # Decrease g'H^-1 g of the loss from the point of expansion to the minimum of the quadratic.
            gain = float(np.sum((inverse @ gradient) ** 2))
            log_evidence = -0.5 * (loss / scale**2 + float(u @ u) - gain) - float(np.log(np.diag(lower)).sum())
            log_evidence -= count * math.log(scale)
            solved.append(Laplace(log_evidence, scale, u - covariance @ gradient, covariance))
        totals = np.array([row.log_evidence for row in solved]) + self._scale_priors
        best = solved[int(np.argmax(totals))]
        return best._replace(log_evidence=float(np.logaddexp.reduce(totals)))


class Sums(NamedTuple):
    """Sums over the residuals of each fold, for the computation of the evidence.

    `loss` (folds,) is the sum of Huber's losses, `slope` (folds, m) the gradient A'W r, `curvature` (folds, m, m) the
    matrix A'W A, and `rows` (folds,) the number of residuals. A are the derivatives of the whitened residuals r by the
    m parameters of the fit and sizes of the further causes, and W are Huber's weights.
    """

    loss: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    rows: np.ndarray
