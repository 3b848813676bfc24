"""The evidence of linear models against dense matrices, central differences and quadrature."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from rover_pin.inference.error_model import Discrepancy, ErrorModel
from rover_pin.inference.evidence import Linear, negative_log, posterior
from tests.inference import linear_toy as toys

problems = st.tuples(st.integers(0, 10**6), st.sampled_from(list(Discrepancy)), st.booleans())
quick = settings(max_examples=25)
SCALES = {"s": (1.0, 0.15), "t": (0.3, 1.0), "d": (0.3, 1.0), "a": (0.05, 0.8), "e": (0.1, 0.5), "l": (0.5, 0.5)}
"""Median and SD of the logarithm of each scale of the errors, before any data."""


def made(toy, kind):
    """Error model and linear model of a toy whose numbers are N(0, 1), the last column a law's."""
    samples = toy.samples()
    rows = samples.row_of(np.array(list(toy.columns.values())))
    return ErrorModel(samples, kind, rows[-1:]), Linear(samples.value, rows.T)


def matrix(toy, errors, linear, eta):
    """C + J J' by the equation."""
    noise = toys.dense(toy, toys.scales_of(errors, eta), list(toy.columns.values())[-1:])
    return noise + linear.slopes @ linear.slopes.T


def log_prior(errors, eta):
    return sum(
        norm.logpdf(x, math.log(SCALES[letter][0]), SCALES[letter][1])
        for (letter, _), x in zip(errors.scales, eta, strict=True)
    )


def somewhere(errors, seed):
    return errors.median + errors.sd * np.random.default_rng(seed).normal(size=len(errors.scales))


@quick
@given(problems)
def test_density_of_the_data_is_that_of_the_dense_matrix(problem):
    toy = toys.random_toy(problem[0], problem[2])
    errors, linear = made(toy, problem[1])
    eta = somewhere(errors, problem[0])
    K = matrix(toy, errors, linear, eta)
    expected = multivariate_normal(np.zeros(len(K)), K).logpdf(linear.target) + log_prior(errors, eta)
    assert -negative_log(errors, linear, eta)[0] == pytest.approx(expected, rel=1e-7, abs=1e-6)


@quick
@given(problems)
def test_slopes_by_the_scales_are_central_differences(problem):
    errors, linear = made(toys.random_toy(problem[0], problem[2]), problem[1])
    eta = somewhere(errors, problem[0])
    gradient = negative_log(errors, linear, eta)[1]
    for scale, step in enumerate(1e-5 * np.eye(len(eta))):
        rise = negative_log(errors, linear, eta + step)[0] - negative_log(errors, linear, eta - step)[0]
        assert gradient[scale] == pytest.approx(rise / 2e-5, rel=1e-4, abs=1e-4)


@quick
@given(problems)
def test_numbers_are_those_of_the_dense_formula(problem):
    toy = toys.random_toy(problem[0], problem[2])
    errors, linear = made(toy, problem[1])
    posterior_found = posterior(errors, linear)
    pull = np.linalg.solve(matrix(toy, errors, linear, posterior_found.scales), linear.slopes).T
    assert posterior_found.mean == pytest.approx(pull @ linear.target, rel=1e-6, abs=1e-8)
    assert posterior_found.covariance == pytest.approx(np.eye(len(pull)) - pull @ linear.slopes, rel=1e-6, abs=1e-8)


@quick
@given(problems)
def test_scales_are_where_their_posterior_is_greatest(problem):
    errors, linear = made(toys.random_toy(problem[0], problem[2]), problem[1])
    eta = posterior(errors, linear).scales
    least, gradient = negative_log(errors, linear, eta)
    assert np.abs(gradient * errors.sd).max() < 0.05
    for move in 0.1 * np.random.default_rng(problem[0]).normal(size=(10, len(eta))) * errors.sd:
        assert negative_log(errors, linear, eta + move)[0] > least - 1e-3


@settings(quick, max_examples=8)
@given(problems)
def test_curvature_is_the_information_of_the_dense_matrix(problem):
    """H_ij = 1/2 tr(K^-1 dK_i K^-1 dK_j) + 1 / SD_i^2, K that of all channels at once."""
    toy = toys.random_toy(problem[0], problem[2])
    errors, linear = made(toy, problem[1])
    posterior_found = posterior(errors, linear)
    eta, count = posterior_found.scales, len(posterior_found.scales)
    inverse = np.linalg.inv(matrix(toy, errors, linear, eta))
    slopes = [
        (matrix(toy, errors, linear, eta + step) - matrix(toy, errors, linear, eta - step)) / 2e-5
        for step in 1e-5 * np.eye(count)
    ]
    H = np.diag(errors.sd**-2.0)
    H += [[0.5 * np.trace(inverse @ left @ inverse @ right) for right in slopes] for left in slopes]
    expected = -negative_log(errors, linear, eta)[0] + count / 2 * math.log(2 * math.pi) - np.linalg.slogdet(H)[1] / 2
    assert posterior_found.log_evidence == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("misfit", [0.5, 1.0, 1.6])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_evidence_is_the_integral_over_the_scales(seed, misfit):
    """One channel, five folds of one sample, data of `misfit` times their SD: Laplace's error stays below 0.2."""
    toy = toys.random_toy(seed, False, channels=1, folds=5, longest=1, numbers=1)
    toy.observed = misfit * toy.sd * np.random.default_rng(seed + 9).normal(size=toy.observed.shape)
    errors, linear = made(toy, Discrepancy.NONE)
    steps = [np.linspace(-5.0, 5.0, 41) * sd + median for median, sd in zip(errors.median, errors.sd, strict=True)]
    area = math.prod(step[1] - step[0] for step in steps)
    full = [-negative_log(errors, linear, np.array(eta))[0] for eta in product(*steps)]
    assert posterior(errors, linear).log_evidence == pytest.approx(logsumexp(full) + math.log(area), abs=0.2)


@quick
@given(problems)
def test_evidence_does_not_depend_on_the_order_of_samples(problem):
    seed, kind, timed = problem
    toy, draw = toys.random_toy(seed, timed), np.random.default_rng(seed)
    places, folds = draw.permutation(toy.observed.shape[2]), draw.permutation(toy.observed.shape[0])
    mixed = toys.Toy(
        toy.observed[folds][..., places],
        toy.sd[folds][..., places],
        {name: column[folds][..., places] for name, column in toy.columns.items()},
        toy.inputs[folds][:, places],
        None if toy.order is None else toy.order[folds][:, places],
    )
    assert posterior(*made(mixed, kind)).log_evidence == pytest.approx(
        posterior(*made(toy, kind)).log_evidence, abs=2e-3
    )


@quick
@given(problems, st.floats(0.01, 100.0))
def test_another_unit_adds_its_logarithm_for_each_value(problem, factor):
    seed, kind, timed = problem
    toy = toys.random_toy(seed, timed)
    unit = np.array([1.0, factor])[None, :, None]
    rescaled = toys.Toy(
        toy.observed * unit,
        toy.sd * unit,
        {name: column * unit for name, column in toy.columns.items()},
        toy.inputs,
        toy.order,
    )
    least = np.isfinite(toy.observed[:, 1]).sum() * math.log(factor)
    (errors, before), (_, after) = made(toy, kind), made(rescaled, kind)
    eta = somewhere(errors, seed)
    rise = negative_log(made(rescaled, kind)[0], after, eta)[0] - negative_log(errors, before, eta)[0]
    assert rise == pytest.approx(least, abs=1e-6), "at the same scales"
    fall = posterior(errors, before).log_evidence - posterior(made(rescaled, kind)[0], after).log_evidence
    assert fall == pytest.approx(least, abs=3e-2), "where the search for scales ends depends on the size of -ln p"


@quick
@given(problems, st.floats(-100.0, 100.0))
def test_evidence_does_not_change_by_a_shift(problem, shift):
    """Neither of what is measured and predicted alike, nor of what was set, nor by its unit."""
    seed, kind, timed = problem
    toy = toys.random_toy(seed, timed)
    errors, linear = made(toy, kind)
    toy.observed = toy.observed + shift
    toy.inputs = 7.0 * toy.inputs + shift
    shifted, _ = made(toy, kind)
    away = Linear(shifted.samples.value - shift, linear.slopes)
    assert posterior(shifted, away).log_evidence == pytest.approx(posterior(errors, linear).log_evidence, abs=2e-3)
