"""Fitting a model to an experiment: Gauss-Newton with Jacobian reuse, what is declared of each number as its prior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_pin.errors import OptimisationError
from rover_pin.estimation.descent import descend
from rover_pin.estimation.exact import ExactProblem
from rover_pin.estimation.experiment import Arrays
from rover_pin.estimation.noise import huber, huber_weights
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.residual import residual
from rover_pin.estimation.task import Task, objective

TURNS = 6
SETTLED = 0.3
"""A turn that lowers chi2 by less than this is the last."""
RENEWALS = 2
"""How often the slopes are computed again within a fit, at most."""
TO_THE_END = 40, 12
"""Turns and renewals of a fit that is to reach its end: down a bent valley each step is short."""
SHORTER = 1 / 3, 1 / 9
"""Shares of a step that are tried where the whole does not help."""
DAMPED = 1e1, 1e2, 1e3, 1e4, 1e5
"""What is added to the curvature along every u, a prior's is 1, in a fit to its end that keeps too little promise."""
STRETCH = 8
"""Blocks that are taken to hang together: 4 s, longer than what is left remembers."""
ROUND_OFF = 1e-13
"""Least eigenvalue of a scaled normal matrix that is not taken for round-off."""
STALE = 0.5
"""Share of the promised gain below which a Jacobian is computed again."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to an experiment. `slopes` are d predicted / d u by name of the parameter."""

    task: Task = field(repr=False)
    model: Any = field(repr=False)
    parameters: tuple[Parameter, ...] = field(repr=False)
    u: np.ndarray
    predicted: np.ndarray = field(repr=False)
    slopes: Mapping[str, np.ndarray] = field(repr=False)

    @property
    def residual(self) -> np.ndarray:
        """Residuals of the features (runs, channels, blocks), in the channels' units."""
        return residual(self.task.experiment.observed, self.predicted)

    @property
    def rows(self) -> np.ndarray:
        """Whitened residuals."""
        return self.task.rows(self.predicted)

    @property
    def chi2(self) -> float:
        """Robust sum of squares of the rows and of the priors' u."""
        return objective(self.rows, self.u, self.parameters)

    @property
    def misfit(self) -> float:
        """Reduced chi-square: robust chi2 of the rows over their degrees of freedom; 1 is the noise."""
        return huber(self.rows) / self.freedom

    @property
    def freedom(self) -> int:
        """Compared blocks minus numbers without a prior."""
        return max(self.task.noise.count - sum(not one.prior for one in self.parameters), 1)

    @property
    def columns(self) -> np.ndarray:
        """d rows / d u as a matrix (n, parameters)."""
        return self.task.columns([self.slopes[one.name] for one in self.parameters])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of u: (J^T W J + priors)^-1."""
        return covariance(self.columns, self.rows, self.parameters)

    @property
    def spread(self) -> np.ndarray:
        """SD of each u: of the model, inflated as its noise says and by a misfit above 1, or of stretches if larger.

        The last is the sandwich H (sum g g^T) H with H the covariance and g the slope of chi2 / 2 of one stretch of
        one run: it holds where rows of a stretch hang together beyond what the noise knows.
        Source: White, Econometrica 48 (1980); Liang and Zeger, Biometrika 73 (1986).
        """
        plain = np.diag(self.covariance) * self.task.noise.inflation * max(self.misfit, 1.0)
        return np.asarray(np.sqrt(np.maximum(plain, np.diag(self._clustered()))))

    def _clustered(self) -> np.ndarray:
        good, rows, columns = self.task.noise.good, self.rows, self.columns
        stretch = np.arange(good.shape[2]) // STRETCH
        owner = np.arange(good.shape[0])[:, None, None] * (stretch[-1] + 1) + stretch[None, None, :]
        each = np.broadcast_to(owner, good.shape)[good]
        pushed = columns * (huber_weights(rows) * rows)[:, None]
        sums = np.array([pushed[each == one].sum(axis=0) for one in np.unique(each)])
        few = len(sums) / max(len(sums) - 1, 1)
        spread = self.covariance
        return np.asarray(spread @ (few * sums.T @ sums + _priors(self.parameters)) @ spread)

    def value(self, name: str) -> float:
        """Return the fitted value of a parameter [SI]."""
        at = [one.name for one in self.parameters].index(name)
        return self.parameters[at].value(self.u[at])


def covariance(columns: np.ndarray, rows: np.ndarray, parameters: Sequence[Parameter]) -> np.ndarray:
    """Return (J^T W J + priors)^-1."""
    weighted = columns * huber_weights(rows)[:, None]
    return _inverse(columns.T @ weighted + _priors(parameters))


def _inverse(normal: np.ndarray) -> np.ndarray:
    """Return the inverse of a positive matrix; a direction that nothing tells gets a huge variance, never none."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    return np.asarray((vectors / np.maximum(values, ROUND_OFF)) @ vectors.T / np.outer(size, size))


def _priors(parameters: Sequence[Parameter]) -> np.ndarray:
    return np.diag([1.0 if one.prior else 1e-9 for one in parameters])


def at(task: Task, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> Any:
    """Return the model with the parameters at u."""
    return task.experiment.with_values(model, {one.name: one.value(x) for one, x in zip(parameters, u, strict=True)})


def slopes_at(task: Task, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> dict[str, np.ndarray]:
    """Return d predicted / d u by name: exact where the experiment knows them, else one-sided differences."""
    if task.experiment.is_exact:
        exact = task.experiment.sensitivities(model, parameters, u).slopes
        return dict(zip([one.name for one in parameters], exact, strict=True))
    here = at(task, model, parameters, u)
    moved = {one.name: _moved(one, x) for one, x in zip(parameters, u, strict=True)}
    shifted = [task.experiment.with_values(here, {name: value}) for name, (value, _) in moved.items()]
    centre, *features = task.experiment.predict([here, *shifted])
    return {name: (each - centre) / step for (name, (_, step)), each in zip(moved.items(), features, strict=True)}


def _moved(one: Parameter, u: float) -> tuple[float, float]:
    """Return the value moved by the step of a difference, inside the bounds, and the step of u."""
    step = one.fd if u + one.fd <= one.bounds[1] else -one.fd
    return one.value(u + step), step


def fit(
    task: Task,
    model: Any,
    parameters: Sequence[Parameter],
    start: np.ndarray | None = None,
    slopes: Mapping[str, np.ndarray] | None = None,
    reuse: bool = False,
    stale: bool = False,
) -> Fit:
    """Return the model with the parameters fitted.

    Descends robust chi2(rows) + sum of the priors' u^2 by Gauss-Newton with Huber weights. Slopes serve, the given ones
    first, until a step lowers the objective by less than STALE of what it promised; then they are computed again, with
    `reuse` only those that were not given. The fit ends where no step of new slopes helps, or after TURNS and RENEWALS;
    given slopes that are `stale` only start it, new ones end it, and it may go on for longer, TO_THE_END. A fit that
    the experiment has kept is not made again. Where the experiment is exact, `descend` ends at a minimum, and what is
    known of slopes is not needed.

    Raises
    ------
    OptimisationError
        A descent with exact slopes does not end.
    """
    if task.experiment.is_exact:
        return _exactly(task, model, parameters, np.zeros(len(parameters)) if start is None else start)
    given = dict(slopes or {})
    asked = (task.noise, model, tuple(parameters), start, given, reuse, stale)
    found = task.experiment.kept(asked, lambda: _descended(task, model, parameters, start, given, (reuse, stale)))
    u, renewed = found["u"], [parameters[one].name for one in found["renewed"]]
    known = given | dict(zip(renewed, found["slopes"], strict=True))
    return Fit(task, at(task, model, parameters, u), tuple(parameters), u, found["predicted"], known)


def best_of(task: Task, model: Any, parameters: Sequence[Parameter], starts: Sequence[np.ndarray]) -> Fit | None:
    """Return the lowest of the fits from several starts, or None where none of them ends."""
    found = []
    for start in starts:
        try:
            found.append(fit(task, model, parameters, start))
        except OptimisationError:
            continue
    return min(found, key=lambda one: one.chi2, default=None)


def _exactly(task: Task, model: Any, parameters: Sequence[Parameter], start: np.ndarray) -> Fit:
    problem = ExactProblem(task, model, parameters)
    try:
        u, _ = descend(problem, np.clip(start, problem.space.low, problem.space.high))
    except np.linalg.LinAlgError as error:
        raise OptimisationError(f"a refit met a singular problem ({error}); free fewer.", status=str(error)) from error
    predicted, slopes = problem.sensitivities(u)
    known = dict(zip(problem.space.names, slopes, strict=True))
    return Fit(task, at(task, model, parameters, u), tuple(parameters), u, predicted, known)


def _descended(
    task: Task,
    model: Any,
    parameters: Sequence[Parameter],
    start: np.ndarray | None,
    given: Mapping[str, np.ndarray],
    how: tuple[bool, bool],
) -> Arrays:
    """Return where the descent ends: u, the prediction, and the slopes of the parameters that it computed."""
    reuse, stale = how
    u = np.zeros(len(parameters)) if start is None else np.array(start, dtype=float)
    u = np.clip(u, *np.array([one.bounds for one in parameters]).T) if len(u) else u
    known = dict(given)
    own = [one for one, _ in enumerate(parameters) if not (reuse and parameters[one].name in known)]
    missing = [one for one, each in enumerate(parameters) if each.name not in known]
    known |= _slopes(task, model, parameters, u, missing)
    predicted = task.experiment.predict([at(task, model, parameters, u)])[0]
    was, fresh = objective(task.rows(predicted), u, parameters), len(missing) == len(own)
    (turns, renewals), damped, enough = (TO_THE_END, DAMPED, STALE) if stale else ((TURNS, RENEWALS), (), 0.0)
    for _ in range(turns):
        columns = task.columns([known[one.name] for one in parameters])
        steps, promised = _steps(columns, task.rows(predicted), u, parameters, damped)
        tried = steps if promised >= SETTLED else steps[:1]
        u, predicted, now = _searched(task, model, parameters, (u, predicted, was), tried, enough * promised)
        gained, was = was - now, now
        if gained >= max(STALE * promised, SETTLED):
            fresh = False
            continue
        stuck = gained < SETTLED if fresh else promised < SETTLED and not stale
        if stuck or not renewals:
            break
        known |= _slopes(task, model, parameters, u, own)
        fresh, stale, renewals = True, False, renewals - 1
    renewed = [one for one, each in enumerate(parameters) if known[each.name] is not given.get(each.name)]
    computed = [known[parameters[one].name] for one in renewed]
    whole = np.array(computed) if computed else np.zeros((0, *predicted.shape))
    return {"u": u, "predicted": predicted, "renewed": np.array(renewed, dtype=int), "slopes": whole}


def _slopes(
    task: Task, model: Any, parameters: Sequence[Parameter], u: np.ndarray, which: Sequence[int]
) -> dict[str, np.ndarray]:
    """Return the slopes of some of the parameters, the others at u."""
    if not which:
        return {}
    here = at(task, model, parameters, u)
    return slopes_at(task, here, [parameters[one] for one in which], u[list(which)])


def _steps(
    columns: np.ndarray,
    rows: np.ndarray,
    u: np.ndarray,
    parameters: Sequence[Parameter],
    damped: Sequence[float] = (),
) -> tuple[list[np.ndarray], float]:
    """Return the Gauss-Newton step in the bounds, shorter and damped ones, and the gain that the first promises."""
    bounds = np.array([one.bounds for one in parameters])
    weights, prior = huber_weights(rows), _priors(parameters)
    normal = columns.T @ (columns * weights[:, None]) + prior
    right = -(columns.T @ (weights * rows)) - np.where(np.diag(prior) == 1.0, u, 0.0)
    step, *others = (_bounded_step(normal + one * np.eye(len(u)), right, u, bounds) for one in (0.0, *damped))
    return [step, *(share * step for share in SHORTER), *others], float(2 * right @ step - step @ normal @ step)


def _bounded_step(normal: np.ndarray, right: np.ndarray, u: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Return the step that solves normal step = right; numbers that would leave their bounds are held there."""
    step, free = np.zeros(len(u)), np.ones(len(u), dtype=bool)
    for _ in range(len(u)):
        held = np.where(free, 0.0, step)
        step = held.copy()
        step[free] = np.linalg.lstsq(normal[np.ix_(free, free)], right[free] - (normal @ held)[free], rcond=None)[0]
        clipped = np.clip(u + step, bounds[:, 0], bounds[:, 1]) - u
        out = free & (np.abs(clipped - step) > 1e-12)
        if not out.any():
            break
        step, free = np.where(out, clipped, step), free & ~out
    return np.asarray(np.clip(u + step, bounds[:, 0], bounds[:, 1]) - u)


State = tuple[np.ndarray, np.ndarray, float]


def _searched(
    task: Task,
    model: Any,
    parameters: Sequence[Parameter],
    here: State,
    steps: Sequence[np.ndarray],
    enough: float,
) -> State:
    """Return where the first step leads, or, if that gains no more than `enough`, the lowest of where all lead."""
    best = _lowest(task, model, parameters, here, steps[:1])
    if len(steps) == 1 or here[2] - best[2] > enough:
        return best
    return min(best, _lowest(task, model, parameters, here, steps[1:]), key=lambda state: state[2])


def _lowest(task: Task, model: Any, parameters: Sequence[Parameter], here: State, steps: Sequence[np.ndarray]) -> State:
    """Return the lowest of where these steps lead, or where it was; they are predicted together."""
    trials = [here[0] + step for step in steps]
    found = task.experiment.predict([at(task, model, parameters, trial) for trial in trials])
    reached = [
        (trial, predicted, objective(task.rows(predicted), trial, parameters))
        for trial, predicted in zip(trials, found, strict=True)
    ]
    return min([here, *reached], key=lambda state: state[2])
