"""What the deciding numbers of the estimation decide: a case just on either side of each, computed by hand."""

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t as student

from rover_pin.base.quantity import Record, quantity
from rover_pin.discrepancy.search import is_bent
from rover_pin.estimation.experiment import Experiment, slopes_at
from rover_pin.estimation.fit import fit
from rover_pin.estimation.identification import Estimate, variance_shares
from rover_pin.estimation.least_squares import Task
from rover_pin.estimation.noise import declared_noise, first_noise, noise_of
from rover_pin.estimation.numbers import Number, implausible
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.random_effects.random_field import Kind, RandomField, learnt_sds
from rover_pin.estimation.residual import null_gain
from rover_pin.estimation.wording import Against, against


@dataclass(frozen=True)
class Rise(Record):
    """y = a x."""

    a: float = quantity(0.0, "m", "made up", -100.0, 100.0, "a")


class Straight(Experiment):
    """One channel (folds, 1, samples) that is a times x, bent by `bend(a)`."""

    channels = ("y",)

    def __init__(self, x, observed, bend=lambda a: a):
        self.x, self.observed, self.bend = x, observed, bend
        self.folds = tuple(map(str, range(len(x))))

    def predict(self, models):
        return np.array([self.bend(model.a) * self.x for model in models])

    def records(self, model):
        return {"rise": model}

    def replace_record(self, model, owner, record):
        return record


NUMBER = Parameter("rise.a", 0.0, 1.0, -100.0, 100.0, declared=True)


@pytest.mark.parametrize("folds", [3, 4, 6])
def test_the_scatter_of_runs_widens_an_interval_from_four_runs_on(folds):
    """Runs that differ: the sandwich over runs by hand, as wide as Student's t with one run less is to 1.96."""
    draw = np.random.default_rng(folds)
    x = draw.normal(size=(folds, 1, 30))
    observed = (1.0 + 0.8 * draw.normal(size=(folds, 1, 1))) * x + 0.5 * draw.normal(size=x.shape)
    fitted = fit(Task(Straight(x, observed), declared_noise(np.array([0.5]), observed)), Rise(), (NUMBER,))
    A, rows = x.reshape(folds, -1) / 0.5, (observed - fitted.u[0] * x).reshape(folds, -1) / 0.5
    weight = np.minimum(1.0, 4.0 / np.abs(rows))
    H = 1.0 / (np.sum(weight * A**2) + 1.0)
    pushed = weight * A * rows

    def sandwich(groups):
        sums = np.array([group.sum() for group in groups])
        return H * math.sqrt(np.sum(sums**2) * len(sums) / (len(sums) - 1) + 1.0)

    stretches = sandwich([pushed[fold, at : at + 8] for fold in range(folds) for at in range(0, 30, 8)])
    runs = sandwich(list(pushed)) * student.ppf(0.975, folds - 1) / 1.959964
    assert runs > stretches
    assert fitted.spread[0] == pytest.approx(
        runs if folds >= 4 else max(stretches, math.sqrt(H * fitted.misfit)), rel=1e-4
    )


def test_learnt_noise_widens_variances_by_one_half():
    """Noise that nobody declares: ground leaves residuals that hang together beyond its model."""
    draw = np.random.default_rng(2)
    x = draw.normal(size=(3, 1, 50))
    observed = 0.7 * x + 0.5 * draw.normal(size=x.shape)
    noise = replace(first_noise(observed - 0.7 * x, np.zeros(1)), sd=np.array([0.8]))
    fitted = fit(Task(Straight(x, observed), noise), Rise(), (NUMBER,))
    assert fitted.misfit < 1.0
    assert fitted.spread[0] >= math.sqrt(1.5 / (np.sum(x**2) / 0.8**2 + 1.0)) * (1.0 - 1e-9)
    plain = fit(Task(fitted.task.experiment, replace(noise, inflation=1.0)), Rise(), (NUMBER,))
    assert fitted.spread[0] / plain.spread[0] == pytest.approx(math.sqrt(1.5), rel=0.01)


def test_neighbours_are_never_taken_to_agree_beyond_0_95():
    steady = np.ones((1, 1, 400))
    assert noise_of(steady, np.ones(steady.shape, dtype=bool), np.zeros(1)).rho == pytest.approx([0.95])


@pytest.mark.parametrize("count", [1, 7, 40])
def test_chance_gives_the_best_of_many_more_than_the_null_gain_once_in_twenty(count):
    """Bonferroni: so many times the upper tail of chi2 with two degrees of freedom, exp(-gain / 2)."""
    assert count * math.exp(-null_gain(count) / 2.0) == pytest.approx(0.05)


@pytest.mark.parametrize(("u", "bent"), [(2.9, False), (-3.1, True)])
def test_a_number_is_bent_beyond_three_sds(u, bent):
    fitted = SimpleNamespace(parameters=(NUMBER,), u=np.array([u]))
    assert is_bent(fitted) is bent
    assert is_bent(SimpleNamespace(parameters=(replace(NUMBER, prior=False),), u=np.array([u]))) is False
    number = Number("rise.a", "m", 1.0, 0.5, 1.5, u)
    assert (number.away in number.text) is bent


@pytest.mark.parametrize(("u", "left"), [(4.9, 0), (-5.1, 1)])
def test_a_declared_number_has_left_its_declaration_beyond_five_sds(u, left):
    fitted = SimpleNamespace(parameters=(NUMBER, replace(NUMBER, declared=False)), u=np.array([u, u]))
    assert len(implausible(fitted)) == left


@pytest.mark.parametrize(("covered", "message"), [(0.79, Against.AWAY), (0.81, Against.NOTHING)])
def test_an_interval_over_four_fifths_of_what_is_allowed_says_nothing(covered, message):
    assert against((0.0, 1.0), (2.0, 3.0), covered) is message


@pytest.mark.parametrize(("outside", "smooth"), [(0.79, True), (0.81, False), (-0.79, True), (-0.81, False)])
def test_slopes_are_none_where_twice_the_step_is_not_twice_the_change(outside, smooth):
    """One number with a step h of 0.3: the change of 2 h may differ from twice that of h by 2 (0.1 + h) of it."""
    x, observed = np.ones((1, 1, 2)), np.zeros((1, 1, 2))
    experiment = Straight(x, observed, lambda a: a / 0.3 + (outside if a > 0.45 else 0.0))
    (slope,) = slopes_at(experiment, Rise(), (NUMBER,), np.zeros(1))
    assert slope == pytest.approx(np.full(x.shape, 1.0 / 0.3 if smooth else 0.0))


@pytest.mark.parametrize(("share", "expected"), [(0.49, False), (0.51, True)])
def test_a_number_is_found_where_the_data_leave_half_of_its_variance(share, expected):
    number = Number("soil.k", "m", 1.0, 0.5, 1.5, 0.0)
    estimate = Estimate(number, share, {"soil.k": 0.5 * (1 - share), "soil.c": 0.5 * (1 - share)})
    assert estimate.is_found is expected
    assert estimate.depends_on == (() if expected else ("soil.k", "soil.c"))
    assert not estimate._replace(number=number._replace(closed=False)).is_found
    assert not estimate._replace(number=number._replace(at_bound=True)).is_found


def test_shares_of_a_variance_are_those_that_moved_priors_and_data_leave():
    """u = C (J'y + m) with y and m drawn: the variance of u that m_j alone makes, by sampling."""
    draw = np.random.default_rng(0)
    J = draw.normal(size=(3, 2)) * [2.0, 0.3]
    C = np.linalg.inv(J.T @ J + np.eye(2))
    shares = variance_shares(C)
    means = draw.normal(size=(200_000, 2))
    for j in range(2):
        moved_variance = means[:, j : j + 1] * C[:, j]
        assert shares[:, j] == pytest.approx(moved_variance.var(axis=0) / np.diag(C), rel=0.02)
    data = draw.normal(size=(200_000, 3)) @ J @ C
    assert 1.0 - shares.sum(axis=1) == pytest.approx(data.var(axis=0) / np.diag(C), rel=0.02)


@pytest.mark.parametrize(("true", "learnt"), [(6.0, 6.0), (25.0, 10.0)])
def test_folds_differ_by_no_more_than_ten_sizes(true, learnt):
    """Forty folds, a column of unit norm times 100 each: the noise hardly counts, tau^2 is the mean square."""
    drawn = true * np.where(np.arange(40) % 2, 1.0, -1.0)
    columns = 100.0 * np.eye(40)
    field = RandomField((Kind("tilt", 0.5, "deg"),), np.zeros(40, dtype=int), np.arange(40), np.zeros((40, 1, 1, 1)))
    (learnt_sd,) = learnt_sds(columns @ drawn, np.zeros((40, 0)), columns, field)
    assert learnt_sd.sd == pytest.approx(0.5 * learnt, rel=0.01)
