"""Priors of the inference: for the number of missing causes, for a remaining discrepancy, and for the size of a cause.

A cause that acts is assumed to have a size of the order of its default: ln(|size| / default) ~ N(ln 0.5, 1.2). Half of
all sizes then lie within a factor of 2.2 of half the default. The density vanishes at size 0, because a cause of size 0
is no cause (a non-local prior). Fits use the wider normal prior N(0, SIZE_SD) instead, because its logarithm is
quadratic. The evidence is therefore corrected afterwards: it is multiplied by the posterior mean of the ratio of the
two densities.

Source: Johnson and Rossell, J. Roy. Stat. Soc. B 72 (2010) 143, for priors that vanish at size 0.
"""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy.stats import norm, qmc

from rover_pin.estimation.parameter import bounds_of
from rover_pin.inference.cause import SIZE_SD, Cause
from rover_pin.inference.error_model import Discrepancy

DISCREPANCY_PRIORS = {
    False: {Discrepancy.NONE: 0.7, Discrepancy.SMOOTH: 0.3},
    True: {Discrepancy.NONE: 0.6, Discrepancy.FORM: 0.2, Discrepancy.SMOOTH: 0.2},
}
"""Prior probability of each kind of discrepancy that remains in addition to noise, for the base model alone (key False)
and for the base model with causes (key True).

The values are assumed: a model is more often complete than not, and an added law has an error of form as often as a
smooth discrepancy remains. The base model alone has no added law, and therefore no error of form."""
COUNT_PRIORS = 0.5, 0.3, 0.14, 0.05, 0.01
"""Prior probability that 0, 1, 2, 3 or 4 causes are missing in the model.

Each probability is divided equally among all sets with this number of causes; sets of more than 4 causes are not
considered. The values are assumed: half of all models lack nothing, and several missing effects are rarer than one."""
SIZE_MEDIAN, SIZE_LOG_SD = 0.5, 1.2
"""Prior of a cause's size relative to its default size: median of the ratio, and SD of the ratio's logarithm. A size
far from the median lowers the probability of the cause. The values are assumed: the default size of every effect is
chosen to be clearly visible, so that a typical size is somewhat smaller."""
MIN_PROBABILITY = 1e-12
"""Smallest probability that a parameter lies within its bounds. A smaller probability is raised to this value, so that
its logarithm stays finite; the value is far below every probability that a report shows."""
QUADRATURE_POINTS, QUADRATURE_SDS = 801, 8.0
"""Grid for integrals over the posterior of one size: number of points, and half of the range in posterior SDs. Beyond 8
SD a normal density is below 1e-14 of its maximum, and 801 points make 100 per 2 SD, so that the error is rounding."""
LOG2_POINTS = 12
"""Logarithm to base 2 of the number of points (4096) that integrate over the joint posterior of several sizes. The
value is assumed: more points would cost time at each hypothesis."""


def log_prior(count: int, choice: int, discrepancy: Discrepancy) -> float:
    """Return the log prior probability of one hypothesis: `count` causes out of `choice` possible causes, with a
    remaining discrepancy of the given kind.
    """
    # All sets with the same number of causes are equally probable before the data are seen.
    allowed = DISCREPANCY_PRIORS[count > 0][discrepancy]
    return math.log(COUNT_PRIORS[count] * allowed / math.comb(max(choice, count), count))


def log_inside_share(mean: float, sd: float, bounds: tuple[float, float]) -> float:
    """Return the log probability that a parameter lies within its bounds (low, high), if its coordinate u has the
    distribution N(mean, sd).
    """
    low, high = (np.array(bounds) - mean) / sd
    return math.log(max(float(norm.cdf(high) - norm.cdf(low)), MIN_PROBABILITY))


def log_size_share(mean: float, sd: float, bounds: tuple[float, float]) -> float:
    """Return the correction of the log evidence for the true prior of one size, whose posterior is u ~ N(mean, sd).

    The fit used the prior N(u; 0, 1) instead of the true prior. The correction is the log of the posterior mean of the
    ratio (true prior density of the size) / N(u; 0, 1), integrated between the `bounds` (low, high) of u.
    `log_share_inside` adds it up over all sizes.
    """
    low, high = max(bounds[0], mean - QUADRATURE_SDS * sd), min(bounds[1], mean + QUADRATURE_SDS * sd)
    if not high > low:
        return math.log(MIN_PROBABILITY)
    u = np.linspace(low, high, QUADRATURE_POINTS)
    log_ratio = _log_ratio(u)
    # The largest ratio is taken out of the exponential, so that it cannot overflow.
    mean_ratio = float(np.trapezoid(np.exp(log_ratio - log_ratio.max()) * norm.pdf(u, mean, sd), u))
    return max(math.log(max(mean_ratio, 1e-300)) + float(log_ratio.max()), math.log(MIN_PROBABILITY))


def log_dependence(mean: np.ndarray, covariance: np.ndarray, bounds: np.ndarray) -> float:
    """Return the correction of the log evidence for the correlation between several sizes; 0 if their posteriors are
    independent.

    The corrections of `log_size_share` for single sizes hold for independent sizes. Two causes that change the
    prediction alike are correlated, because the data determine only their sum. The result is the log of the joint
    posterior mean of the product of the sizes' density ratios, divided by the product of the posterior means of the
    single ratios.

    Parameters
    ----------
    mean, covariance : array (sizes,), array (sizes, sizes)
        Posterior of the sizes, in the coordinate u.
    bounds : array (sizes, 2)
        Bounds of each u.
    """
    if len(mean) < 2:
        return 0.0
    # Evenly distributed points of the joint posterior; a point outside the bounds has density 0.
    count = len(mean)
    even = _normal_points(count)
    u = mean + even @ np.linalg.cholesky(covariance).T
    inside = (u >= bounds[:, 0]) & (u <= bounds[:, 1])
    log_ratio = np.where(inside, _log_ratio(u), -math.inf)
    if not inside.all(axis=1).any():
        return 0.0
    # Mean of the product over the points, minus the product of the means: all sums are of logarithms.
    sums = np.logaddexp.reduce
    constant = (count - 1) * math.log(len(u))
    return float(sums(log_ratio.sum(axis=1)) - sums(log_ratio).sum()) + constant


def log_share_inside(causes: Sequence[Cause], mean: np.ndarray, covariance: np.ndarray) -> float:
    """Return the correction of a hypothesis's log evidence for the bounds of its causes' parameters and for the true
    prior of their sizes.

    For a parameter that only changes the shape of a cause, the correction is the log of the posterior probability that
    it lies within its bounds, divided by the prior probability. For a size, the correction is the result of
    `log_size_share`.

    Parameters
    ----------
    causes : sequence of Cause
        The causes of the hypothesis.
    mean, covariance : array (parameters,), array (parameters, parameters)
        Posterior of u for all parameters of these causes, in their order.
    """
    total, amplitudes = 0.0, []
    pairs = [(cause, parameter) for cause in causes for parameter in cause.parameters]
    for index, (cause, parameter) in enumerate(pairs):
        is_size = parameter.name in cause.amplitudes and not parameter.log
        log_share, sd = log_size_share if is_size else log_inside_share, math.sqrt(covariance[index, index])
        # The prior's own share is subtracted, so that a parameter about which the data say nothing changes nothing.
        total += log_share(float(mean[index]), sd, parameter.bounds) - log_share(0.0, 1.0, parameter.bounds)
        amplitudes += [index] if is_size else []
    # The corrections of single sizes hold for independent sizes; `log_dependence` corrects for their correlation.
    bounds = bounds_of([parameter for _, parameter in pairs])[amplitudes]
    return total + log_dependence(mean[amplitudes], covariance[np.ix_(amplitudes, amplitudes)], bounds)


@cache
def _normal_points(count: int) -> np.ndarray:
    """Return evenly distributed points (2^LOG2_POINTS, count) of a standard normal distribution in `count` dimensions
    (Sobol's sequence).
    """
    even = qmc.Sobol(count, scramble=False).random_base2(LOG2_POINTS)
    return np.asarray(norm.ppf(even + 0.5 / len(even)))


def _log_ratio(u: np.ndarray) -> np.ndarray:
    """Return the log of the ratio of the true prior density of a size at u to the density N(u; 0, 1) that
    the fit used.
    """
    return np.asarray(log_density(u) + 0.5 * u**2 + 0.5 * math.log(2 * math.pi))


def log_density(u: np.ndarray) -> np.ndarray:
    """Return the log of the true prior density of a size at the coordinate u, where u = 1 is a size of SIZE_SD default
    sizes.

    The logarithm of |size| / default is normally distributed with median ln SIZE_MEDIAN and SD SIZE_LOG_SD, and both
    signs are equally probable.
    """
    size = np.maximum(np.abs(u), 1e-300)
    # Log-normal density of |u|, halved for the two signs.
    deviation = np.log(SIZE_SD * size / SIZE_MEDIAN) / SIZE_LOG_SD
    return np.asarray(-0.5 * deviation**2 - np.log(2.0 * SIZE_LOG_SD * math.sqrt(2 * math.pi) * size))
