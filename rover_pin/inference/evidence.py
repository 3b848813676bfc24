"""The evidence of a hypothesis: the probability of the data with all parameters and all scales of the errors integrated
out.

Symbols: y (n,) the data, f(u) the prediction, u (parameters,) the parameters in units of their prior SD, with the prior
u ~ N(0, I), J = df/du the slopes of the prediction, C the covariance of the errors (`error_model.py`), eta the
logarithms of its scales. With r_0 = y - f(u*) + J u*, the linear model about u* gives r_0 ~ N(0, C + J J'), so that

    ln Z = ln N(r_0; 0, C + J J') + ln p(eta*) + k / 2 ln 2 pi - 1 / 2 ln |H|

where eta* are the k values of eta with the largest posterior density, and H is the expected curvature of its negative
logarithm there (Laplace's approximation). Source: MacKay, Neural Comput. 4 (1992) 415; Rasmussen and Williams, Gaussian
Processes for Machine Learning (2006), 5.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpotri
from scipy.optimize import minimize

from rover_pin.base.public import brief
from rover_pin.inference.error_model import ErrorModel

MAX_SCALE_SDS = 4.0
"""Half the range of the search for the scales of the errors, in prior SDs around the prior median. Beyond 4 SD the
prior density is below 0.04 % of its maximum, so that the search would only waste time there."""
SEARCH_TOLERANCE = 1e-6
"""Relative decrease of the negative log posterior at which the search for the scales ends. For a value of 1,000 the
error is then about 0.001 nats, far below the differences between hypotheses that matter."""
JITTER = 1e-10
"""Fraction of the noise variance that is added to the diagonal of each covariance matrix of the errors. Without this
addition, rounding could make a covariance indefinite, and its Cholesky factor would fail. It changes no result
visibly."""


class Linear(NamedTuple):
    """Linear model of n measured values y around a point u* of the parameters: y = f(u*) + J (u - u*) + error, with the
    prediction f.

    `slopes` is J = df/du (n, parameters). `target` (n,) is r_0 = y - f(u*) + J u*, which the linear model predicts as J
    u.
    """

    target: np.ndarray
    slopes: np.ndarray


@brief
class Posterior(NamedTuple):
    """Result of the inference with a linear model: the log evidence, the most probable scales of the errors, and the
    posterior of the parameters u.
    """

    log_evidence: float
    """natural logarithm of the evidence [nats]"""
    scales: np.ndarray
    """most probable logarithms eta of the scales of the errors (scales,)"""
    mean: np.ndarray
    """posterior mean of u (parameters,)"""
    covariance: np.ndarray
    """posterior covariance of u (parameters, parameters)"""


def posterior(errors: ErrorModel, linear: Linear, start: np.ndarray | None = None) -> Posterior:
    """Compute the evidence of a linear model, and the posterior of its parameters at the most probable scales of the
    errors.

    Parameters
    ----------
    errors : ErrorModel
        Covariance of the errors as a function of eta, the logarithms of the scales of the errors.
    linear : Linear
        The linear model of the data.
    start : array (scales,), optional
        Start of the search for eta; by default the prior median.
    """
    # First the scales at the maximum of their posterior, then the integral over the scales by Laplace's approximation.
    eta = learnt_scales(errors, linear, errors.median if start is None else start)
    parts = _parts(errors, linear, eta)
    count = len(eta)
    # Curvature of the negative log posterior of the scales: that of the prior plus the expected one of the likelihood.
    # The expected curvature has the element 1/2 tr(K^-1 dK_i K^-1 dK_j) for the scales i and j, with K = C + J J', the
    # covariance C of the errors and the derivatives J of the prediction by u. Blocks of samples are correlated through
    # the parameters that they share: between two blocks, K^-1 is -W V W', with W = C^-1 J and the posterior covariance
    # V of u.
    expected = np.zeros((count, count))
    # within: both derivatives in one block. between: derivatives in two blocks, coupled by the shared parameters.
    within, between = [], []
    for block in parts.blocks:
        inverse = block.inverse(parts.covariance)
        within.append({scale: inverse @ slope for scale, slope in block.slopes.items()})
        gain = parts.covariance @ block.weighted.T
        between.append({scale: gain @ slope @ block.weighted for scale, slope in block.slopes.items()})
    # A block is paired with itself by `within`, and with every other block by `between`.
    pairs = [*((products, products) for products in within), *itertools.permutations(between, 2)]
    for first, second in pairs:
        for (i, row), (j, column) in itertools.product(first.items(), second.items()):
            expected[i, j] += 0.5 * float(np.sum(row * column.T))
    information = np.diag(errors.sd**-2.0) + expected
    log_evidence = -parts.loss + 0.5 * count * math.log(2 * math.pi) - 0.5 * float(np.linalg.slogdet(information)[1])
    return Posterior(log_evidence, eta, parts.mean, parts.covariance)


def learnt_scales(errors: ErrorModel, linear: Linear, start: np.ndarray) -> np.ndarray:
    """Return the most probable logarithms of the scales of the errors (scales,), for a linear model of the data.

    The search starts from `start` (scales,) and minimises `negative_log`.
    """
    low, high = errors.median - MAX_SCALE_SDS * errors.sd, errors.median + MAX_SCALE_SDS * errors.sd
    # The gradient is exact; the bounds keep the search within MAX_SCALE_SDS of the prior medians.
    solution = minimize(
        lambda eta: negative_log(errors, linear, eta),
        np.clip(start, low, high),
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(low, high, strict=True)),
        options={"maxiter": 40, "ftol": SEARCH_TOLERANCE},
    )
    return np.asarray(solution.x)


def negative_log(errors: ErrorModel, linear: Linear, eta: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the negative log posterior density of eta, the logarithms of the scales of the errors, and its gradient
    (scales,).

    `learnt_scales` minimises this function. Its value is -ln N(r_0; 0, C + J J') - ln p(eta), with the target r_0 and
    the slopes J of the linear model, and the covariance C of the errors for eta.
    """
    parts = _parts(errors, linear, eta)
    # Gradient of the prior, then of the likelihood: tr(K^-1 dC) / 2 minus the quadratic form of K^-1 r in dC, block by
    # block.
    gradient = (eta - errors.median) / errors.sd**2
    for block in parts.blocks:
        inverse = block.inverse(parts.covariance)
        residual = block.target - block.weighted @ parts.mean
        for scale, slope in block.slopes.items():
            gradient[scale] += 0.5 * (float(np.vdot(inverse, slope)) - float(residual @ slope @ residual))
    return parts.loss, gradient


class _Block(NamedTuple):
    """Matrices of one block of samples, with the covariance C of its errors, and the slopes J and the target r_0 of the
    linear model.

    `precision` is C^-1, `weighted` is C^-1 J, and `target` is C^-1 r_0. `slopes` holds the derivatives of C by the
    logarithms of the scales, by the index of the scale.
    """

    precision: np.ndarray
    slopes: dict[int, np.ndarray]
    weighted: np.ndarray
    target: np.ndarray

    def inverse(self, covariance: np.ndarray) -> np.ndarray:
        """Return the part of (C + J J')^-1 that belongs to this block alone (m, m), where `covariance` is the posterior
        covariance of the parameters u.
        """
        return np.asarray(self.precision - self.weighted @ covariance @ self.weighted.T)


class _Parts(NamedTuple):
    """Result of one evaluation of eta (the logarithms of the scales): its negative log posterior density (`loss`), the
    matrices of each block, and the posterior mean and covariance of the parameters u.
    """

    loss: float
    blocks: list[_Block]
    mean: np.ndarray
    covariance: np.ndarray


def _parts(errors: ErrorModel, linear: Linear, eta: np.ndarray) -> _Parts:
    """Evaluate eta, the logarithms of the scales: compute its negative log posterior density, and the posterior of the
    parameters u for this eta.

    The inverse and the determinant of C + J J' (covariance C of the errors, slopes J) are computed from the inverse and
    the determinant of each block of C by Woodbury's identity, which avoids the inverse of an (n, n) matrix.
    """
    blocks, quadratic, log_determinant = [], 0.0, 0.0
    count = linear.slopes.shape[1]
    normal, right = np.eye(count), np.zeros(count)
    # Given the parameters, the blocks are independent, so each covariance is inverted alone (Cholesky).
    for at, where in enumerate(errors.samples.blocks):
        covariance, slopes = errors.with_slopes(eta, at)
        covariance[np.diag_indices_from(covariance)] += JITTER * errors.samples.noise[at] ** 2
        lower = np.linalg.cholesky(covariance)
        # LAPACK fills the lower triangle of the inverse only; the upper triangle is mirrored.
        precision, _ = dpotri(lower, lower=1)
        precision += np.tril(precision, -1).T - np.triu(precision, 1)
        weighted, target = precision @ linear.slopes[where], precision @ linear.target[where]
        normal += linear.slopes[where].T @ weighted
        right += linear.slopes[where].T @ target
        quadratic += float(linear.target[where] @ target)
        log_determinant += 2.0 * float(np.log(np.diag(lower)).sum())
        blocks.append(_Block(precision, slopes, weighted, target))
    # Integrate out the parameters: posterior of u, and Woodbury's correction of the quadratic form and determinant.
    covariance_u = np.linalg.inv(normal)
    mean = covariance_u @ right
    quadratic -= float(mean @ right)
    log_determinant += float(np.linalg.slogdet(normal)[1])
    away = (eta - errors.median) / errors.sd
    prior = 0.5 * float(away @ away) + float(np.log(errors.sd).sum()) + 0.5 * len(eta) * math.log(2 * math.pi)
    loss = 0.5 * (quadratic + log_determinant + len(linear.target) * math.log(2 * math.pi)) + prior
    return _Parts(loss, blocks, mean, covariance_u)


class FoldPrediction(NamedTuple):
    """Prediction of each fold (group of samples left out together) from the data of all other folds."""

    log_density: np.ndarray
    """log probability density of each fold's data, given the data of the other folds (folds,) [nats]"""
    missed: np.ndarray
    """held-out residual: measured minus predicted values (folds, channels, samples), or (n,) for samples in
    one vector"""


def predict_folds(covariance: np.ndarray, linear: Linear, fold: np.ndarray) -> FoldPrediction:
    """Predict every fold from the other folds without a refit, and return the log densities and the held-out residuals.

    `covariance` C (n, n) is the covariance of the errors, `linear` has the slopes J and the target r, and `fold` (n,)
    is the index of each sample's fold. With Q = (C + J J')^-1, the other folds predict the samples b of a fold as N(r_b
    - Q_bb^-1 (Q r)_b, Q_bb^-1). The held-out residual `missed` (n,) is therefore Q_bb^-1 (Q r)_b. Source: Rasmussen and
    Williams, Gaussian Processes for Machine Learning (2006), section 5.4.2.
    """
    precision = np.linalg.inv(covariance + linear.slopes @ linear.slopes.T)
    # One inverse of the whole covariance serves every fold.
    pull = precision @ linear.target
    density, missed = np.zeros(int(fold.max()) + 1), np.zeros(len(fold))
    for at in range(len(density)):
        members = np.flatnonzero(fold == at)
        if not members.size:
            continue
        block = precision[np.ix_(members, members)]
        missed[members] = np.linalg.solve(block, pull[members])
        density[at] = 0.5 * (
            np.linalg.slogdet(block)[1] - float(missed[members] @ pull[members]) - len(members) * math.log(2 * math.pi)
        )
    return FoldPrediction(density, missed)
