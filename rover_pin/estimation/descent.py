"""Levenberg-Marquardt descent with a trust radius and with bounds of the parameters, which every fit uses.

The derivatives of the prediction may be exact, or may be reused from an earlier point. With an exact Jacobian the
descent reaches the minimum of `scipy.optimize.least_squares` from equal starts, with fewer evaluations of the model
(tests/estimation/test_descent.py). In this module, u are the parameters in units of their prior SD, and rows are the
residuals whose squares are summed to chi2. The predicted decrease of a step is the decrease of chi2 that the linear
model around the present point predicts for this step.
"""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import OptimisationError

MAX_STEPS = 400
"""Maximum number of trial steps of a descent that was given no maximum of its own. Beyond this value, the descent
raises OptimisationError: a descent that takes 400 steps is assumed not to converge."""

MIN_FALL = 1e-6
"""Minimum predicted decrease of chi2 by a full Newton step. With a smaller one, the descent ends. The value is far
below the differences of chi2 that matter (about 0.1), so that the end is a minimum for every purpose."""

MAX_IDLE_STEPS = 3
"""Number of useless steps in a row after which the descent ends.

A step is useless if it lowers chi2 by less than `gain` (an argument of `descend`), or if it fails and had a predicted
decrease of less than `gain`. After one useless step, a better one may follow; after three, rounding dominates."""

MIN_RADIUS = 1e-10
"""Minimum trust radius in u. With a smaller one, the descent ends. Shorter steps change a parameter by less than 1e-10
prior SDs, which is rounding."""

MIN_SHARE_OF_PROMISE = 0.5
"""Minimum ratio of the actual to the predicted decrease of chi2 in a step. Below this value, reused derivatives count
as wrong and are computed again. The value is assumed."""


class Point(NamedTuple):
    """A point of a descent: the parameters u, the residuals there (rows), and their Jacobian by u.

    `predicted` and `slopes` are the prediction and its derivatives by u, which rows and Jacobian were computed from.
    Shapes: u (parameters,), rows (n,), jacobian (n, parameters); the shapes of `predicted` and `slopes` depend on the
    problem.
    """

    u: np.ndarray
    rows: np.ndarray
    jacobian: np.ndarray
    predicted: np.ndarray
    slopes: np.ndarray

    @property
    def chi2(self) -> float:
        """Sum of the squared rows, which the descent minimises."""
        return float(self.rows @ self.rows)

    def promised_fall(self, step: np.ndarray) -> float:
        """Return the predicted decrease of chi2 for a step (parameters,) in u: the decrease if the rows were linear in
        u.
        """
        along = self.jacobian @ step
        return float(-(2 * self.rows + along) @ along)


class Problem(ABC):
    """Interface of a least-squares problem for `descend`.

    A problem states its residuals (rows) for given parameters u; the descent minimises the sum of their squares.
    `bounds` (parameters, 2) are the lower and the upper bound of each parameter.
    """

    bounds: np.ndarray

    @abstractmethod
    def evaluate(self, u: np.ndarray) -> Point:
        """Return the rows and their Jacobian at u. A problem that reuses derivatives may return the Jacobian of an
        earlier u.
        """

    def renew(self, point: Point, is_end: bool) -> Point | None:
        """Compute the derivatives at this point again and return the new point; return None if that is not needed or
        not allowed.

        The descent calls this method after a step that lowered chi2 by much less than predicted, and at its end
        (`is_end` is True then). This default is for problems with exact derivatives, which never need to be computed
        again.
        """
        return None


def descend(problem: Problem, start: np.ndarray, gain: float = MIN_FALL, most: int = 0) -> Point:
    """Minimise the sum of squares of a least-squares problem from a start, inside its bounds, and return the end point.

    Parameters
    ----------
    problem : Problem
        Rows, Jacobian and bounds.
    start : array (parameters,)
        Start values of u; a value beyond a bound is moved onto this bound.
    gain : float
        The descent ends if the predicted decrease of chi2 for a full step is smaller than `gain`, or if each of
        MAX_IDLE_STEPS successive steps lowers chi2 by less than `gain`.
    most : int
        Maximum number of steps, after which the best point so far is returned. With 0, the maximum is MAX_STEPS, and a
        descent that needs more steps raises an error.

    Raises
    ------
    OptimisationError
        The model has no finite value at the start, or the descent did not end; `status` is the number of steps.

    Reused derivatives are computed again if chi2 falls by less than MIN_SHARE_OF_PROMISE of the predicted decrease, or
    if three steps in a row fail. After a step that did not lower chi2, the predicted decrease of the full step is used
    for this comparison, because the predicted decrease of a short step is small.
    """
    low, high = problem.bounds.T
    point = problem.evaluate(np.clip(start, low, high))
    if not np.isfinite(point.chi2):
        raise OptimisationError(
            "the model has no finite value where the descent starts; give other start values of its parameters.",
            status=0,
        )
    radius, idle, failed, is_short = 1.0, 0, 0, False
    for _ in range(most or MAX_STEPS):
        # `newton` is True if the step lies within the trust radius without damping, so that it leads to the linear
        # model's minimum.
        step, newton = _step(point, radius, (low, high))
        # The descent ends if the predicted decrease of the full step is too small. `is_off`: the slopes are wrong.
        is_end, is_off = newton and point.promised_fall(step) < gain, False
        if not is_end:
            trial = problem.evaluate(_step_to_bound(point.u, step, low, high))
            fall, promised = point.chi2 - trial.chi2, point.promised_fall(trial.u - point.u)
            # The usual limits of trust-region methods: if the decrease of chi2 is below 25 % of the predicted one, the
            # linear model reaches too far, and the radius becomes a quarter of the step's length. Above 75 % the model
            # may reach farther, and the radius becomes at least twice this length.
            length = float(np.linalg.norm(trial.u - point.u))
            if not fall > promised / 4:
                radius = length / 4
            elif fall > 0.75 * promised:
                radius = max(radius, 2 * length)
            is_short = is_short or not fall > 0
            # After a failed step, the radius is short and its predicted decrease small, so that the slopes are judged
            # by the predicted decrease of the full step.
            hoped = point.promised_fall(full_step(problem, point)) if is_short else promised
            # Count the useless steps in a row: a step that lowers chi2 by little is idle, a step that raises chi2 has
            # failed.
            idle = 0 if fall >= gain else idle + (fall > 0)
            failed = 0 if fall > 0 else failed + 1
            point = trial if fall > 0 else point
            # Ends: the radius is rounding, three steps brought little, or three steps failed that promised little.
            is_end = radius < MIN_RADIUS or idle == MAX_IDLE_STEPS or (failed >= MAX_IDLE_STEPS and promised < gain)
            # The derivatives count as wrong if the decrease of chi2 falls short of the predicted one by more than the
            # allowed part.
            is_off = (fall > 0 or failed >= MAX_IDLE_STEPS) and hoped - fall > max(
                gain, (1.0 - MIN_SHARE_OF_PROMISE) * hoped
            )
        # With new slopes the descent goes on from the same point, with the initial trust radius.
        renewed = problem.renew(point, is_end) if is_end or is_off else None
        if renewed is not None:
            point, radius, idle, failed, is_short = renewed, 1.0, 0, 0, False
        elif is_end:
            return point
    if most:
        return point
    raise OptimisationError(
        f"the fit did not settle in {MAX_STEPS} steps (chi2 = {point.chi2:g}); fit fewer parameters.", status=MAX_STEPS
    )


def full_step(problem: Problem, point: Point) -> np.ndarray:
    """Return the full Newton step (parameters,) in u from a point, without a trust radius.

    A step that would cross a bound is shortened so that it ends on the first bound that it reaches.
    """
    low, high = problem.bounds.T
    return _step_to_bound(point.u, _step(point, np.inf, (low, high))[0], low, high) - point.u


def _step(point: Point, radius: float, limits: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, bool]:
    """Return the best step in u that is not longer than `radius`, and whether this step is the full Newton step.

    Parameters that lie at a bound and would leave it are held there. `limits` are the lower and the upper bounds of u.
    """
    (low, high), u = limits, point.u
    # A number at a bound stays there if chi2 falls beyond the bound. Numbers whose step would leave their bound are
    # fixed one after the other until no such step remains.
    gradient = point.jacobian.T @ point.rows
    free = ~((u <= low) & (gradient > 0))
    free &= ~((u >= high) & (gradient < 0))
    while free.any():
        step = np.zeros(len(u))
        step[free], newton = _damped_step(point.jacobian[:, free], point.rows, radius)
        leaving = ((u <= low) & (step < 0)) | ((u >= high) & (step > 0))
        if not leaving.any():
            return step, newton
        free &= ~leaving
    return np.zeros(len(u)), True


def _damped_step(jacobian: np.ndarray, residual: np.ndarray, radius: float) -> tuple[np.ndarray, bool]:
    """Return the Levenberg-Marquardt step -(J^T J + d)^-1 J^T r for the Jacobian J and the residual r, and whether d is
    0.

    The damping d is the smallest one that makes the step at most 1 % longer than `radius`. With d = 0 the step is the
    full Newton step.
    """
    # Singular values of rounding are raised, so that a parameter without any slope gets a finite step.
    U, values, directions = np.linalg.svd(jacobian, full_matrices=False)
    values = np.maximum(values, 1e-12 * max(values[0], 1e-300))
    share = values * (U.T @ residual)
    damping, length = 0.0, float(np.linalg.norm(share / values**2))
    newton = length <= radius
    # Newton's method on 1 / length, which converges from below (More, Lect. Notes Math. 630 (1978) 105).
    while length > 1.01 * radius:
        slope = float(np.sum(share**2 / (values**2 + damping) ** 3)) / length
        damping += (length - radius) / radius * length / slope
        length = float(np.linalg.norm(share / (values**2 + damping)))
    return -directions.T @ (share / (values**2 + damping)), newton


def _step_to_bound(u: np.ndarray, step: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the point u + step; a step that crosses bounds is shortened to end on the first bound that it crosses.

    Moving only the parameter that crosses its bound back onto the bound would change the direction of the step, and
    leave the valley of chi2.
    """
    # Distance of each parameter to the bound towards which it moves, as a fraction of its step.
    room = np.where(step < 0, low - u, high - u)
    share = np.divide(room, step, out=np.full(len(u), np.inf), where=step != 0)
    if share.min(initial=np.inf) >= 1:
        return u + step
    first = int(np.argmin(share))
    trial = np.clip(u + share[first] * step, low, high)
    # The parameter is set to its bound exactly, because rounding could leave it just inside and the bound would not be
    # recognised.
    trial[first] = (low if step[first] < 0 else high)[first]
    return trial
