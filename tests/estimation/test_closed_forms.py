"""Fits, their numbers and curves on problems so small that everything about them is known in closed form."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import chi2 as chi2_law

from rover_pin.base.quantity import Record, quantity
from rover_pin.estimation.experiment import Differentiable, Experiment, Sensitivities
from rover_pin.estimation.fit import fit
from rover_pin.estimation.least_squares import LeastSquares, Task
from rover_pin.estimation.noise import Noise, declared_noise, noise_of
from rover_pin.estimation.numbers import profiles
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.residual import huber
from rover_pin.estimation.wording import Change, Outcome
from studies.shared.rig_fits import is_adequate

FOLDS, SAMPLES, STRETCH = 3, 20, 8
X = np.random.default_rng(7).normal(size=(2, FOLDS, 1, SAMPLES))


@dataclass(frozen=True)
class Plane(Record):
    """y = a x_0 + b x_1, or with a squared."""

    a: float = quantity(0.0, "m", "made up", -100.0, 100.0, "a")
    b: float = quantity(0.0, "", "made up", -100.0, 100.0, "b")


class Line(Experiment):
    """One channel that is linear in a and b; `bent`: in a^2 and b."""

    channels, folds = ("y",), tuple("pqr")

    def __init__(self, observed, bent=False):
        self.observed, self.bent = observed, bent

    def predict(self, models):
        return np.array([(model.a**2 if self.bent else model.a) * X[0] + model.b * X[1] for model in models])

    def records(self, model):
        return {"plane": model}

    def replace_record(self, model, owner, record):
        return record


class ExactLine(Line, Differentiable):
    """The same, that tells its slopes."""

    def sensitivities(self, model, parameters, u):
        model_at_u = self.with_values(
            model, {parameter.name: parameter.value(x) for parameter, x in zip(parameters, u, strict=True)}
        )
        by = {"plane.a": X[0] * (2.0 * model_at_u.a if self.bent else 1.0), "plane.b": X[1]}
        slopes = [by[parameter.name] * parameter.slope(x) for parameter, x in zip(parameters, u, strict=True)]
        return Sensitivities(self.predict([model_at_u])[0], np.array(slopes))


def number(name, sd=1.0, low=-100.0, high=100.0, prior=True, origin=0.0, declared=True):
    return Parameter(f"plane.{name}", origin, sd, low, high, prior=prior, declared=declared)


BOTH = (number("a"), number("b", sd=2.0, prior=False))


def made(exact=False, bent=False, sd=0.5, noise=0.5, a=1.0, b=-2.0, seed=1):
    """A task whose data are of a and b, with noise."""
    truth = (a**2 if bent else a) * X[0] + b * X[1]
    bed = (ExactLine if exact else Line)(truth + noise * np.random.default_rng(seed).normal(size=truth.shape), bent)
    return Task(bed, declared_noise(np.array([sd]), bed.observed))


def matrix(task, parameters):
    """Rows of the weighted problem with the priors, and its right side."""
    scale = np.array([parameter.scale for parameter in parameters])
    sd = task.noise.sd[0]
    columns = np.array([X["ab".index(parameter.name[-1])].ravel() for parameter in parameters]).T * scale / sd
    is_known = np.eye(len(parameters))[[parameter.prior for parameter in parameters]]
    return np.vstack([columns, is_known]), np.append(task.experiment.observed.ravel() / sd, np.zeros(len(is_known)))


@pytest.mark.parametrize("exact", [False, True])
def test_a_linear_fit_is_least_squares_with_the_priors_as_rows(exact):
    task = made(exact)
    fitted = fit(task, Plane(), BOTH)
    A, y = matrix(task, BOTH)
    u, *_ = np.linalg.lstsq(A, y, rcond=None)
    assert fitted.u == pytest.approx(u, abs=1e-6)
    residual = y - A @ u
    assert fitted.chi2 == pytest.approx(float(residual @ residual), rel=1e-9)
    assert fitted.freedom == FOLDS * SAMPLES - 1, "b alone has no prior"
    assert (
        fit(task, Plane(), tuple(replace(parameter, prior=False) for parameter in BOTH)).freedom == FOLDS * SAMPLES - 2
    )
    assert fitted.misfit == pytest.approx(float(residual[:-1] @ residual[:-1]) / 59, rel=1e-9)
    assert fitted.covariance == pytest.approx(np.linalg.inv(A.T @ A), rel=1e-6)
    assert fitted.value("plane.b") == pytest.approx(2.0 * u[1])
    assert fitted.columns == pytest.approx(-A[:-1], rel=1e-9)
    assert fitted.task.columns([]).shape == (60, 0)


@pytest.mark.parametrize("exact", [False, True])
def test_a_fit_of_no_numbers_is_the_model_as_it_is(exact):
    """As where a profile holds the only number."""
    task = made(exact)
    fitted = fit(task, Plane(1.0, -2.0), ())
    assert fitted.u.shape == (0,)
    assert fitted.chi2 == pytest.approx(huber(task.rows(X[0] - 2.0 * X[1])))


def test_sd_is_widened_by_misfit_or_taken_from_stretches():
    """Rows that agree within stretches of 8: the sandwich over stretches, by an explicit loop."""
    for seed, shared, noise in ((3, 0.0, 1.0), (4, 3.0, 1.0), (5, 0.0, 0.4)):
        draw = np.random.default_rng(seed)
        pieces = -(-SAMPLES // STRETCH)
        common = np.repeat(draw.normal(size=(FOLDS, 1, pieces)), STRETCH, axis=2)[:, :, :SAMPLES]
        task = made(noise=noise, seed=seed)
        task.experiment.observed = task.experiment.observed + shared * common * np.sign(X[0])
        task = replace(task, noise=replace(task.noise, inflation=1.7))
        fitted = fit(task, Plane(), BOTH)
        A, y = matrix(task, BOTH)
        rows, H = y[:-1] - A[:-1] @ fitted.u, fitted.covariance
        weight = np.minimum(1.0, 4.0 / np.abs(rows))
        inner, groups = np.diag([1.0, 0.0]), FOLDS * pieces
        for fold in range(FOLDS):
            for piece in range(pieces):
                rows_of_piece = [fold * SAMPLES + at for at in range(SAMPLES) if at // STRETCH == piece]
                g = sum(A[i] * weight[i] * rows[i] for i in rows_of_piece)
                inner = inner + np.outer(g, g) * groups / (groups - 1)
        plain = np.diag(H) * 1.7 * max(fitted.misfit, 1.0)
        sandwich = np.diag(H @ inner @ H)
        assert fitted.spread == pytest.approx(np.sqrt(np.maximum(plain, sandwich)), rel=1e-5)
        assert (sandwich > plain).any() or not shared


def test_slopes_that_are_wrong_are_computed_again():
    """Given ones serve first; where their step does not help, own ones end at least squares."""
    task = made()
    true = fit(task, Plane(), BOTH)
    wrong = {name: -values for name, values in true.slopes.items()}
    assert fit(task, Plane(), BOTH, slopes=wrong).u == pytest.approx(true.u, abs=1e-6)
    assert fit(task, Plane(), BOTH, slopes=wrong, stale=True).u == pytest.approx(true.u, abs=1e-6)
    fitted = fit(task, Plane(), BOTH, slopes=wrong, reuse=True)
    assert fitted.u == pytest.approx(np.zeros(2)), "with reuse given slopes stay as they are"


STRAYS = np.array([0.0, 3.9, -3.9, 4.1, -4.1, 12.0, -40.0])


def test_exact_rows_square_to_robust_chi2_and_match_its_slopes():
    task = made(exact=True, bent=True)
    task.experiment.observed[0, 0, : len(STRAYS)] += 0.5 * STRAYS
    problem = LeastSquares(task, Plane(), BOTH)
    for u in (np.array([0.9, -1.1]), np.array([-0.4, 0.7])):
        point = problem.evaluate(u)
        rows = point.rows
        rows_at_point = task.rows(point.predicted)
        assert (np.abs(rows_at_point) > 4.0).sum() > 2
        assert rows @ rows == pytest.approx(huber(rows_at_point) + u[0] ** 2, rel=1e-12)
        assert len(rows) == 61
        slopes = [(problem.evaluate(u + h).rows - problem.evaluate(u - h).rows) / 2e-6 for h in 1e-6 * np.eye(2)]
        assert point.jacobian == pytest.approx(np.array(slopes).T, abs=1e-6)


def test_noise_of_every_value_whitens_by_it():
    """SDs of each block: no memory, no common mode; what is not compared counts in nothing."""
    sd = np.array([[[2.0, 4.0, 8.0], [1.0, 0.5, 0.25]]])
    good = np.array([[[True, False, True], [False, False, False]]])
    noise = Noise(sd, np.zeros(2), np.eye(2), good)
    residual = np.array([[[1.0, 9.0, 2.0], [9.0, 9.0, 9.0]]])
    assert noise.white(residual) == pytest.approx([0.5, 0.25])
    assert noise.floor == pytest.approx([math.sqrt((4.0 + 64.0) / 2), 0.0])
    assert noise.count == 2


def test_runs_are_laid_end_to_end_for_what_channels_share():
    """Two runs are one run with a gap between them."""
    draw = np.random.default_rng(11)
    common = draw.normal(size=(2, 1, 30))
    residual = common * [[[1.0], [2.0]]] + draw.normal(size=(2, 2, 30))
    two = noise_of(residual, np.ones((2, 2, 30), dtype=bool), np.zeros(2))
    joined, good = np.zeros((1, 2, 61)), np.ones((1, 2, 61), dtype=bool)
    joined[0, :, :30], joined[0, :, 31:], good[0, :, 30] = residual[0], residual[1], False
    noise = noise_of(joined, good, np.zeros(2))
    for name in ("sd", "rho", "mixing"):
        assert getattr(two, name) == pytest.approx(getattr(noise, name), rel=1e-9), name


@pytest.mark.parametrize("misfit", [0.5, 1.5])
def test_profile_of_a_linear_fit_is_a_parabola_in_noise_units(misfit):
    """Rise (u - u_best)^2 / var over the inflation and a misfit above 1, at these shares of half the interval."""
    task = made(noise=0.5 * math.sqrt(misfit), sd=0.5)
    exact = X[0] - 2.0 * X[1]
    task.experiment.observed = exact + np.clip(task.experiment.observed - exact, -1.2, 1.2)  # no stray
    task = replace(task, noise=replace(task.noise, inflation=1.7))
    fitted = fit(task, Plane(), BOTH)
    assert (fitted.misfit > 1.0) is (misfit > 1.0)
    for name, profile in zip("ab", profiles(fitted, ("plane.a", "plane.b")), strict=True):
        at = "ab".index(name)
        half, var = 1.959964 * fitted.spread[at], fitted.covariance[at, at]
        off = half * np.array([-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5])
        assert profile.values == pytest.approx(BOTH[at].scale * (fitted.u[at] + off), rel=1e-6)
        assert profile.rises == pytest.approx(off**2 / var / 1.7 / max(fitted.misfit, 1.0), rel=1e-4, abs=1e-6)


def change(before, after, low, high, floor=0.0):
    return Change(before, after, low, high, floor, "levels")


@pytest.mark.parametrize(
    ("example", "outcome"),
    [
        (change(1.24, 1.24 * 0.9, -0.2, -0.05, 1.0), Outcome.AT_FLOOR),
        (change(1.24, 1.26, 0.01, 0.03, 1.0), Outcome.WORSE),
        (change(1.26, 1.0, -0.3, -0.1, 1.0), Outcome.BETTER),
        (change(2.48, 2.0, -0.3, -0.1, 2.0), Outcome.AT_FLOOR),
        (change(0.62, 0.5, -0.3, -0.1, 0.5), Outcome.AT_FLOOR),
        (change(0.62, 0.64, -0.1, 0.1, 0.5), Outcome.SCATTER),
        (change(1.0, 1.0, -0.1, 0.0), Outcome.NONE),
        (change(1.0, 1.0, 0.0, 0.1), Outcome.NONE),
        (change(1.0, 1.0, -0.1, 0.1), Outcome.SCATTER),
        (change(1.0, 1.0, -0.2, -0.1), Outcome.NONE),
        (change(1.0, 1.0, 0.1, 0.2), Outcome.NONE),
    ],
)
def test_a_floor_of_any_size_counts_in_its_own_measure(example, outcome):
    assert example.outcome is outcome
    assert change(0.0, 1.0, 0.0, 0.0).share == 0.0


def test_contradictory_correlations_are_made_positive_definite():
    """Pairs of three channels that meet at blocks of their own, as +1, +1 and -1: no eigenvalue below 0.05 stays."""
    residual, good = np.zeros((1, 3, 42)), np.zeros((1, 3, 42), dtype=bool)
    signs = np.array([1.0, -1.0, 1.0, 1.0] * 3)
    for part, (i, j, sign) in enumerate(((0, 1, 1.0), (0, 2, 1.0), (1, 2, -1.0))):
        at = slice(14 * part, 14 * part + 12)
        residual[0, i, at], residual[0, j, at] = signs, sign * signs
        good[0, [i, j], at] = True
    noise = noise_of(residual, good, np.zeros(3))
    correlation = np.array([[1.0, 0.8, 0.8], [0.8, 1.0, -0.8], [0.8, -0.8, 1.0]])
    values, vectors = np.linalg.eigh(correlation)
    assert values.min() < 0.0
    sound = vectors @ np.diag(np.maximum(values, 0.05)) @ vectors.T
    whitened = noise.mixing * noise.mixing[0, 0] ** -1 * math.sqrt(1.0 / sound[0, 0])
    assert whitened @ sound @ whitened.T == pytest.approx(np.eye(3), abs=0.02)


@pytest.mark.parametrize(("share", "adequate"), [(0.98, True), (1.02, False)])
def test_residual_is_inadequate_at_a_p_value_of_0_001(share, adequate):
    task = made(exact=True, noise=0.3)
    free = (number("a"), number("b", prior=False))
    plain = fit(task, Plane(), free)
    wanted = math.sqrt(huber(plain.rows) / chi2_law.isf(1e-3, 59) / share)
    fitted = fit(replace(task, noise=replace(task.noise, sd=task.noise.sd * wanted)), Plane(), free)
    assert huber(fitted.rows) == pytest.approx(share * chi2_law.isf(1e-3, 59), rel=2e-3)
    assert is_adequate(fitted) is adequate
