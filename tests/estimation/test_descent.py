"""The one descent of the package: against scipy's on measured rigs, and on problems whose minimum is known."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation import descent
from rover_pin.estimation.descent import Point, Problem, descend
from rover_pin.estimation.least_squares import LeastSquares, Task
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.measurements.rig_reading import read_rig_set
from studies.shared.rig_fits import scattered

DATA = Path(__file__).parents[2] / "studies" / "data"


class Made(Problem):
    """A problem whose residuals are a plain function of u."""

    def __init__(self, residual, jacobian, low, high):
        self.residual, self.jacobian = residual, jacobian
        self.bounds = np.array([low, high]).T

    def evaluate(self, u):
        rows, jacobian = np.asarray(self.residual(u), float), np.asarray(self.jacobian(u), float)
        return Point(u, rows, jacobian, rows, jacobian.T)


def rosenbrock(low=(-5.0, -5.0), high=(5.0, 5.0)):
    return Made(lambda u: [10 * (u[1] - u[0] ** 2), 1 - u[0]], lambda u: [[-20 * u[0], 10.0], [-1.0, 0.0]], low, high)


def ended(example, start):
    end = descend(example, np.array(start))
    return end.u, end.chi2


def test_descent_follows_a_curved_valley():
    u, chi2 = ended(rosenbrock(), [-1.2, 1.0])
    np.testing.assert_allclose(u, [1, 1], atol=1e-4)
    assert chi2 < 1e-8


def test_descent_ends_on_the_bound_where_the_minimum_lies_beyond():
    """With x <= 0.5 the least of (1 - x)^2 + 100 (y - x^2)^2 is at x = 0.5, y = 0.25."""
    u, chi2 = ended(rosenbrock(high=(0.5, 5.0)), [-1.2, 1.0])
    np.testing.assert_allclose(u, [0.5, 0.25], atol=1e-6)
    assert chi2 == pytest.approx(0.25)


def test_a_descent_without_a_value_or_an_end_says_so(monkeypatch):
    nowhere = Made(lambda u: [np.nan], lambda u: [[1.0]], [-1.0], [1.0])
    with pytest.raises(OptimisationError, match="finite"):
        ended(nowhere, [0.0])
    monkeypatch.setattr(descent, "MAX_STEPS", 2)
    with pytest.raises(OptimisationError, match=r"\b2 steps"):
        ended(rosenbrock(), [-1.2, 1.0])


def test_a_descent_leaves_a_bound_that_it_began_on():
    low, high = (-1.0, -1.0), (2.0, 2.0)
    for start in ([-1.0, 2.0], [2.0, -1.0], [-1.0, -1.0], [2.0, 2.0]):
        for least in ([0.3, 0.7], [-0.9, 1.9], [1.9, -0.9]):
            u, _ = ended(Made(lambda u, end=np.array(least): u - end, lambda u: np.eye(2), low, high), start)
            assert u == pytest.approx(least, abs=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_a_linear_problem_ends_like_bounded_least_squares(seed):
    draw = np.random.default_rng(seed)
    columns, measured = draw.normal(size=(30, 4)), 2.0 * draw.normal(size=30)
    low, high = draw.uniform(-0.5, -0.1, 4), draw.uniform(0.0, 0.3, 4)
    u, chi2 = ended(Made(lambda u: columns @ u - measured, lambda u: columns, low, high), draw.uniform(-0.1, 0.0, 4))
    best = lsq_linear(columns, measured, (low, high), tol=1e-14)
    assert u == pytest.approx(best.x, abs=1e-5)
    assert chi2 == pytest.approx(2.0 * best.cost, rel=1e-9)


class Counted(Problem):
    """A problem that counts its evaluations; scipy asks for residual and Jacobian apart, which count once."""

    def __init__(self, problem):
        self._problem, self.count, self._last = problem, 0, (None, None)
        self.bounds = problem.bounds

    def evaluate(self, u):
        if self._last[0] != u.tobytes():
            self.count += 1
            self._last = (u.tobytes(), self._problem.evaluate(u))
        return self._last[1]


def of_scipy(problem, start):
    counted, (low, high) = Counted(problem), problem.bounds.T
    margin = 1e-6 * np.minimum(high - low, 1.0)
    solution = least_squares(
        lambda u: counted.evaluate(u).rows,
        np.clip(start, low + margin, high - margin),
        lambda u: counted.evaluate(u).jacobian,
        bounds=(low, high), x_scale="jac", max_nfev=400, ftol=1e-12, xtol=1e-12, gtol=1e-12,
    )  # fmt: skip
    return 2 * solution.cost, counted.count


def of_ours(problem, start):
    counted = Counted(problem)
    try:
        return descend(counted, start).chi2, counted.count
    except OptimisationError:
        return np.inf, counted.count


@pytest.mark.parametrize("name", ["cmu-smooth-wheel", "ding-2011-smooth"])
def test_it_ends_as_low_as_scipy_in_no_more_evaluations(name):
    experiment = RigExperiment((read_rig_set(DATA / name),))
    model = experiment.base_model()
    numbers = experiment.uncertain(model)
    problem = LeastSquares(Task(experiment, experiment.noise()), model, numbers)
    centre = np.array([number.u(experiment.value(model, number.name)) for number in numbers])
    starts = scattered(centre, 12, 0)
    problems = [start for start in starts if np.isfinite(problem.evaluate(start).rows).all()]
    assert len(problems) >= 6
    ours, theirs = ([solve(problem, start) for start in problems] for solve in (of_ours, of_scipy))
    lowest = min(chi2 for chi2, _ in theirs)
    reached = [sum(chi2 < lowest * (1 + 1e-6) + 1e-6 for chi2, _ in ends) for ends in (ours, theirs)]
    spent = [sum(count for _, count in ends) for ends in (ours, theirs)]
    print(f"{name}: of {len(starts)} starts {reached[0]} end lowest, {reached[1]} of scipy; {spent} evaluations")
    assert min(chi2 for chi2, _ in ours) <= lowest * (1 + 1e-8)
    assert reached[0] >= reached[1]
    assert spent[0] <= spent[1]
