"""Bayes factors for the comparison of possible interpretations of a recording's columns.

A Bayes factor is the probability of the data if two signals are related, divided by the probability of the data if they
are unrelated. An interpretation of the columns implies such relations. For example, the rim speed x and the ground
speed y must be related by y = b x with b > 0. If x and y are given in n independent samples and have the correlation
coefficient rho about zero, the Bayes factor of this relation is

    (1 - rho^2)^(-n/2) n^(-1/2) 2 Phi(z),  z = rho (n / (1 - rho^2))^(1/2)

(Wagenmakers 2007, by the Bayesian information criterion). Phi is the normal distribution function; the factor 2 Phi(z)
is large if b is positive. A second factor compares b with its expected value: the expected density at b divided by the
density of an entirely unknown scale. Neighbouring samples are correlated, so the number n of samples is replaced by n
(1 - a_x a_y) / (1 + a_x a_y), where a_x and a_y are the autocorrelations of neighbouring samples (Bartlett 1946).
Logarithms of Bayes factors and priors are added. The probability that one column (for example of the clock) is right is
the summed probability of all interpretations that use this column.
"""

import math
from typing import Any

import numpy as np
from scipy.special import log_ndtr

SURE = 0.95
"""Minimum probability of an interpretation that is taken without a question. If its probability is lower, the user is
asked."""
NONE_FITS = math.log(0.05)
"""Logarithm of the prior probability that no interpretation of the columns is right. An interpretation is taken only if
its evidence against chance is large compared with this probability."""
NOT_AS_NAMED = math.log(1e-4)
"""Logarithm of the prior probability that a column with a channel's own name, such as `body_pitch`, holds something
else. Such a column is taken unless the motion of the drive contradicts it: on level ground, where the motion shows
nothing about the pitch, the name alone decides."""
LOG_SCALE_RANGE = 2.0 * math.log(1e4)
"""Width of the prior of the logarithm of an entirely unknown scale, which may lie anywhere between 1e-4 and 1e4."""
OUTLYING_SHARE = 0.1
"""Prior probability that a scale scatters around its expected value with four times the usual SD, as after much slip or
hard scrub."""


def relation(dot: Any, y: Any, x: Any, n: Any, prior: tuple[float, float] | None, free: Any = False) -> np.ndarray:
    """Return the log Bayes factor that two signals are related by y = b x with b > 0, compared with unrelated signals.

    Parameters
    ----------
    dot, y, x : float or array
        `dot` is the scalar product of both signals; `y` and `x` are their Euclidean norms.
    n : float or array
        Number of independent samples, from `independent`.
    prior : (mean, SD) or None
        Expected logarithm of b; None if b is unknown.
    free : bool or array
        Whether the scale of the signal is unknown, as for encoder counts. If True, `prior` is not used.

    Examples
    --------
    >>> float(relation(9.0, 3.0, 3.1, 50.0, None)) > 0.0
    True
    """
    # The first term is the evidence of the correlation, the second the price of the free factor b (Bayesian information
    # criterion), and `sense` adds the evidence of the positive sign.
    rho, n = _correlation(dot, y, x), np.maximum(n, 1.0)
    error = np.sqrt((1.0 - rho**2) / n)
    factor = -0.5 * n * np.log(1.0 - rho**2) - 0.5 * np.log(n) + sense(dot, y, x, n)
    if prior is not None:
        positive = np.maximum(rho, 1e-3)
        log_scale = np.log(np.maximum(positive * y / np.maximum(x, 1e-300), 1e-300))
        factor += np.where(free | (rho <= 0.0), 0.0, _log_density_ratio(log_scale, error / positive, *prior))
    # A signal that is zero throughout is no evidence for or against the relation.
    return np.asarray(np.where((x > 0.0) & (y > 0.0), factor, 0.0))


def sense(dot: Any, y: Any, x: Any, n: Any) -> np.ndarray:
    """Return the log Bayes factor that b is positive in the relation y = b x of two signals, compared with an unknown
    sign of b.

    For the arguments, see `relation`.
    """
    rho = _correlation(dot, y, x)
    factor = math.log(2.0) + log_ndtr(rho * np.sqrt(np.maximum(n, 1.0) / (1.0 - rho**2)))
    return np.asarray(np.where((x > 0.0) & (y > 0.0), factor, 0.0))


def scale_evidence(y: Any, x: Any, n: Any, prior: tuple[float, float], free: Any = False) -> np.ndarray:
    """Return the log Bayes factor that the ratio y / x of two norms has its expected value, compared with an unknown
    ratio.

    Parameters
    ----------
    y, x : float or array
        Norms of two signals; or a mean value `y` and its expected value `x`.
    n : float or array
        Number of independent samples; the measured ratio has a relative SD of 1 / sqrt(n).
    prior : (mean, SD)
        Expected logarithm of the ratio.
    free : bool or array
        Whether the scale is unknown. If True, the Bayes factor is 1, so that its logarithm is 0.
    """
    log_scale = np.log(np.maximum(y, 1e-300) / np.maximum(x, 1e-300))
    expected = _log_density_ratio(np.asarray(log_scale), 1.0 / np.sqrt(np.maximum(n, 1.0)), *prior)
    return np.where(free | (np.minimum(x, y) <= 0.0), 0.0, expected)


def _correlation(dot: Any, y: Any, x: Any) -> np.ndarray:
    """Return the correlation coefficient about zero of two signals, from their scalar product and norms, limited to
    +-0.9999.
    """
    return np.asarray(np.clip(dot / np.maximum(y * x, 1e-300), -0.9999, 0.9999))


def _log_density_ratio(log_scale: np.ndarray, error: np.ndarray, middle: float, sd: float) -> np.ndarray:
    """Return the log of the expected probability density at a measured scale divided by the density of an unknown
    scale.

    Parameters
    ----------
    log_scale, error : array
        Measured logarithm of the scale, and its SD.
    middle, sd : float
        Expected logarithm of the scale, and its SD. With the probability OUTLYING_SHARE, the SD is four times as large.
    """
    density = np.zeros_like(log_scale)
    for share, spread in ((1.0 - OUTLYING_SHARE, sd), (OUTLYING_SHARE, 4.0 * sd)):
        # The scatter of the true scale and the error of the measured one add as variances.
        wide = np.hypot(spread, error)
        density += share * np.exp(-0.5 * ((log_scale - middle) / wide) ** 2) / (wide * math.sqrt(2.0 * math.pi))
    return np.asarray(np.log(LOG_SCALE_RANGE * np.maximum(density, 1e-200)))


def independent(x: np.ndarray, y: np.ndarray) -> float:
    """Return the effective number of independent samples in two series (samples,), at least 2.

    Neighbouring samples are correlated and hold less information, so the number n of samples is reduced to n (1 - a_x
    a_y) / (1 + a_x a_y). Here a_x and a_y are the autocorrelations of neighbouring samples of both series.
    """
    # A negative autocorrelation counts as 0, so that the effective number never exceeds the number of samples.
    product = 1.0
    for series in (x, y):
        size = float(np.sum(np.abs(series) ** 2))
        neighbours = float(np.real(np.sum(series[1:] * np.conj(series[:-1])))) / size if size > 0.0 else 0.0
        product *= float(np.clip(neighbours, 0.0, 1.0))
    return max(2.0, len(x) * (1.0 - product) / (1.0 + product))


def shares(logs: np.ndarray, none_fits: float = NONE_FITS) -> np.ndarray:
    """Return the probability of each interpretation of the columns, from its log prior plus log likelihood.

    Parameters
    ----------
    logs : array
        Log prior plus log likelihood of each interpretation.
    none_fits : float
        Logarithm of the prior probability that no interpretation is right. This case takes part in the normalisation,
        so that the results add up to less than 1.
    """
    # The largest logarithm is subtracted first, so that the exponentials neither overflow nor all become 0.
    top = max(float(np.max(logs, initial=-np.inf)), none_fits, -1e6)
    weights = np.exp(logs - top)
    return np.asarray(weights / max(weights.sum() + math.exp(none_fits - top), 1e-300))


def is_settled(share: float) -> bool:
    """Return whether a choice with the probability `share` is certain enough (see SURE) to be taken without asking the
    user.
    """
    return share >= SURE


def mean_known(rows: Any) -> np.ndarray:
    """Return the mean over the first axis of an array (rows, samples), without the cells that are NaN.

    A sample that is NaN in all rows gives NaN.
    """
    return np.asarray(np.ma.masked_invalid(rows).mean(axis=0).filled(np.nan))
