"""The residual, measured minus predicted, and the robust chi-square (chi2) that every fit minimises.

All fits, tests of significance, tables and plots use these definitions, so that the sign of a residual and the weight
of an outlier have one definition in the whole package.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import CONFIDENCE

HUBER_THRESHOLD = 4.0
"""Largest whitened residual [SD] with a quadratic loss. Beyond this value, the loss grows linearly (Huber's loss).

Without this limit, an outlier could dominate a fit. White noise exceeds 4 SD once in 16,000 samples, so that an
ordinary sample keeps its full weight."""


def residual(measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Return measured minus predicted: positive where the model predicts too little.

    Parameters
    ----------
    measured, predicted : array
        Arrays of equal shape, usually (folds, channels, samples), in the unit of each channel. NaN stays NaN.

    Examples
    --------
    >>> residual(np.array([2.0]), np.array([1.5])).tolist()
    [0.5]
    """
    return np.asarray(measured - predicted)


def huber_weights(rows: np.ndarray) -> np.ndarray:
    """Return Huber's weight of each whitened residual (n,): 1 for an ordinary residual, and less for an outlier.

    The weight is 1 for a size up to HUBER_THRESHOLD, and HUBER_THRESHOLD / |residual| for a larger residual.

    Examples
    --------
    >>> huber_weights(np.array([0.5, 10.0])).tolist()
    [1.0, 0.4]
    """
    return np.asarray(np.minimum(1.0, HUBER_THRESHOLD / np.maximum(np.abs(rows), 1e-12)))


def huber_losses(rows: Any) -> np.ndarray:
    """Return Huber's loss of each whitened residual r: r^2 for |r| up to the threshold t = HUBER_THRESHOLD, and 2 t |r|
    - t^2 for a larger residual.

    Examples
    --------
    >>> huber_losses(np.array([0.5, 1.0, 10.0])).tolist()  # the last residual is an outlier
    [0.25, 1.0, 64.0]
    """
    size = np.abs(rows)
    return np.asarray(np.where(size > HUBER_THRESHOLD, 2 * HUBER_THRESHOLD * size - HUBER_THRESHOLD**2, size**2))


def huber(rows: Any) -> float:
    """Return the sum of Huber's losses of whitened residuals: a sum of squares with less weight for outliers.

    Examples
    --------
    >>> huber(np.array([0.5, 1.0, 10.0]))
    65.25
    """
    return float(np.sum(huber_losses(rows)))


def chi2(rows: np.ndarray, u: np.ndarray, parameters: Sequence[Parameter]) -> float:
    """Return the robust chi2 of a fit: the sum of Huber's losses of its whitened residuals, plus u^2 of every parameter
    that has a prior.

    Parameters
    ----------
    rows : array (n,)
        Whitened residuals.
    u : array (parameters,)
        Deviation of each parameter from its prior mean, in prior SDs.
    parameters : sequence of Parameter
        The parameters in the order of `u`; their attribute `prior` states which of them have a prior.
    """
    has_prior = np.array([parameter.prior for parameter in parameters], dtype=bool)
    return huber(rows) + float(np.sum(np.asarray(u)[has_prior] ** 2))


def null_gain(count: int) -> float:
    """Return the minimum decrease of chi2 by the best of `count` candidate causes that is significant.

    If no candidate acts at all, the best one exceeds this decrease with a probability of at most 1 - CONFIDENCE.
    Derivation: a candidate with two free parameters that does not act lowers chi2 by more than g with the probability
    exp(-g / 2), and Bonferroni's bound multiplies this probability by the number of candidates that were tried.

    Examples
    --------
    >>> round(null_gain(1), 1), round(null_gain(10), 1)
    (6.0, 10.6)
    """
    return 2 * math.log(max(count, 1) / (1 - CONFIDENCE))
