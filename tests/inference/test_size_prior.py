"""What is thought of amplitudes beforehand, against quadrature."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from rover_pin.inference.cause import SIZE_SD
from rover_pin.inference.size_prior import MEDIAN, log_density, log_dependence, log_size_share

ANYWHERE = (-1e3, 1e3)


def density(u):
    return np.exp(log_density(np.asarray(u, dtype=float)))


def test_sizes_have_either_sign_and_their_median():
    half = MEDIAN / SIZE_SD
    below = quad(density, 0.0, half, epsabs=1e-10)[0]
    above = quad(lambda log_u: density(np.exp(log_u)) * np.exp(log_u), np.log(half), 8.0, epsabs=1e-10)[0]
    assert below == pytest.approx(0.25, abs=1e-6)
    assert above == pytest.approx(0.25, abs=1e-6)
    assert density([-0.3]) == pytest.approx(density([0.3]))
    assert density([0.0]) < 1e-9, "no cause has no size"


@pytest.mark.parametrize("mean", [0.0, -0.05, 0.5, 1.5])
@pytest.mark.parametrize("sd", [0.02, 0.2, 0.8])
@pytest.mark.parametrize("bounds", [ANYWHERE, (0.0, 1e3), (-0.4, 0.3)])
def test_share_is_the_mean_of_the_ratio_of_densities(mean, sd, bounds):
    size = np.exp(np.linspace(-9.0, 3.0, 20001))
    whole = 0.0
    for u in (size, -size[::-1]):
        inside = (u >= bounds[0]) & (u <= bounds[1])
        ratio = density(u) * np.exp(norm.logpdf(u, mean, sd) - norm.logpdf(u))
        whole += np.trapezoid(np.where(inside, ratio, 0.0), u)
    assert np.exp(log_size_share(mean, sd, bounds)) == pytest.approx(whole, rel=0.02, abs=2e-12)


@pytest.mark.parametrize("together", [0.5, 2.0])
@pytest.mark.parametrize("correlation", [-0.97, -0.6, 0.0, 0.6])
@pytest.mark.parametrize("low", [-1e3, 0.0])
def test_sizes_known_by_their_sum_are_weighed_together(together, correlation, low):
    """The product of both ratios over their joint posterior, on a grid over its principal axes."""
    mean, sds = np.array([0.4, 0.6]) * together, np.array([0.4, 0.5])
    covariance = np.outer(sds, sds) * [[1.0, correlation], [correlation, 1.0]]
    axis = np.linspace(-7.0, 7.0, 401)
    variances, directions = np.linalg.eigh(covariance)
    z = np.array(np.meshgrid(axis, axis)).reshape(2, -1)
    u = mean[:, None] + directions * np.sqrt(variances) @ z
    ratios = np.where(u > low, density(u) / norm.pdf(u), 0.0)
    whole = float(np.prod(ratios, axis=0) @ np.prod(norm.pdf(z), axis=0)) * (axis[1] - axis[0]) ** 2
    bounds = np.array([(low, 1e3)] * 2)
    alone = sum(log_size_share(*row) for row in zip(mean, sds, bounds, strict=True))
    assert alone + log_dependence(mean, covariance, bounds) == pytest.approx(np.log(whole), abs=0.05)
