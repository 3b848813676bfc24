"""The evidence of a model: the probability of the data with its numbers and the scales of its errors integrated out.

With r_0 = y - f(u*) + J u* and u ~ N(0, I) beforehand the data are of N(0, C + J J'), C the covariance of the errors:
    ln Z = ln N(r_0; 0, C + J J') + ln p(eta*) + k / 2 ln 2 pi - 1 / 2 ln |H|
eta* the scales of greatest posterior density, k of them, H the curvature expected there (Laplace's approximation).
Source: MacKay, Neural Comput. 4 (1992) 415; Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), 5.
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

REACH = 4.0
"""Prior SDs within which scales are sought."""
ENOUGH = 1e-6
"""Relative fall of -ln p from step to step at which scales are taken as found: 1e-3 of 1,000."""
JITTER = 1e-10
"""Share of the noise's variance that keeps a covariance positive."""


class Linear(NamedTuple):
    """The data as a linear model has them: r_0 (n,) and the slopes J (n, numbers) by u."""

    target: np.ndarray
    slopes: np.ndarray


@brief
class Posterior(NamedTuple):
    """What the data say of the numbers of a linear model and of the scales of its errors."""

    log_evidence: float
    scales: np.ndarray
    "logarithms of the scales"
    mean: np.ndarray
    "of u (numbers,)"
    covariance: np.ndarray
    "of u (numbers, numbers)"


def posterior(errors: ErrorModel, linear: Linear, start: np.ndarray | None = None) -> Posterior:
    """Return the evidence of a linear model, its scales where their posterior is greatest."""
    eta = learnt_scales(errors, linear, errors.median if start is None else start)
    parts = _parts(errors, linear, eta)
    count = len(eta)
    information = np.diag(errors.sd**-2.0) + _expected_curvature(parts, count)
    log_evidence = -parts.loss + 0.5 * count * math.log(2 * math.pi) - 0.5 * float(np.linalg.slogdet(information)[1])
    return Posterior(log_evidence, eta, parts.mean, parts.covariance)


def _expected_curvature(parts: _Parts, count: int) -> np.ndarray:
    """Return 1/2 tr(K^-1 dK_i K^-1 dK_j), K = C + J J', for each pair of scales.

    Channels hang together by the numbers that they share: there K^-1 is -W V W', W = C^-1 J and V the covariance of u.
    """
    information = np.zeros((count, count))
    own, shared = [], []
    for block in parts.blocks:
        inverse = block.inverse(parts.covariance)
        own.append({scale: inverse @ slope for scale, slope in block.slopes.items()})
        gain = parts.covariance @ block.weighted.T
        shared.append({scale: gain @ slope @ block.weighted for scale, slope in block.slopes.items()})
    pairs = [*((moved, moved) for moved in own), *itertools.permutations(shared, 2)]
    for first, second in pairs:
        for (i, row), (j, column) in itertools.product(first.items(), second.items()):
            information[i, j] += 0.5 * float(np.sum(row * column.T))
    return information


def learnt_scales(errors: ErrorModel, linear: Linear, start: np.ndarray) -> np.ndarray:
    """Return the logarithms of the scales at which their posterior density is greatest."""
    low, high = errors.median - REACH * errors.sd, errors.median + REACH * errors.sd
    solution = minimize(
        lambda eta: negative_log(errors, linear, eta),
        np.clip(start, low, high),
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(low, high, strict=True)),
        options={"maxiter": 40, "ftol": ENOUGH},
    )
    return np.asarray(solution.x)


def negative_log(errors: ErrorModel, linear: Linear, eta: np.ndarray) -> tuple[float, np.ndarray]:
    """Return -ln N(r_0; 0, C + J J') - ln p(eta), and its gradient by eta."""
    parts = _parts(errors, linear, eta)
    gradient = (eta - errors.median) / errors.sd**2
    for block in parts.blocks:
        inverse = block.inverse(parts.covariance)
        residual = block.target - block.weighted @ parts.mean
        for scale, slope in block.slopes.items():
            gradient[scale] += 0.5 * (float(np.vdot(inverse, slope)) - float(residual @ slope @ residual))
    return parts.loss, gradient


class _Block(NamedTuple):
    """One channel: the inverse of its covariance, alone and times J and r_0, and the covariance's slopes by scale."""

    precision: np.ndarray
    slopes: dict[int, np.ndarray]
    weighted: np.ndarray
    target: np.ndarray

    def inverse(self, covariance: np.ndarray) -> np.ndarray:
        """Return the channel's block of (C + J J')^-1, `covariance` that of u."""
        return np.asarray(self.precision - self.weighted @ covariance @ self.weighted.T)


class _Parts(NamedTuple):
    loss: float
    blocks: list[_Block]
    mean: np.ndarray
    covariance: np.ndarray


def _parts(errors: ErrorModel, linear: Linear, eta: np.ndarray) -> _Parts:
    """Return -ln N - ln p(eta) with mean and covariance of u.

    Inverse and determinant are those of the channels' own covariances, updated by J (Woodbury).
    """
    blocks, quadratic, log_determinant = [], 0.0, 0.0
    count = linear.slopes.shape[1]
    normal, right = np.eye(count), np.zeros(count)
    for at, where in enumerate(errors.samples.blocks):
        covariance, slopes = errors.with_slopes(eta, at)
        covariance[np.diag_indices_from(covariance)] += JITTER * errors.samples.noise[at] ** 2
        lower = np.linalg.cholesky(covariance)
        precision, _ = dpotri(lower, lower=1)
        precision += np.tril(precision, -1).T - np.triu(precision, 1)
        weighted, target = precision @ linear.slopes[where], precision @ linear.target[where]
        normal += linear.slopes[where].T @ weighted
        right += linear.slopes[where].T @ target
        quadratic += float(linear.target[where] @ target)
        log_determinant += 2.0 * float(np.log(np.diag(lower)).sum())
        blocks.append(_Block(precision, slopes, weighted, target))
    covariance_u = np.linalg.inv(normal)
    mean = covariance_u @ right
    quadratic -= float(mean @ right)
    log_determinant += float(np.linalg.slogdet(normal)[1])
    away = (eta - errors.median) / errors.sd
    prior = 0.5 * float(away @ away) + float(np.log(errors.sd).sum()) + 0.5 * len(eta) * math.log(2 * math.pi)
    loss = 0.5 * (quadratic + log_determinant + len(linear.target) * math.log(2 * math.pi)) + prior
    return _Parts(loss, blocks, mean, covariance_u)
