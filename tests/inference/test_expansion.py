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


def matrix(made, extra):
    return made.columns[:, [*range(made.own), *(made.own + at for at in extra)]]


def free(made):
    """Rows with all numbers at 0."""
    return made.fit.rows - made.columns @ made.u


def law(made, extra=(), scale=1.0, more=0.0):
    """The normal law of the rows, and its matrix."""
    A = matrix(made, extra)
    return scale**2 * np.eye(len(A)) + A @ A.T + more


def log_density(K, rows):
    """ln N(rows; 0, K) but for the constant of white noise of SD 1."""
    return multivariate_normal(np.zeros(len(K)), K).logpdf(rows) + 0.5 * len(K) * math.log(2 * math.pi)


@pytest.mark.parametrize("extra", SETS)
@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_posterior_is_that_of_the_normal_law(extra, scale):
    made = expansion(None, scale=scale)
    found, A, K = made.posterior(extra), matrix(made, extra), law(made, extra, scale)
    pull = np.linalg.solve(K, A).T
    assert found.log_evidence == pytest.approx(log_density(K, free(made)), abs=1e-8)
    assert found.mean == pytest.approx(-pull @ free(made), abs=1e-9)
    assert found.covariance == pytest.approx(np.eye(len(pull)) - pull @ A, abs=1e-9)


def test_a_declared_noise_is_integrated_over_its_scale():
    made = expansion()
    eta = np.linspace(-5.0, 5.0, 41) * PRIORS["s"].sd
    density = norm.pdf(eta, 0.0, PRIORS["s"].sd) * (eta[1] - eta[0])
    for extra in SETS[::3]:
        whole = [log_density(law(made, extra, math.exp(x)), free(made)) for x in eta]
        assert made.posterior(extra).log_evidence == pytest.approx(
            math.log(density @ np.exp(np.array(whole) - max(whole))) + max(whole), abs=0.01
        )


@pytest.mark.parametrize("sd", [1.0, None])
def test_a_fold_without_is_a_fit_that_never_had_it(sd):
    made = replace(expansion(sd), is_optimum=False)
    good = made.fit.task.noise.good.copy()
    good[2] = False
    rest = replace(made.fit, task=replace(made.fit.task, noise=replace(made.fit.task.noise, good=good)))
    fresh = Expansion(rest, made.others[made.fit.task.noise.fold != 2], is_optimum=False)
    for extra in SETS:
        for one, other in zip(made.posterior(extra, without=2), fresh.posterior(extra), strict=True):
            assert one == pytest.approx(other, abs=1e-8)


def test_a_stray_pulls_as_one_of_four_sd_however_far_it_is():
    made = expansion(None)
    task = made.fit.task

    def strayed(far):
        observed = task.experiment.observed.copy()
        observed[1, 0, 3] += far
        moved = replace(task, experiment=replace(task.experiment, observed=observed))
        return Expansion(replace(made.fit, task=moved), made.others).posterior((0,))

    near, far = strayed(1e3), strayed(1e4)
    assert near.mean == pytest.approx(far.mean, abs=2e-3)
    assert near.log_evidence - far.log_evidence == pytest.approx(4.0 * 9e3, abs=1.0)


# --- what is left besides --------------------------------------------------------------------------------------------


def function(made, shared, seed=5, count=3):
    fold = made.fit.task.noise.fold
    values = 20.0 * np.random.default_rng(seed).normal(size=(len(fold), count))
    every = tuple(slice(*np.flatnonzero(fold == at)[[0, -1]] + [0, 1]) for at in range(toys.SHAPE[0]))
    runs = (slice(None),) if shared else every
    whole = values if shared else np.concatenate([values * (fold == at)[:, None] for at in range(len(runs))], 1)
    return Columns(values, runs), whole


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("extra", [(), (0, 1)])
def test_a_function_left_is_that_of_the_dense_law(shared, extra):
    made = expansion(None, scale=1.3)
    columns, T = function(made, shared)
    rows, A, plain = free(made), matrix(made, extra), made.posterior(extra)
    (found,) = with_functions([(made, plain)], [columns])
    amplitudes = PRIORS["a"].median * np.exp(PRIORS["a"].sd * AMPLITUDE_NODES)
    laws = [law(made, extra, 1.3, a**2 * T @ T.T) for a in amplitudes]
    gains = np.array([log_density(K, rows) for K in laws]) - plain.log_evidence
    assert found.gain == pytest.approx(math.log(AMPLITUDE_WEIGHTS @ np.exp(gains)), abs=1e-8)
    likeliest = int(np.argmax(gains))
    pull = np.linalg.solve(laws[likeliest], A).T
    assert found.mean == pytest.approx(-pull @ rows, abs=1e-8)
    assert found.covariance == pytest.approx(np.eye(len(pull)) - pull @ A, abs=1e-8)
    acts = amplitudes[likeliest] ** 2 * T @ T.T @ np.linalg.solve(laws[likeliest], rows)
    taken = A @ (found.mean - plain.mean)
    assert 1.3 * found.rows == pytest.approx(acts - taken, abs=1e-7), "numbers without it take a part"


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
    made = expansion()
    columns, _ = function(made, shared)
    weights = np.random.default_rng(1).uniform(0.2, 1.0, len(made.fit.task.noise.fold))
    blind = np.append(columns.values, columns.values[:, :1] + columns.values[:, 1:2], axis=1)
    found = in_shares(Columns(blind, columns.runs), weights, rows_signal(made.fit))
    squares = np.trace(found.normal(weights))
    assert squares == pytest.approx(len(made.fit.task.noise.fold) * rows_signal(made.fit) ** 2)
    assert np.linalg.matrix_rank(found.values[columns.runs[0]], tol=1e-6) == 3
    centred = made.fit.task.experiment.observed - made.fit.task.experiment.observed.mean(axis=(0, 2), keepdims=True)
    assert rows_signal(made.fit) == pytest.approx(centred.std())


# --- sets of causes --------------------------------------------------------------------------------------------------


def hypothesis(made, extra):
    causes = [toys.candidate("pqr"[at]).cause for at in extra]
    return linear_hypothesis(causes, made, extra, causes)


@pytest.mark.parametrize("extra", SETS)
def test_folds_left_out_have_their_conditional_densities(extra):
    made = expansion(None)
    found, K, rows = hypothesis(made, extra).fold_prediction, law(made, extra), free(made)
    for fold in range(toys.SHAPE[0]):
        own, others = made.fit.task.noise.fold == fold, made.fit.task.noise.fold != fold
        expected = log_density(K, rows) - log_density(K[np.ix_(others, others)], rows[others])
        assert found.log_density[fold] == pytest.approx(expected, abs=1e-8)
        if not extra:
            miss = rows[own] - K[np.ix_(own, others)] @ np.linalg.solve(K[np.ix_(others, others)], rows[others])
            assert found.missed[fold].ravel() == pytest.approx(miss, abs=1e-8)


@pytest.mark.parametrize("extra", SETS)
def test_a_fit_that_ends_beside_its_optimum_loses_no_fold_more(extra):
    """What its slopes promise is not there, with a fold or without: steps are those from the optimum itself."""
    made = expansion(None)
    off = replace(made.fit, u=made.fit.u + 0.2, predicted=made.fit.predicted + 0.2 * made.fit.slopes[toys.NUMBER.name])
    beside = Expansion(off, made.columns[:, 1:])
    assert np.ptp(beside.weights) == np.ptp(made.weights) == 0.0
    for fold in range(toys.SHAPE[0]):
        steps = [each.posterior(extra, fold).mean - each.posterior(extra).mean for each in (made, beside)]
        assert steps[1] == pytest.approx(steps[0], abs=1e-8)


def test_numbers_stay_in_their_bounds_where_a_fold_is_left_out():
    made = expansion(None)
    (u,), (number,) = made.fit.u, made.fit.parameters
    held = replace(number, low=number.value(u) - 1e-4 * number.scale, high=number.value(u) + 1e-4 * number.scale)
    free_fit, held_fit = (
        hypothesis(Expansion(replace(made.fit, parameters=(each,)), made.columns[:, 1:]), ()).fold_prediction.missed
        - made.fit.residual
        for each in (number, held)
    )
    slopes = np.abs(made.fit.slopes[number.name])
    assert np.abs(free_fit).max() > 1e-3 * slopes.max()
    assert np.abs(held_fit) == pytest.approx(1e-4 * slopes)
    assert np.sign(held_fit).tolist() == np.sign(free_fit).tolist()


def test_what_is_not_compared_is_not_missed():
    made = expansion(None)
    good = made.fit.task.noise.good.copy()
    good[1, 0, 2:4] = False
    gap = replace(made.fit, task=replace(made.fit.task, noise=replace(made.fit.task.noise, good=good)))
    assert (
        np.isnan(hypothesis(Expansion(gap, np.zeros((int(good.sum()), 0))), ()).fold_prediction.missed).tolist()
        == (~good).tolist()
    )


@pytest.mark.parametrize("extra", SETS[1:])
def test_evidence_of_a_set_has_its_sizes_prior(extra):
    made = expansion(None)
    found, plain = hypothesis(made, extra), made.posterior(extra)
    own = made.own
    inside = log_share_inside(found.causes, plain.mean[own:], plain.covariance[own:, own:])
    assert found.log_evidence == pytest.approx(plain.log_evidence + inside)
    assert found.added == found.names == tuple("pqr"[at] for at in extra)
    assert not found.is_fitted


def test_what_is_left_besides_changes_numbers_and_evidence():
    made = expansion(None)
    found = hypothesis(made, (0,))
    (left,) = with_functions([(made, found.posterior)], [function(made, True)[0]])
    more = with_function(found, left)
    size = slice(made.own, None)
    allowed = [
        log_share_inside(found.causes, each.mean[size], each.covariance[size, size]) for each in (found.posterior, left)
    ]
    assert more.log_evidence == pytest.approx(found.log_evidence + left.gain + allowed[1] - allowed[0])
    assert allowed[0] != allowed[1]
    assert more.moments("p.a")[0] == left.mean[made.own] != found.moments("p.a")[0]
    assert more.moments("p.a")[1] == pytest.approx(math.sqrt(left.covariance[1, 1]))
    assert more.discrepancy is Discrepancy.SMOOTH
