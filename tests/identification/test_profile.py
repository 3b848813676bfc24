"""The descent and the profile where they must give up or start again, on made-up problems of one or two residuals."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rover_pin.base.errors import OptimisationError
from rover_pin.contact import Soil, Wheel
from rover_pin.estimation import descent as levenberg
from rover_pin.estimation import profile
from rover_pin.estimation.descent import descend
from rover_pin.estimation.profile import NORMAL_95, Best, LowerMinimum, interval
from rover_pin.identification import identify as fit
from rover_pin.identification.identify import build
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.soil.traction import load_traction_factor


class Made:
    """A problem whose residuals are a plain function of u."""

    def __init__(self, residual, jacobian, low, high):
        self.residual, self.jacobian = residual, jacobian
        coordinate = SimpleNamespace(value=float)
        axes = [SimpleNamespace(coordinate=coordinate) for _ in low]
        self.space = SimpleNamespace(low=np.array(low), high=np.array(high), names=("x", "y"), axes=axes)

    def evaluate(self, u):
        return np.asarray(self.residual(u), float), np.asarray(self.jacobian(u), float)


def rosenbrock(low=(-5.0, -5.0), high=(5.0, 5.0)):
    return Made(lambda u: [10 * (u[1] - u[0] ** 2), 1 - u[0]], lambda u: [[-20 * u[0], 10.0], [-1.0, 0.0]], low, high)


def points():
    slips = np.linspace(0, 1, 11)
    clean = np.array([load_traction_factor(float(S), Soil(k=0.005), Wheel()) for S in slips])
    return TractionPoints(slips, clean, 0.03)


def test_descent_follows_a_curved_valley():
    u, chi2 = descend(rosenbrock(), np.array([-1.2, 1.0]))
    np.testing.assert_allclose(u, [1, 1], atol=1e-4)
    assert chi2 < 1e-8


def test_descent_ends_on_the_bound_where_the_minimum_lies_beyond():
    """With x <= 0.5 the least of (1 - x)^2 + 100 (y - x^2)^2 is at x = 0.5, y = 0.25."""
    u, chi2 = descend(rosenbrock(high=(0.5, 5.0)), np.array([-1.2, 1.0]))
    np.testing.assert_allclose(u, [0.5, 0.25], atol=1e-6)
    assert chi2 == pytest.approx(0.25)


def test_descent_keeps_what_is_held():
    u, chi2 = descend(rosenbrock(), np.array([0.0, 3.0]), fixed_index=0)
    np.testing.assert_allclose(u, [0, 0], atol=1e-6)
    assert chi2 == pytest.approx(1)


def test_interval_of_a_line_is_its_textbook_interval():
    """y = a + b x with unit noise: sd = sqrt of the diagonal of (X^T X)^-1, ends at 1.96 sd."""
    design = np.column_stack([np.ones(6), np.arange(6.0)])
    line = Made(lambda u: design @ (u - [0.3, 0.7]), lambda u: design, [-50.0, -50.0], [50.0, 50.0])
    covariance = np.linalg.inv(design.T @ design)
    found = interval(line, Best(np.array([0.3, 0.7]), 0.0, covariance), 1)
    half = 1.959964 * math.sqrt(covariance[1, 1])
    assert (found.low, found.high) == pytest.approx((0.7 - half, 0.7 + half), rel=1e-2)
    assert found.closed_low
    assert found.closed_high


def test_interval_ends_where_the_model_predicts_nothing():
    """The line again, without a value for slopes above 0.8: one SD is 0.24, so the upper end is there."""
    design = np.column_stack([np.ones(6), np.arange(6.0)])
    rows = lambda u: design @ (u - [0.3, 0.7]) if u[1] <= 0.8 else np.full(6, np.nan)  # noqa: E731
    line = Made(rows, lambda u: design, [-50.0, -50.0], [50.0, 50.0])
    covariance = np.linalg.inv(design.T @ design)
    found = interval(line, Best(np.array([0.3, 0.7]), 0.0, covariance), 1)
    assert found.high == pytest.approx(0.8, abs=0.01)
    assert found.low == pytest.approx(0.7 - 1.959964 * math.sqrt(covariance[1, 1]), rel=1e-2)
    assert found.closed_high


def test_interval_is_open_where_the_data_say_nothing():
    flat = Made(lambda u: [0.1 * np.tanh(u[0])], lambda u: [[0.1 / np.cosh(u[0]) ** 2]], [-3.0], [4.0])
    found = interval(flat, Best(np.array([0.0]), 0.0, np.array([[100.0]])), 0)
    assert found[:4] == (-3.0, 4.0, False, False)


def test_a_model_without_a_value_is_refused():
    nothing = Made(lambda u: [math.nan], lambda u: [[1.0]], [-1.0], [1.0])
    with pytest.raises(OptimisationError, match="no finite value where the descent starts"):
        descend(nothing, np.array([0.0]))


def test_a_descent_that_does_not_end_says_so(monkeypatch):
    monkeypatch.setattr(levenberg, "STEPS", 2)
    with pytest.raises(OptimisationError, match="did not settle in 2 steps") as caught:
        descend(rosenbrock(), np.array([-1.2, 1.0]))
    assert caught.value.status == 2


def test_interval_ending_at_another_parameters_bound_says_so():
    """chi2 = (u_0 + u_1)^2 + (u_0 / 10)^2: u_1 makes up for u_0 until it meets its bound of 2."""
    tied = Made(lambda u: [u[0] + u[1], 0.1 * u[0]], lambda u: [[1.0, 1.0], [0.1, 0.0]], [-50.0, -2.0], [50.0, 2.0])
    covariance = np.linalg.inv(np.array([[1.01, 1.0], [1.0, 1.0]]))
    found = interval(tied, Best(np.zeros(2), 0.0, covariance), 0)
    assert found.pinned == (1,)
    assert found.closed_low
    assert found.closed_high
    assert found.high == pytest.approx((4.0 + np.sqrt(16.0 - 4.0 * 1.01 * (4.0 - NORMAL_95**2))) / 2.02, rel=1e-2)
    wide = Made(tied.residual, tied.jacobian, [-50.0, -40.0], [50.0, 40.0])
    assert interval(wide, Best(np.zeros(2), 0.0, covariance), 0).pinned == ()


def test_a_jump_of_chi2_ends_the_interval():
    step = Made(lambda u: [0.0 if abs(u[0]) < 0.5 else 10.0], lambda u: [[0.0]], [-1.0], [1.0])
    found = interval(step, Best(np.array([0.0]), 0.0, np.array([[0.01]])), 0)
    assert (found.low, found.high) == pytest.approx((-0.5, 0.5), abs=0.01)
    assert found.closed_low
    assert found.closed_high


def test_a_profile_that_does_not_end_says_so(monkeypatch):
    monkeypatch.setattr(profile, "TRIES", 1)
    curved = Made(lambda u: [np.expm1(u[0])], lambda u: [[np.exp(u[0])]], [-9.0], [9.0])
    with pytest.raises(OptimisationError, match="profile of x was not followed to its end in 1 refits"):
        interval(curved, Best(np.array([0.0]), 0.0, np.array([[1.0]])), 0)


def test_profile_that_finds_a_lower_minimum_moves_the_fit():
    problem = build(points(), Soil(), ("k", "phi"), {})
    u = problem.space.start()
    wrong = Best(u, problem.chi2(u), np.eye(2))
    with pytest.raises(LowerMinimum):
        interval(problem, wrong, 0)
    best, _ = fit._intervals(problem, wrong)
    assert problem.space.values(best.u)[0] == pytest.approx(0.005, rel=1e-3)


def test_a_fit_that_keeps_falling_says_so(monkeypatch):
    monkeypatch.setattr(fit, "POLISHES", 0)
    with pytest.raises(OptimisationError, match="chi2 still falls after 0 profiles"):
        fit.identify(points(), Soil())
