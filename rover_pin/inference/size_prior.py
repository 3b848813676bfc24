"""What is thought of a size beforehand: a cause that acts has one, around the default of its effect.

ln (|size| / default) ~ N(ln 0.5, 1.2): half of all sizes lie within a factor of 2.2 of half the default, and none is
0, for a cause of no size is no cause (a non-local prior). Fits have the wider N(0, SIZE_SD) in its place; evidence is
then multiplied by the mean, over the posterior, of the one density over the other.
Source: Johnson and Rossell, J. Roy. Stat. Soc. B 72 (2010) 143, for priors that vanish at none.
"""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy.stats import norm, qmc

from rover_pin.estimation.parameter import bounds_of
from rover_pin.inference.cause import SIZE_SD, Cause

MEDIAN, SPREAD = 0.5, 1.2
"""Median of a size over its default, and SD of its logarithm. Why: defaults are plainly seen (assumed)."""
LEAST_SHARE = 1e-12
"""Least probability that a number is taken to have inside its bounds."""
POINTS, SDS = 801, 8.0
"""Points of the quadrature over a posterior, and how many of its SDs it spans on each side."""
DRAWS = 12
"""Power of 2 of the points that are spread evenly over the joint posterior of several amplitudes."""


def log_inside_share(mean: float, sd: float, bounds: tuple[float, float]) -> float:
    """Return ln of the probability that u ~ N(mean, sd) lies between the bounds."""
    low, high = (np.array(bounds) - mean) / sd
    return math.log(max(float(norm.cdf(high) - norm.cdf(low)), LEAST_SHARE))


def log_size_share(mean: float, sd: float, bounds: tuple[float, float]) -> float:
    """Return ln of the mean over u ~ N(mean, sd) of a size's density over that of N(u; 0, 1), between the bounds."""
    low, high = max(bounds[0], mean - SDS * sd), min(bounds[1], mean + SDS * sd)
    if not high > low:
        return math.log(LEAST_SHARE)
    u = np.linspace(low, high, POINTS)
    log_ratio = _log_ratio(u)
    mean_ratio = float(np.trapezoid(np.exp(log_ratio - log_ratio.max()) * norm.pdf(u, mean, sd), u))
    return max(math.log(max(mean_ratio, 1e-300)) + float(log_ratio.max()), math.log(LEAST_SHARE))


def log_dependence(mean: np.ndarray, covariance: np.ndarray, bounds: np.ndarray) -> float:
    """Return ln of the mean, over several amplitudes' u, of the product of their density ratios over that of the means.

    0 where amplitudes are independent: of two causes that do much the same only the sum may be known.
    """
    if len(mean) < 2:
        return 0.0
    u = mean + _normal_points(len(mean)) @ np.linalg.cholesky(covariance).T
    inside = (u >= bounds[:, 0]) & (u <= bounds[:, 1])
    log_ratio = np.where(inside, _log_ratio(u), -math.inf)
    if not inside.all(axis=1).any():
        return 0.0
    sums = np.logaddexp.reduce
    constant = (len(mean) - 1) * math.log(len(u))
    return float(sums(log_ratio.sum(axis=1)) - sums(log_ratio).sum()) + constant


def log_share_inside(causes: Sequence[Cause], mean: np.ndarray, covariance: np.ndarray) -> float:
    """Return the logarithm of how much more of the posterior than of the prior lies where the causes' numbers may be.

    `mean` and `covariance` are of all their numbers in turn; amplitudes have their own density.
    """
    total, amplitudes = 0.0, []
    pairs = [(cause, parameter) for cause in causes for parameter in cause.parameters]
    for at, (cause, parameter) in enumerate(pairs):
        is_size = parameter.name in cause.amplitudes and not parameter.log
        log_share, sd = log_size_share if is_size else log_inside_share, math.sqrt(covariance[at, at])
        total += log_share(float(mean[at]), sd, parameter.bounds) - log_share(0.0, 1.0, parameter.bounds)
        amplitudes += [at] if is_size else []
    bounds = bounds_of([parameter for _, parameter in pairs])[amplitudes]
    return total + log_dependence(mean[amplitudes], covariance[np.ix_(amplitudes, amplitudes)], bounds)


@cache
def _normal_points(count: int) -> np.ndarray:
    """Return points (points, count) spread evenly over N(0, I)."""
    even = qmc.Sobol(count, scramble=False).random_base2(DRAWS)
    return np.asarray(norm.ppf(even + 0.5 / len(even)))


def _log_ratio(u: np.ndarray) -> np.ndarray:
    """Return the logarithm of the density of a size's u over that of N(u; 0, 1)."""
    return np.asarray(log_density(u) + 0.5 * u**2 + 0.5 * math.log(2 * math.pi))


def log_density(u: np.ndarray) -> np.ndarray:
    """Return the logarithm of the density of a size's u, either sign alike."""
    size = np.maximum(np.abs(u), 1e-300)
    away = np.log(SIZE_SD * size / MEDIAN) / SPREAD
    return np.asarray(-0.5 * away**2 - np.log(2.0 * SPREAD * math.sqrt(2 * math.pi) * size))
