"""What is thought of amplitudes beforehand, against quadrature, and models drawn from what is believed."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.beliefs import drawn_models
from rover_pin.inference.priors import log_density, log_dependence, log_size_share

ANYWHERE = (-1e3, 1e3)


def density(u):
    return np.exp(log_density(np.asarray(u, dtype=float)))


def test_sizes_have_either_sign_and_their_median():
    half = 0.5 / 2.0
    below = quad(density, 0.0, half, epsabs=1e-10)[0]
    above = quad(lambda log_u: density(np.exp(log_u)) * np.exp(log_u), np.log(half), 8.0, epsabs=1e-10)[0]
    assert below == pytest.approx(0.25, abs=1e-6)
    assert above == pytest.approx(0.25, abs=1e-6)
    assert density([-0.3]) == pytest.approx(density([0.3]))
    assert density([0.0]) < 1e-9, "no cause has no size"
    close = quad(density, half / 2.2465, half * 2.2465, epsabs=1e-10)[0]
    assert close == pytest.approx(0.25, abs=1e-4), (
        "half of all sizes lie within a factor of exp(0.6745 1.2) of the median"
    )


@pytest.mark.parametrize("mean", [0.0, -0.05, 0.5, 1.5])
@pytest.mark.parametrize("sd", [0.02, 0.2, 0.8])
@pytest.mark.parametrize("bounds", [ANYWHERE, (0.0, 1e3), (-0.4, 0.3)])
def test_share_is_the_mean_of_the_ratio_of_densities(mean, sd, bounds):
    size = np.exp(np.linspace(-9.0, 3.0, 20001))
    full = 0.0
    for u in (size, -size[::-1]):
        inside = (u >= bounds[0]) & (u <= bounds[1])
        ratio = density(u) * np.exp(norm.logpdf(u, mean, sd) - norm.logpdf(u))
        full += np.trapezoid(np.where(inside, ratio, 0.0), u)
    assert np.exp(log_size_share(mean, sd, bounds)) == pytest.approx(full, rel=0.02, abs=2e-12)


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
    full = float(np.prod(ratios, axis=0) @ np.prod(norm.pdf(z), axis=0)) * (axis[1] - axis[0]) ** 2
    bounds = np.array([(low, 1e3)] * 2)
    alone = sum(log_size_share(*row) for row in zip(mean, sds, bounds, strict=True))
    assert alone + log_dependence(mean, covariance, bounds) == pytest.approx(np.log(full), abs=0.05)


class Row:
    """A fitted hypothesis of two numbers with a mean, an SD that may exceed the posterior's, and a correlation."""

    is_fitted = True

    def __init__(self, name, mean, sd, correlation, low=-np.inf):
        self.model, self.mean, self.sd = name, np.array(mean), np.array(sd)
        self.parameters = tuple(Parameter(letter, 0.0, 1.0, low, np.inf) for letter in "xy")
        covariance = 0.25 * np.outer(sd, sd) * np.array([[1.0, correlation], [correlation, 1.0]])
        self.posterior = SimpleNamespace(covariance=covariance)
        self.experiment = SimpleNamespace(with_values=lambda model, values: (model, values["x"], values["y"]))

    def moments(self, name):
        at = "xy".index(name)
        return self.mean[at], self.sd[at]


def believed(*rows):
    return SimpleNamespace(weights=np.array([weight for weight, _ in rows]), hypotheses=[row for _, row in rows])


def test_draws_have_the_mean_sd_and_correlation_of_the_intervals():
    draws = drawn_models(believed((1.0, Row("a", [1.0, -2.0], [0.5, 2.0], 0.8))), 6000, seed=1)
    table = np.array([draw[1:] for draw in draws])
    assert table.mean(axis=0) == pytest.approx([1.0, -2.0], abs=0.08)
    assert table.std(axis=0) == pytest.approx([0.5, 2.0], rel=0.04)
    assert np.corrcoef(table.T)[0, 1] == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("weights", [(0.5, 0.5), (0.76, 0.24), (0.1, 0.9)])
def test_each_hypothesis_comes_as_often_as_it_is_probable(weights):
    """Within one draw, as systematic resampling promises; what was only estimated comes never."""
    estimate = Row("estimate", [0, 0], [1, 1], 0.0)
    estimate.is_fitted = False
    rows = [(0.5 * weight, Row(name, [0, 0], [1, 1], 0.0)) for weight, name in zip(weights, "ab", strict=True)]
    for seed in range(5):
        names = [draw[0] for draw in drawn_models(believed(*rows, (0.5, estimate)), 8, seed)]
        assert abs(names.count("a") - 8 * weights[0]) < 1.0
        assert "estimate" not in names


def test_draws_keep_to_the_bounds_and_to_their_seed():
    beliefs = believed((1.0, Row("a", [0.1, 0.1], [1.0, 1.0], 0.0, low=0.0)))
    assert min(min(draw[1:]) for draw in drawn_models(beliefs, 200)) == 0.0
    assert drawn_models(beliefs, 5, seed=3) == drawn_models(beliefs, 5, seed=3)
    assert drawn_models(beliefs, 5, seed=3) != drawn_models(beliefs, 5, seed=4)
