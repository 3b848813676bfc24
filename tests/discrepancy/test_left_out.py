"""Folds left out: to first order against least squares, by density against the normal law, and what each chooses."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from rover_pin.base.errors import OptimisationError
from rover_pin.discrepancy import cross_validation, decide_answer
from rover_pin.discrepancy.cross_validation import (
    FAR,
    fall_of,
    held_out_losses,
    held_out_residual,
    seen_again,
    surprise,
    without_each,
)
from rover_pin.discrepancy.search import Search
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.parameter import Parameter

RUNS, BLOCKS = 3, 6


def linear(random, far=1.0):
    """Rows r + C du of a fit at u, one number with a prior and one without, away from the optimum."""
    parameters = (Parameter("a", 0.0, 1.0, -9, 9), Parameter("b", 0.0, 1.0, -9, 9, prior=False))
    good = np.ones((RUNS, 1, BLOCKS), dtype=bool)
    good[1, 0, 2] = False
    columns = random.normal(size=(int(good.sum()), 2))
    return SimpleNamespace(
        rows=far * random.normal(size=len(columns)), columns=columns, parameters=parameters, u=np.array([0.3, -0.8]),
        predicted=np.zeros(good.shape), task=SimpleNamespace(noise=SimpleNamespace(good=good)),
    ), np.broadcast_to(np.arange(RUNS)[:, None, None], good.shape)[good]  # fmt: skip


def test_chi2_without_a_run_equals_least_squares_on_the_others():
    """With the prior's u^2; what has no prior is held by FAR of its default sizes where it was."""
    fitted, owner = linear(np.random.default_rng(2))
    found = without_each(fitted)
    assert len(found) == RUNS
    for run in range(RUNS):
        C, r = fitted.columns[owner != run], fitted.rows[owner != run]
        stacked = np.vstack([C, [1.0, 0.0], [0.0, 1.0 / FAR]])
        step, *_ = np.linalg.lstsq(stacked, -np.array([*r, fitted.u[0], 0.0]), rcond=None)
        chi2 = np.sum((r + C @ step) ** 2) + (fitted.u[0] + step[0]) ** 2
        assert found[run] == pytest.approx(chi2)


def test_surprise_is_minus_twice_log_density_relative_to_noise():
    """Of N(0, I + J P^-1 J^T), where no row strays."""
    random = np.random.default_rng(1)
    J, root = random.normal(size=(4, 2)), random.normal(size=(2, 2))
    P, e = root @ root.T + np.eye(2), np.array([0.5, -1.5, 2.0, 0.1])
    law = multivariate_normal(np.zeros(4), np.eye(4) + J @ np.linalg.inv(P) @ J.T)
    alone = multivariate_normal(np.zeros(4), np.eye(4))
    assert surprise(e, J, P) == pytest.approx(-2 * (law.logpdf(e) - alone.logpdf(np.zeros(4))))


def test_a_stray_row_left_out_counts_with_less_weight():
    """Weights 4 / |e| beyond 4 SDs, in the step and in what the others leave open; the loss is linear there."""
    random = np.random.default_rng(1)
    J, root = random.normal(size=(4, 2)), random.normal(size=(2, 2))
    P, e = root @ root.T + np.eye(2), np.array([0.5, -30.0, 2.0, 16.0])
    w = np.diag([1.0, 4 / 30, 1.0, 0.25]) ** 0.5
    half = np.linalg.cholesky(P).T
    d, *_ = np.linalg.lstsq(np.vstack([w @ J, half]), -np.concatenate([w @ e, np.zeros(2)]), rcond=None)
    left = np.abs(e + J @ d)
    loss = np.sum(np.where(left > 4.0, 8.0 * left - 16.0, left**2))
    room = np.linalg.slogdet(np.eye(4) + w @ J @ np.linalg.inv(P) @ J.T @ w)[1]
    assert surprise(e, J, P) == pytest.approx(loss + d @ P @ d + room)


@pytest.mark.parametrize("exact", [True, False])
def test_held_out_losses_are_chi2_for_exact_fits_else_surprises(exact, monkeypatch):
    monkeypatch.setattr(cross_validation, "losses_of", lambda fitted: "chi2")
    monkeypatch.setattr(cross_validation, "refitted_surprises", lambda fitted: "surprise")
    one = SimpleNamespace(task=SimpleNamespace(experiment=SimpleNamespace(is_exact=exact)))
    assert held_out_losses(one) == ("chi2" if exact else "surprise")


def test_fold_fits_start_at_the_whole_fit_a_lost_run_costs_most(monkeypatch):
    """A number without a prior is held at what it is: there u = 0."""
    seen = []

    def fit(task, model, held, start, slopes, reuse):
        assert reuse, "the whole fit's slopes are those of the start"
        assert {name: list(one) for name, one in slopes.items()} == {"a": [1.0], "b": [FAR]}
        seen.append((task.noise.good.copy(), [one.origin for one in held], list(start)))
        if len(seen) == 2:
            raise OptimisationError("it does not end")
        return SimpleNamespace(missed=np.full((RUNS, 2, 1), float(len(seen))))

    parameters = (Parameter("a", 2.0, 0.5, -9, 9), Parameter("b", 1.0, 0.25, -9, 9, prior=False))
    noise = SimpleNamespace(good=np.ones((RUNS, 2, 1), dtype=bool), floor=np.array([0.1, 0.3]))
    noise.good[0, 1, 0] = False
    fitted = SimpleNamespace(
        residual=np.full((RUNS, 2, 1), 9.0), missed=None, predicted=np.zeros((RUNS, 2, 1)), parameters=parameters,
        u=np.array([0.4, -1.0]), slopes={"a": np.ones(1), "b": np.ones(1)}, model=None,
        task=SimpleNamespace(experiment=None, noise=noise),
    )  # fmt: skip
    monkeypatch.setattr(cross_validation, "fit", fit)
    monkeypatch.setattr(cross_validation, "Task", lambda experiment, noise: SimpleNamespace(noise=noise))
    monkeypatch.setattr(cross_validation.dataclasses, "replace", replaced)
    left = held_out_residual(fitted)
    np.testing.assert_equal(left[:, :, 0], [[1.0, 1.0], [np.nan, np.nan], [3.0, 3.0]])
    for run, (good, origins, start) in enumerate(seen):
        assert list(good.any(axis=(1, 2))) == [run != each for each in range(RUNS)], "also what is compared in part"
        assert origins == [2.0, 0.75]
        assert start == [0.4, 0.0]


def replaced(record, **values):
    """As `dataclasses.replace`, for records and for stand-ins."""
    return type(record)(**(vars(record) | values))


def test_whole_model_replaces_a_fold_fit_that_fails(monkeypatch):
    whole, other = SimpleNamespace(model="whole"), SimpleNamespace(model="other")
    monkeypatch.setattr(cross_validation, "_fold_fits", lambda fitted: iter([other, None]))
    assert cross_validation.fold_models(whole) == ["other", "whole"]


# --- what a fold chooses ---------------------------------------------------------------------------------------------

BASE = np.array([100.0, 100.0, 100.0, 100.0])


def one(name, losses, net):
    return SimpleNamespace(name=name, fit=SimpleNamespace(losses=np.array(losses)), threshold=10.0, net=net)


def test_each_fold_chooses_by_gain_on_others_until_it_differs(monkeypatch):
    """Beyond the threshold of 10; a candidate that lost by half of its threshold or more is not looked at."""
    monkeypatch.setattr(decide_answer, "without_each", lambda fitted: fitted.losses)
    A, B = one("A", [70, 95, 60, 95], 20.0), one("B", [60, 85, 95, 85], 5.0)
    late, lost, far = one("D", [95, 95, 30, 95], -4.0), one("C", [0, 0, 0, 0], -5.0), one("E", [0, 0, 0, 0], -7.0)
    further = one("F", [49.5, 80, 0, 75], 3.0)
    rounds = (
        SimpleNamespace(refits=(A, B, late, lost, far), indistinguishable=(B, A)),
        SimpleNamespace(refits=(further,), indistinguishable=(further,)),
        SimpleNamespace(refits=(), indistinguishable=()),
        SimpleNamespace(refits=(one("G", [0, 0, 0, 0], 9.0),), indistinguishable=()),
    )
    experiment = SimpleNamespace(folds=("a", "b", "c", "d"))
    base = SimpleNamespace(losses=BASE, task=SimpleNamespace(experiment=experiment))
    chosen = decide_answer.chosen_without(SimpleNamespace(base=base, rounds=rounds))
    assert chosen == {"a": "B + F", "b": "B", "c": "D", "d": "B"}


@pytest.mark.parametrize(("folds", "rounds"), [("AB AB A A", 2), ("AB A A A", 1), ("AB BA B -", 2), ("- - - -", 1)])
def test_second_effect_chosen_by_few_folds_is_dropped(monkeypatch, folds, rounds):
    asked = []

    def chosen(found):
        asked.append(len(found.rounds))
        return {str(at): " + ".join(one.replace("-", "")) for at, one in enumerate(folds.split())}

    monkeypatch.setattr(decide_answer, "chosen_without", chosen)
    effects = [SimpleNamespace(name=name, candidate=SimpleNamespace(name=name)) for name in "AB"]
    every = (*(SimpleNamespace(indistinguishable=(one,)) for one in effects), SimpleNamespace(indistinguishable=()))
    assert len(decide_answer.keep_supported_effects(Search(None, every, ())).best_refits) == rounds
    assert asked == [3], "a first effect stands without being asked for"


def test_folds_that_only_one_model_predicts_are_not_compared():
    """What the second loses keeps both from being compared; what only the first loses counts for neither."""
    without, found = np.array([9.0, 7.0, 5.0]), np.array([3.0, 6.0, 1.0])
    assert (fall_of(without, found), seen_again(without, found)) == (11.0, 5.0)
    lost = np.array([np.nan, 0.0, 0.0])
    assert fall_of(without + lost, found) == fall_of(without + lost, found + lost) == 5.0
    assert seen_again(without + lost, found) == 5.0, "of two folds both count"
    assert np.isnan([fall_of(without, found + lost), seen_again(without, found + lost)]).all()


def test_what_stands_for_no_prediction_in_a_fit_is_no_error():
    """A drive that breaks off is far off while numbers are fitted, and NaN in what is told."""
    task = SimpleNamespace(experiment=SimpleNamespace(stand_in=1e3, observed=np.array([[[1.0, 2.0, 3.0]]])))
    predicted = np.array([[[1.5, 1e3, -1e3]]])
    fitted = Fit(task, None, (), np.zeros(0), predicted, {})
    np.testing.assert_equal(fitted.missed, [[[-0.5, np.nan, np.nan]]])
    assert np.isfinite(fitted.residual).all()
