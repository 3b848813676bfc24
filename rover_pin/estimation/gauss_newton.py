"""Gauss-Newton with slopes by differences that are reused: where robust chi2 and the priors are least."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rover_pin.estimation.experiment import Arrays
from rover_pin.estimation.noise import huber_weights
from rover_pin.estimation.parameter import Parameter, bounds_of
from rover_pin.estimation.task import Task, objective

TURNS = 6
SETTLED = 0.3
"""A turn that lowers chi2 by less than this is the last."""
RENEWALS = 2
"""How often the slopes are computed again within a fit, at most."""
TO_THE_END = 40, 12
"""Turns and renewals of a fit that is to reach its end: down a bent valley each step is short."""
SHORTER = 1 / 3, 1 / 9
"""Shares of a step that are tried in turn where the whole does not help."""
DAMPED = 1e1, 1e2, 1e3, 1e4, 1e5
"""What is added to the curvature along every u, a prior's is 1, where no shorter step helps a fit to its end."""
ADDS_UP = 0.1
"""Share by which the change of all numbers together may differ from the sum of all, besides a step of each. Why: 1e-5
of steps of 1e-5, where it is smooth."""
STALE = 0.5
"""Share of the promised gain below which a Jacobian is computed again."""


State = tuple[np.ndarray, np.ndarray, float]
Steps = list[np.ndarray]


def at(task: Task, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> Any:
    """Return the model with the parameters at u."""
    return task.experiment.with_values(
        model, {parameter.name: parameter.value(x) for parameter, x in zip(parameters, u, strict=True)}
    )


def slopes_at(task: Task, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> dict[str, np.ndarray]:
    """Return d predicted / d u by name: exact where the experiment knows them, else one-sided differences.

    They are none where a prediction jumps, as that of a wheel that just stops may: two steps of all numbers together
    do not move it by twice the sum of what single steps do.
    """
    if task.experiment.is_exact:
        exact = task.experiment.sensitivities(model, parameters, u).slopes
        return dict(zip([parameter.name for parameter in parameters], exact, strict=True))
    model_at_u = at(task, model, parameters, u)
    step = task.experiment.difference
    steps = [step if x + step <= parameter.bounds[1] else -step for parameter, x in zip(parameters, u, strict=True)]
    rows = list(zip(parameters, u, steps, strict=True))
    single = [{parameter.name: parameter.value(x + change)} for parameter, x, change in rows]
    together = {parameter.name: parameter.value(x + 2.0 * change) for parameter, x, change in rows}
    models = [task.experiment.with_values(model_at_u, values) for values in (*single, together)]
    centre, *predictions, both = task.experiment.predict_near([model_at_u, *models])
    changes = np.array(predictions) - centre
    share = ADDS_UP + step * len(steps)
    is_smooth = np.abs(both - centre - 2.0 * changes.sum(axis=0)) <= 2.0 * share * np.abs(changes).sum(axis=0)
    return {
        parameter.name: np.where(is_smooth, difference / change, 0.0)
        for (parameter, _, change), difference in zip(rows, changes, strict=True)
    }


def priors(parameters: Sequence[Parameter]) -> np.ndarray:
    """Return the curvature that the priors give chi2 / 2; next to none where there is none."""
    return np.diag([1.0 if parameter.prior else 1e-9 for parameter in parameters])


def descent_end(
    task: Task,
    model: Any,
    parameters: Sequence[Parameter],
    start: np.ndarray | None,
    given_slopes: Mapping[str, np.ndarray],
    options: tuple[bool, bool],
) -> Arrays:
    """Return where the descent ends: u, the prediction, and the slopes of the parameters.

    The last step promises less than SETTLED and is taken by the slopes alone.
    """
    reuse, stale = options
    u = np.zeros(len(parameters)) if start is None else np.array(start, dtype=float)
    u = np.clip(u, *bounds_of(parameters).T)
    missing = [at for at, parameter in enumerate(parameters) if parameter.name not in given_slopes]
    renewable = missing if reuse else list(range(len(parameters)))
    predicted = task.experiment.predict([at(task, model, parameters, u)])[0]
    slopes = np.zeros((len(parameters), *predicted.shape))
    for table, parameter in zip(slopes, parameters, strict=True):
        table[:] = given_slopes.get(parameter.name, 0.0)
    _renew(slopes, missing, task, model, parameters, u)
    state, fresh = (u, predicted, objective(task.rows(predicted), u, parameters)), len(missing) == len(renewable)
    (turns, renewals), damped = (TO_THE_END, DAMPED) if stale else ((TURNS, RENEWALS), ())
    for _ in range(turns):
        u, predicted, was = state
        steps, promised = _steps(task.columns(slopes), task.rows(predicted), u, parameters, damped)
        if promised < SETTLED and (fresh or not stale):
            state = u + steps[0][0], predicted + np.tensordot(steps[0][0], slopes, 1), was - promised
            break
        state = _search(task, model, parameters, state, steps if promised >= SETTLED else ())
        gained = was - state[2]
        if gained >= max(STALE * promised, SETTLED):
            fresh = not renewable
            continue
        settled = gained < SETTLED if fresh else promised - gained < SETTLED and not stale
        if settled or not renewals:
            break
        _renew(slopes, renewable, task, model, parameters, state[0])
        fresh, stale, renewals = True, False, renewals - 1
    return {"u": state[0], "predicted": state[1], "slopes": slopes}


def _renew(
    slopes: np.ndarray, which: list[int], task: Task, model: Any, parameters: Sequence[Parameter], u: np.ndarray
) -> None:
    """Put the slopes of some of the parameters, the others at u, in the place of those that they had."""
    if which:
        some = [parameters[index] for index in which]
        slopes[which] = [*slopes_at(task, at(task, model, parameters, u), some, u[which]).values()]


def _steps(
    columns: np.ndarray, rows: np.ndarray, u: np.ndarray, parameters: Sequence[Parameter], damped: Sequence[float]
) -> tuple[list[Steps], float]:
    """Return the Gauss-Newton step in the bounds, then shorter ones, then damped ones, and the gain of the first."""
    bounds = bounds_of(parameters)
    weights, prior = huber_weights(rows), priors(parameters)
    normal = columns.T @ (columns * weights[:, None]) + prior
    right = -(columns.T @ (weights * rows)) - np.where(np.diag(prior) == 1.0, u, 0.0)
    step, *others = (_bounded_step(normal + damping * np.eye(len(u)), right, u, bounds) for damping in (0.0, *damped))
    groups = [[step], *([share * step] for share in SHORTER), *([others] if others else [])]
    return groups, float(2 * right @ step - step @ normal @ step)


def _bounded_step(normal: np.ndarray, right: np.ndarray, u: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Return the step that solves normal step = right; numbers that would leave their bounds are held there."""
    step, free = np.zeros(len(u)), np.ones(len(u), dtype=bool)
    for _ in range(len(u)):
        fixed_step = np.where(free, 0.0, step)
        step = fixed_step.copy()
        step[free] = np.linalg.lstsq(normal[np.ix_(free, free)], right[free] - (normal @ fixed_step)[free], rcond=None)[
            0
        ]
        clipped = np.clip(u + step, bounds[:, 0], bounds[:, 1]) - u
        out = free & (np.abs(clipped - step) > 1e-12)
        if not out.any():
            break
        step, free = np.where(out, clipped, step), free & ~out
    return np.asarray(np.clip(u + step, bounds[:, 0], bounds[:, 1]) - u)


def _search(task: Task, model: Any, parameters: Sequence[Parameter], current: State, steps: Sequence[Steps]) -> State:
    """Return the lowest of where the first of these groups of steps leads that helps, or where it was."""
    for group in steps:
        best = _lowest(task, model, parameters, current, group)
        if best is not current:
            return best
    return current


def _lowest(
    task: Task, model: Any, parameters: Sequence[Parameter], current: State, steps: Sequence[np.ndarray]
) -> State:
    """Return the lowest of where these steps lead, or where it was; they are predicted together."""
    trials = [current[0] + step for step in steps]
    predictions = task.experiment.predict([at(task, model, parameters, trial) for trial in trials])
    reached = [
        (trial, predicted, objective(task.rows(predicted), trial, parameters))
        for trial, predicted in zip(trials, predictions, strict=True)
    ]
    return min([current, *reached], key=lambda state: state[2])
