"""The one descent of every fit: Levenberg-Marquardt with a trust radius and bounds, its slopes exact or reused.

With an exact Jacobian it ends, against `scipy.optimize.least_squares`, as low from the same starts in fewer evaluations
of the model and without its overhead near a minimum (tests/estimation/test_descent.py).
"""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import OptimisationError

STEPS = 400
"""Most trial steps of a descent that is to end."""

GAIN = 1e-6
"""A descent ends where a full step would lower chi2 by less than this."""

IDLE = 3
"""... or where this many steps in a row did, or lead nowhere and promise less."""

SMALLEST = 1e-10
"""... or where no step longer than this, in u, lowers chi2."""

STALE = 0.5
"""Share of the promised fall below which slopes that are reused are computed again."""


class Point(NamedTuple):
    """Where a descent is: u, rows whose squares are to sum to the least, their Jacobian, and what both are made of."""

    u: np.ndarray
    rows: np.ndarray
    jacobian: np.ndarray
    predicted: np.ndarray
    slopes: np.ndarray

    @property
    def chi2(self) -> float:
        """The sum that is to be least."""
        return float(self.rows @ self.rows)

    def promised_fall(self, step: np.ndarray) -> float:
        """Return by how much chi2 would fall along a step if the rows were linear."""
        along = self.jacobian @ step
        return float(-(2 * self.rows + along) @ along)


class Problem(ABC):
    """Rows whose squares are to sum to the least within `bounds` (numbers, 2) of u."""

    bounds: np.ndarray

    @abstractmethod
    def evaluate(self, u: np.ndarray) -> Point:
        """Return rows and Jacobian at u; slopes that are reused are those of another u."""

    def renew(self, point: Point, is_end: bool) -> Point | None:
        """Return a point with its slopes computed again there; None where they are, or serve."""
        return None


def descend(problem: Problem, start: np.ndarray, gain: float = GAIN, most: int = 0) -> Point:
    """Return the minimum nearest to a start, inside the bounds.

    It ends where a full step would lower chi2 by less than `gain`, or three steps in a row did; and after `most` steps
    where it is, if that is not 0. Slopes that are reused are computed again where chi2 falls by less than STALE of what
    the step promised (once a step failed to lower it, of what the full step promises), or three in a row fail.

    Raises OptimisationError: the model has no value at the start, or the descent did not end; `status` is the number of
    steps.
    """
    low, high = problem.bounds.T
    point = problem.evaluate(np.clip(start, low, high))
    if not np.isfinite(point.chi2):
        raise OptimisationError("the model has no finite value where the descent starts; start elsewhere.", status=0)
    radius, idle, failed, is_short = 1.0, 0, 0, False
    for _ in range(most or STEPS):
        step, newton = _step(point, radius, (low, high))
        is_end, is_off = newton and point.promised_fall(step) < gain, False
        if not is_end:
            trial = problem.evaluate(_step_to_bound(point.u, step, low, high))
            fall, promised = point.chi2 - trial.chi2, point.promised_fall(trial.u - point.u)
            radius, is_short = _next_radius(radius, trial.u - point.u, fall, promised), is_short or not fall > 0
            hoped = point.promised_fall(full_step(problem, point)) if is_short else promised
            idle = 0 if fall >= gain else idle + (fall > 0)
            failed = 0 if fall > 0 else failed + 1
            point = trial if fall > 0 else point
            is_end = radius < SMALLEST or idle == IDLE or (failed >= IDLE and promised < gain)
            is_off = (fall > 0 or failed >= IDLE) and hoped - fall > max(gain, (1.0 - STALE) * hoped)
        renewed = problem.renew(point, is_end) if is_end or is_off else None
        if renewed is not None:
            point, radius, idle, failed, is_short = renewed, 1.0, 0, 0, False
        elif is_end:
            return point
    if most:
        return point
    raise OptimisationError(
        f"a refit did not settle in {STEPS} steps (chi2 = {point.chi2:g}); free fewer.", status=STEPS
    )


def full_step(problem: Problem, point: Point) -> np.ndarray:
    """Return the step that the slopes alone ask for, as far as the first bound."""
    low, high = problem.bounds.T
    return _step_to_bound(point.u, _step(point, np.inf, (low, high))[0], low, high) - point.u


def _step(point: Point, radius: float, limits: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, bool]:
    """Return the best step of length `radius` or less that leaves no bound, and whether it is the full Newton step."""
    (low, high), u = limits, point.u
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
    """Return -(J^T J + damping)^-1 J^T r with the least damping that keeps its length within 1 % of `radius`."""
    U, values, directions = np.linalg.svd(jacobian, full_matrices=False)
    values = np.maximum(values, 1e-12 * max(values[0], 1e-300))
    share = values * (U.T @ residual)
    damping, length = 0.0, float(np.linalg.norm(share / values**2))
    newton = length <= radius
    while length > 1.01 * radius:
        slope = float(np.sum(share**2 / (values**2 + damping) ** 3)) / length
        damping += (length - radius) / radius * length / slope
        length = float(np.linalg.norm(share / (values**2 + damping)))
    return -directions.T @ (share / (values**2 + damping)), newton


def _next_radius(radius: float, step: np.ndarray, fall: float, promised: float) -> float:
    length = float(np.linalg.norm(step))
    if not fall > promised / 4:
        return length / 4
    return max(radius, 2 * length) if fall > 0.75 * promised else radius


def _step_to_bound(u: np.ndarray, step: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return u + step, shortened as a whole to end on the first bound: a clipped step would leave the valley."""
    room = np.where(step < 0, low - u, high - u)
    share = np.divide(room, step, out=np.full(len(u), np.inf), where=step != 0)
    if share.min(initial=np.inf) >= 1:
        return u + step
    first = int(np.argmin(share))
    trial = np.clip(u + share[first] * step, low, high)
    trial[first] = (low if step[first] < 0 else high)[first]
    return trial
