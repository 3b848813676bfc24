"""A small Levenberg-Marquardt descent inside bounds, for the many short refits of a profile likelihood.

`scipy.optimize.least_squares` does the global work; near a minimum its overhead is thirty times that of the model.
"""

from __future__ import annotations

import numpy as np

from rover_pin.errors import OptimisationError
from rover_pin.evidence.problem import Problem

STEPS = 200
"""Most trial steps of one descent."""

GAIN = 1e-6
"""A descent ends where a full step would lower chi2 by less than this."""


def descend(problem: Problem, u: np.ndarray, held: int | None = None) -> tuple[np.ndarray, float]:
    """Return the u and chi2 of the nearest minimum inside the bounds, with coordinate `held` kept.

    Raises
    ------
    OptimisationError
        The model has no value at the start, or the descent did not end; `status` is the number of steps.
    """
    low, high = problem.space.low, problem.space.high
    residual, jacobian = problem.evaluate(u)
    chi2 = float(residual @ residual)
    if not np.isfinite(chi2):
        raise OptimisationError("the model has no finite value where the descent starts; start elsewhere.", status=0)
    damping = 1e-4
    for _ in range(STEPS):
        gradient, hessian = jacobian.T @ residual, jacobian.T @ jacobian
        step, promised = _step(gradient, hessian, damping, _movable(u, gradient, low, high, held), (u <= low, u >= high))
        if promised < GAIN and damping < 1:
            return u, chi2
        trial = _bounded(u, step, low, high)
        trial_residual, trial_jacobian = problem.evaluate(trial)
        trial_chi2 = float(trial_residual @ trial_residual)
        if trial_chi2 < chi2:
            u, chi2, residual, jacobian = trial, trial_chi2, trial_residual, trial_jacobian
            damping = max(damping / 9, 1e-12)
        elif damping > 1e10:
            return u, chi2
        else:
            damping *= 7
    raise OptimisationError(f"a refit did not settle in {STEPS} steps (chi2 = {chi2:g}); free fewer.", status=STEPS)


def _movable(u: np.ndarray, gradient: np.ndarray, low: np.ndarray, high: np.ndarray, held: int | None) -> np.ndarray:
    """Return which coordinates may move: not held, and not pressed against a bound."""
    free: np.ndarray = ~(((u <= low) & (gradient > 0)) | ((u >= high) & (gradient < 0)))
    if held is not None:
        free[held] = False
    return free


def _step(
    gradient: np.ndarray, hessian: np.ndarray, damping: float, free: np.ndarray, at: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, float]:
    """Return the damped step, which leaves no bound it stands `at` (low, high), and how much chi2 it promises to fall."""
    step = np.zeros(len(gradient))
    while free.any():
        block = hessian[np.ix_(free, free)]
        scale = np.maximum(np.diag(block), 1e-12)
        step[:] = 0.0
        step[free] = -np.linalg.solve(block + np.diag(damping * scale), gradient[free])
        leaving = (at[0] & (step < 0)) | (at[1] & (step > 0))
        if not leaving.any():
            return step, float(-step @ gradient)
        free = free & ~leaving
    return np.zeros(len(gradient)), 0.0


def _bounded(u: np.ndarray, step: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return u + step, shortened as a whole to end on the first bound it meets: a clipped step would leave the valley."""
    room = np.where(step < 0, low - u, high - u)
    share = np.divide(room, step, out=np.full(len(u), np.inf), where=step != 0)
    first = int(np.argmin(share))
    if share[first] >= 1:
        return u + step
    trial = np.clip(u + share[first] * step, low, high)
    trial[first] = (low if step[first] < 0 else high)[first]
    return trial
