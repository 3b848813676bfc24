"""Evidence to second order about a fit, what is left besides and folds left out, against dense normal laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from rover_pin.estimation.columns import Columns
from rover_pin.estimation.fit import Task, fit
from rover_pin.inference.error_model import PRIORS, Discrepancy
from rover_pin.inference.expansion import Expansion
from rover_pin.inference.linear_hypothesis import linear_hypothesis, with_function
from rover_pin.inference.priors import log_share_inside
from rover_pin.inference.residual_function import (
    AMPLITUDE_NODES,
    AMPLITUDE_WEIGHTS,
    in_shares,
    rows_signal,
    smooth_functions,
    with_functions,
)
from tests.inference import linear_search as toys

SETS = (), (0,), (1, 2), (0, 1, 2)


def expansion(sd=1.0, seed=3, scale=1.0):
    """A fit with noise of one scale, or of a prior on its scale where it is declared, and three other columns."""
    experiment = toys.made("pqr", {"p": 0.6}, seed, sd=1.0)
    base = fit(Task(experiment, experiment.noise()), toys.Model(), [toys.NUMBER])
    base = replace(base, task=Task(replace(experiment, sd=sd), replace(base.task.noise, inflation=scale**2)))
    return Expansion(base, -2.0 * base.task.noise.white(np.array([experiment.columns[name] for name in "pqr"])).T)


def matrix(example, extra):
    return example.columns[:, [*range(example.own), *(example.own + at for at in extra)]]


def free(example):
    """Rows with all numbers at 0."""
    return example.fit.rows - example.columns @ example.u


def law(example, extra=(), scale=1.0, more=0.0):
    """The normal law of the rows, and its matrix."""
    A = matrix(example, extra)
    return scale**2 * np.eye(len(A)) + A @ A.T + more


def log_density(K, rows):
    """ln N(rows; 0, K) but for the constant of white noise of SD 1."""
    return multivariate_normal(np.zeros(len(K)), K).logpdf(rows) + 0.5 * len(K) * math.log(2 * math.pi)


@pytest.mark.parametrize("extra", SETS)
@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_posterior_is_that_of_the_normal_law(extra, scale):
    quadratic = expansion(None, scale=scale)
    normal_posterior, A, K = quadratic.posterior(extra), matrix(quadratic, extra), law(quadratic, extra, scale)
    pull = np.linalg.solve(K, A).T
    assert normal_posterior.log_evidence == pytest.approx(log_density(K, free(quadratic)), abs=1e-8)
    assert normal_posterior.mean == pytest.approx(-pull @ free(quadratic), abs=1e-9)
    assert normal_posterior.covariance == pytest.approx(np.eye(len(pull)) - pull @ A, abs=1e-9)


def test_a_declared_noise_is_integrated_over_its_scale():
    quadratic = expansion()
    eta = np.linspace(-5.0, 5.0, 41) * PRIORS["s"].sd
    density = norm.pdf(eta, 0.0, PRIORS["s"].sd) * (eta[1] - eta[0])
    for extra in SETS[::3]:
        full = [log_density(law(quadratic, extra, math.exp(x)), free(quadratic)) for x in eta]
        assert quadratic.posterior(extra).log_evidence == pytest.approx(
            math.log(density @ np.exp(np.array(full) - max(full))) + max(full), abs=0.01
        )


@pytest.mark.parametrize("sd", [1.0, None])
def test_a_fold_without_is_a_fit_that_never_had_it(sd):
    quadratic = replace(expansion(sd), is_optimum=False)
    good = quadratic.fit.task.noise.good.copy()
    good[2] = False
    smaller_fit = replace(
        quadratic.fit, task=replace(quadratic.fit.task, noise=replace(quadratic.fit.task.noise, good=good))
    )
    fresh = Expansion(smaller_fit, quadratic.others[quadratic.fit.task.noise.fold != 2], is_optimum=False)
    for extra in SETS:
        for left_out, never_there in zip(quadratic.posterior(extra, without=2), fresh.posterior(extra), strict=True):
            assert left_out == pytest.approx(never_there, abs=1e-8)


def test_a_stray_pulls_as_one_of_four_sd_however_far_it_is():
    quadratic = expansion(None)
    task = quadratic.fit.task

    def strayed(distant_outlier):
        observed = task.experiment.observed.copy()
        observed[1, 0, 3] += distant_outlier
        changed_task = replace(task, experiment=replace(task.experiment, observed=observed))
        return Expansion(replace(quadratic.fit, task=changed_task), quadratic.others).posterior((0,))

    close_outlier, distant_outlier = strayed(1e3), strayed(1e4)
    assert close_outlier.mean == pytest.approx(distant_outlier.mean, abs=2e-3)
    assert close_outlier.log_evidence - distant_outlier.log_evidence == pytest.approx(4.0 * 9e3, abs=1.0)


# --- what is left besides --------------------------------------------------------------------------------------------


def function(example, shared, seed=5, count=3):
    fold = example.fit.task.noise.fold
    values = 20.0 * np.random.default_rng(seed).normal(size=(len(fold), count))
    every = tuple(slice(*np.flatnonzero(fold == at)[[0, -1]] + [0, 1]) for at in range(toys.SHAPE[0]))
    runs = (slice(None),) if shared else every
    full = values if shared else np.concatenate([values * (fold == at)[:, None] for at in range(len(runs))], 1)
    return Columns(values, runs), full


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("extra", [(), (0, 1)])
def test_a_function_left_is_that_of_the_dense_law(shared, extra):
    quadratic = expansion(None, scale=1.3)
    columns, T = function(quadratic, shared)
    rows, A, plain = free(quadratic), matrix(quadratic, extra), quadratic.posterior(extra)
    (function_found,) = with_functions([(quadratic, plain)], [columns])
    amplitudes = PRIORS["a"].median * np.exp(PRIORS["a"].sd * AMPLITUDE_NODES)
    laws = [law(quadratic, extra, 1.3, a**2 * T @ T.T) for a in amplitudes]
    gains = np.array([log_density(K, rows) for K in laws]) - plain.log_evidence
    assert function_found.gain == pytest.approx(math.log(AMPLITUDE_WEIGHTS @ np.exp(gains)), abs=1e-8)
    likeliest = int(np.argmax(gains))
    pull = np.linalg.solve(laws[likeliest], A).T
    assert function_found.mean == pytest.approx(-pull @ rows, abs=1e-8)
    assert function_found.covariance == pytest.approx(np.eye(len(pull)) - pull @ A, abs=1e-8)
    acts = amplitudes[likeliest] ** 2 * T @ T.T @ np.linalg.solve(laws[likeliest], rows)
    taken = A @ (function_found.mean - plain.mean)
    assert 1.3 * function_found.rows == pytest.approx(acts - taken, abs=1e-7), "numbers without it take a part"


def test_smooth_functions_have_the_covariance_of_their_kernel():
    base = expansion().fit
    *channels, every = smooth_functions(base)
    x = np.broadcast_to(base.task.experiment.varied[:, None, :, 0], toys.SHAPE)[base.task.noise.good]
    channel = np.nonzero(base.task.noise.good)[1]
    kernel = np.exp(-0.5 * (x[:, None] - x) ** 2 / PRIORS["l"].median ** 2)
    spread = base.task.experiment.observed.std(axis=(0, 2))
    for at, columns in enumerate(channels):
        expected = spread[at] ** 2 * kernel * np.outer(channel == at, channel == at)
        assert columns.values @ columns.values.T == pytest.approx(expected, abs=0.01 * spread[at] ** 2)
    total = sum(columns.values @ columns.values.T for columns in channels)
    assert every.values @ every.values.T == pytest.approx(total)


@pytest.mark.parametrize("shared", [True, False])
def test_in_shares_a_function_moves_rows_as_the_signal_does(shared):
    quadratic = expansion()
    columns, _ = function(quadratic, shared)
    weights = np.random.default_rng(1).uniform(0.2, 1.0, len(quadratic.fit.task.noise.fold))
    blind = np.append(columns.values, columns.values[:, :1] + columns.values[:, 1:2], axis=1)
    shares = in_shares(Columns(blind, columns.runs), weights, rows_signal(quadratic.fit))
    squares = np.trace(shares.normal(weights))
    assert squares == pytest.approx(len(quadratic.fit.task.noise.fold) * rows_signal(quadratic.fit) ** 2)
    assert np.linalg.matrix_rank(shares.values[columns.runs[0]], tol=1e-6) == 3
    centred = quadratic.fit.task.experiment.observed - quadratic.fit.task.experiment.observed.mean(
        axis=(0, 2), keepdims=True
    )
    assert rows_signal(quadratic.fit) == pytest.approx(centred.std())


# --- sets of causes --------------------------------------------------------------------------------------------------


def hypothesis(example, extra):
    causes = [toys.candidate("pqr"[at]).cause for at in extra]
    return linear_hypothesis(causes, example, extra, causes)


@pytest.mark.parametrize("extra", SETS)
def test_folds_left_out_have_their_conditional_densities(extra):
    quadratic = expansion(None)
    fold_prediction, K, rows = hypothesis(quadratic, extra).fold_prediction, law(quadratic, extra), free(quadratic)
    for fold in range(toys.SHAPE[0]):
        in_fold, others = quadratic.fit.task.noise.fold == fold, quadratic.fit.task.noise.fold != fold
        expected = log_density(K, rows) - log_density(K[np.ix_(others, others)], rows[others])
        assert fold_prediction.log_density[fold] == pytest.approx(expected, abs=1e-8)
        if not extra:
            miss = rows[in_fold] - K[np.ix_(in_fold, others)] @ np.linalg.solve(K[np.ix_(others, others)], rows[others])
            assert fold_prediction.missed[fold].ravel() == pytest.approx(miss, abs=1e-8)


@pytest.mark.parametrize("extra", SETS)
def test_a_fit_that_ends_beside_its_optimum_loses_no_fold_more(extra):
    """What its slopes promise is not there, with a fold or without: steps are those from the optimum itself."""
    quadratic = expansion(None)
    off = replace(
        quadratic.fit,
        u=quadratic.fit.u + 0.2,
        predicted=quadratic.fit.predicted + 0.2 * quadratic.fit.slopes[toys.NUMBER.name],
    )
    beside = Expansion(off, quadratic.columns[:, 1:])
    assert np.ptp(beside.weights) == np.ptp(quadratic.weights) == 0.0
    for fold in range(toys.SHAPE[0]):
        steps = [
            expanded.posterior(extra, fold).mean - expanded.posterior(extra).mean for expanded in (quadratic, beside)
        ]
        assert steps[1] == pytest.approx(steps[0], abs=1e-8)


def test_numbers_stay_in_their_bounds_where_a_fold_is_left_out():
    quadratic = expansion(None)
    (u,), (number,) = quadratic.fit.u, quadratic.fit.parameters
    changed_number = replace(
        number, low=number.value(u) - 1e-4 * number.scale, high=number.value(u) + 1e-4 * number.scale
    )
    free_fit, held_fit = (
        hypothesis(
            Expansion(replace(quadratic.fit, parameters=(number_case,)), quadratic.columns[:, 1:]), ()
        ).fold_prediction.missed
        - quadratic.fit.residual
        for number_case in (number, changed_number)
    )
    slopes = np.abs(quadratic.fit.slopes[number.name])
    assert np.abs(free_fit).max() > 1e-3 * slopes.max()
    assert np.abs(held_fit) == pytest.approx(1e-4 * slopes)
    assert np.sign(held_fit).tolist() == np.sign(free_fit).tolist()


def test_what_is_not_compared_is_not_missed():
    quadratic = expansion(None)
    good = quadratic.fit.task.noise.good.copy()
    good[1, 0, 2:4] = False
    gap = replace(quadratic.fit, task=replace(quadratic.fit.task, noise=replace(quadratic.fit.task.noise, good=good)))
    assert (
        np.isnan(hypothesis(Expansion(gap, np.zeros((int(good.sum()), 0))), ()).fold_prediction.missed).tolist()
        == (~good).tolist()
    )


@pytest.mark.parametrize("extra", SETS[1:])
def test_evidence_of_a_set_has_its_sizes_prior(extra):
    quadratic = expansion(None)
    belief, plain = hypothesis(quadratic, extra), quadratic.posterior(extra)
    own_law = quadratic.own
    inside = log_share_inside(belief.causes, plain.mean[own_law:], plain.covariance[own_law:, own_law:])
    assert belief.log_evidence == pytest.approx(plain.log_evidence + inside)
    assert belief.added == belief.names == tuple("pqr"[at] for at in extra)
    assert not belief.is_fitted


def test_what_is_left_besides_changes_numbers_and_evidence():
    quadratic = expansion(None)
    belief = hypothesis(quadratic, (0,))
    (left,) = with_functions([(quadratic, belief.posterior)], [function(quadratic, True)[0]])
    more = with_function(belief, left)
    size = slice(quadratic.own, None)
    allowed = [
        log_share_inside(belief.causes, law_found.mean[size], law_found.covariance[size, size])
        for law_found in (belief.posterior, left)
    ]
    assert more.log_evidence == pytest.approx(belief.log_evidence + left.gain + allowed[1] - allowed[0])
    assert allowed[0] != allowed[1]
    assert more.moments("p.a")[0] == left.mean[quadratic.own] != belief.moments("p.a")[0]
    assert more.moments("p.a")[1] == pytest.approx(math.sqrt(left.covariance[1, 1]))
    assert more.discrepancy is Discrepancy.SMOOTH
