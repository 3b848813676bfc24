"""The least-squares problem of a model's numbers: robust chi2 of an experiment, and what is known beforehand."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rover_pin.estimation.descent import Point, Problem, descend, full_step
from rover_pin.estimation.experiment import Arrays, Differentiable
from rover_pin.estimation.noise import HUBER_THRESHOLD, huber_losses
from rover_pin.estimation.parameter import Parameter, bounds_of
from rover_pin.estimation.slopes import at, slopes_at
from rover_pin.estimation.task import Task

SETTLED = 0.3
"""A fit by differences ends where a step would lower chi2 by less than this; it takes that by its slopes alone."""
MOST, RENEWALS = 12, 2
"""Steps of a fit by differences at most, and how often its slopes are computed again."""
TO_THE_END = 60, 12
"""Steps and renewals of one that is to reach its end: down a bent valley each step is short."""


class LeastSquares(Problem):
    """Rows whose squares sum to robust chi2, then the priors' u, and their Jacobian, by exact slopes."""

    def __init__(self, task: Task, model: Any, parameters: Sequence[Parameter]):
        self.task, self.model, self.parameters = task, model, tuple(parameters)
        self.bounds = bounds_of(self.parameters)
        self._has_prior = np.array([parameter.prior for parameter in self.parameters], dtype=bool)

    def evaluate(self, u: np.ndarray) -> Point:
        """Return rows and their Jacobian at u."""
        experiment = self.task.experiment
        assert isinstance(experiment, Differentiable)
        predicted, slopes = experiment.sensitivities(self.model, self.parameters, u)
        return self._point(u, predicted, slopes, self.task.columns(slopes))

    def solution(self, start: np.ndarray) -> Arrays:
        """Return where a descent from a start ends: u, the prediction, and the slopes of the parameters.

        Raises OptimisationError: it does not end.
        """
        end = descend(self, start)
        return {"u": end.u, "predicted": end.predicted, "slopes": end.slopes}

    def _point(self, u: np.ndarray, predicted: np.ndarray, slopes: np.ndarray, columns: np.ndarray) -> Point:
        """Return rows and Jacobian; beyond HUBER_THRESHOLD SDs a row grows as the root of what it counts."""
        rows = self.task.rows(predicted)
        is_outlier = np.abs(rows) > HUBER_THRESHOLD
        root = np.sqrt(np.where(is_outlier, huber_losses(rows), 1.0))
        slope = np.where(is_outlier, HUBER_THRESHOLD / root, 1.0)
        rows = np.where(is_outlier, np.sign(rows) * root, rows)
        jacobian = np.concatenate([columns * slope[:, None], np.eye(len(u))[self._has_prior]])
        return Point(u, np.concatenate([rows, u[self._has_prior]]), jacobian, predicted, slopes)


class WithDifferences(LeastSquares):
    """The same with slopes by differences, which are reused: `known_slopes` first.

    With `reuse` only those that were not given are computed again, and `stale` ones once before the end.
    """

    def __init__(
        self,
        task: Task,
        model: Any,
        parameters: Sequence[Parameter],
        known_slopes: Mapping[str, np.ndarray],
        reuse: bool,
        stale: bool,
    ):
        super().__init__(task, model, parameters)
        self._known, self._must_renew = known_slopes, stale
        self._most, self._renewals = TO_THE_END if stale else (MOST, RENEWALS)
        is_known = np.array([parameter.name in known_slopes for parameter in parameters], dtype=bool)
        self._missing = np.flatnonzero(~is_known)
        self._renewable = self._missing if reuse else np.arange(len(is_known))
        self._slopes = self._columns = np.zeros((len(is_known), 0))
        self._fresh_at: np.ndarray | None = None

    def evaluate(self, u: np.ndarray) -> Point:
        """Return rows at u and their Jacobian by the slopes that there are."""
        predicted = self.task.experiment.predict([at(self.task.experiment, self.model, self.parameters, u)])[0]
        if not self._slopes.size:
            zero = np.zeros_like(predicted)
            self._slopes = np.array([self._known.get(parameter.name, zero) for parameter in self.parameters])
            self._take_slopes(self._missing, u)
            self._fresh_at = u if len(self._missing) == len(self._renewable) else None
        return self._point(u, predicted, self._slopes, self._columns)

    def renew(self, point: Point, is_end: bool) -> Point | None:
        """Return a point with slopes by new differences there, as often as that is allowed."""
        is_fresh = self._fresh_at is point.u or not len(self._renewable)
        if is_fresh or not self._renewals or (is_end and not self._must_renew):
            return None
        self._take_slopes(self._renewable, point.u)
        self._fresh_at, self._must_renew, self._renewals = point.u, False, self._renewals - 1
        return self._point(point.u, point.predicted, self._slopes, self._columns)

    def solution(self, start: np.ndarray) -> Arrays:
        """Return where a descent ends, its last step by the slopes alone, or where it was after `_most` steps."""
        end = descend(self, start, SETTLED, self._most)
        step = full_step(self, end)
        step = step if end.promised_fall(step) < SETTLED else np.zeros_like(step)
        predicted = end.predicted + np.tensordot(step, end.slopes, 1)
        return {"u": end.u + step, "predicted": predicted, "slopes": end.slopes}

    def _take_slopes(self, which: np.ndarray, u: np.ndarray) -> None:
        """Put the slopes of some of the parameters, the others at u, in the place of those that they had."""
        if len(which):
            model = at(self.task.experiment, self.model, self.parameters, u)
            parameters = [self.parameters[place] for place in which]
            self._slopes = self._slopes.copy()
            self._slopes[which] = slopes_at(self.task.experiment, model, parameters, u[which])
        self._columns = self.task.columns(self._slopes)
