"""The least-squares problem of a fit: robust chi2 of an experiment, plus the priors of its parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.descent import Point, Problem, descend, full_step
from rover_pin.estimation.experiment import Arrays, Differentiable, Experiment, model_at, slopes_at
from rover_pin.estimation.noise import Noise
from rover_pin.estimation.parameter import Parameter, bounds_of
from rover_pin.estimation.residual import HUBER_THRESHOLD, huber_losses, residual


@brief
@dataclass(frozen=True, eq=False)
class Task:
    """An experiment together with the noise of its measured values. Both do not change while models are compared."""

    experiment: Experiment
    noise: Noise

    def rows(self, predicted: np.ndarray) -> np.ndarray:
        """Return the whitened residuals (..., n) of predictions (..., folds, channels, samples): residuals in SDs of
        the noise, with its correlations removed, for the n compared samples.
        """
        return self.noise.white(residual(self.experiment.observed, predicted))

    def columns(self, slopes: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
        """Return the derivatives of the whitened residuals by the parameters, d rows / d u (n, parameters).

        `slopes` are the derivatives of the prediction by each parameter, d predicted / d u (folds, channels, samples).
        """
        return -self.noise.white(np.array(slopes)).T if len(slopes) else np.zeros((self.noise.count, 0))


MIN_PROMISED_FALL = 0.3
"""Minimum predicted decrease of chi2 by the next step. With a smaller one, a fit with finite differences ends.

The fit takes this last step without predicting again; it changes the prediction by the derivatives instead. A change of
chi2 by 0.3 is a sixth of a nat, too little to change an answer, while another prediction of a drive log takes seconds
to minutes."""
MAX_STEPS, MAX_RENEWALS = 12, 2
"""Limits of a fit with finite differences: maximum number of steps, and maximum number of times that its derivatives
are computed again. Beyond them the fit ends at its best point; a promising fit is completed later with
LIMITS_TO_THE_END. Each step and each computation of the derivatives costs predictions that take minutes."""
LIMITS_TO_THE_END = 60, 12
"""Limits of a fit with finite differences that has to reach its minimum: maximum number of steps, and of times that its
derivatives are computed again. They are larger than MAX_STEPS and MAX_RENEWALS, because the steps along a curved valley
of chi2 are short."""


class LeastSquares(Problem):
    """The least-squares problem of a fit whose derivatives of the prediction by the parameters u are exact.

    Its rows are the whitened residuals, followed by u of every parameter that has a prior. The sum of the squared rows
    is the robust chi2 (see `residual.chi2`).
    """

    def __init__(self, task: Task, model: Any, parameters: Sequence[Parameter]):
        self.task, self.model, self.parameters = task, model, tuple(parameters)
        self.bounds = bounds_of(self.parameters)
        self._has_prior = np.array([parameter.prior for parameter in self.parameters], dtype=bool)

    def evaluate(self, u: np.ndarray) -> Point:
        """Return the rows and their Jacobian at u (parameters,)."""
        experiment = self.task.experiment
        assert isinstance(experiment, Differentiable)
        predicted, slopes = experiment.sensitivities(self.model, self.parameters, u)
        return self.point(u, predicted, slopes)

    def solution(self, start: np.ndarray) -> Arrays:
        """Return the fitted parameters u, the prediction, and its derivatives by u, after a descent from `start`
        (parameters,).

        Raises OptimisationError if the descent does not end.
        """
        end = descend(self, start)
        return {"u": end.u, "predicted": end.predicted, "slopes": end.slopes}

    def point(
        self, u: np.ndarray, predicted: np.ndarray, slopes: np.ndarray, columns: np.ndarray | None = None
    ) -> Point:
        """Return a point of the descent (rows and Jacobian) from a prediction at u.

        `slopes` are the derivatives of the prediction by u. `columns` are the derivatives of the whitened residuals, if
        they are known already. For a residual beyond HUBER_THRESHOLD, the row is the square root of Huber's loss with
        the sign of the residual, so that the sum of the squared rows is the robust chi2.
        """
        columns = self.task.columns(slopes) if columns is None else columns
        # Huber's loss is written as the square of a row, because the descent minimises a sum of squares. The derivative
        # of the row follows by the chain rule.
        rows = self.task.rows(predicted)
        is_outlier = np.abs(rows) > HUBER_THRESHOLD
        root = np.sqrt(np.where(is_outlier, huber_losses(rows), 1.0))
        slope = np.where(is_outlier, HUBER_THRESHOLD / root, 1.0)
        rows = np.where(is_outlier, np.sign(rows) * root, rows)
        # A prior adds one row u with the derivative 1 for each parameter that has a prior.
        jacobian = np.concatenate([columns * slope[:, None], np.eye(len(u))[self._has_prior]])
        return Point(u, np.concatenate([rows, u[self._has_prior]]), jacobian, predicted, slopes)


class WithDifferences(LeastSquares):
    """The least-squares problem of a fit whose derivatives of the prediction are finite differences.

    Finite differences are expensive, so that they are reused until they are no longer good enough. The fit starts with
    the derivatives `known_slopes` (name of the parameter -> derivatives). If `reuse` is True, only derivatives that
    were not given may be computed again. If `stale` is True, the derivatives are computed again at least once before
    the fit ends. `predictions` counts the models that were predicted so far.
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
        self._most, self._renewals = LIMITS_TO_THE_END if stale else (MAX_STEPS, MAX_RENEWALS)
        # Only the derivatives that the caller did not give have to be computed at the first point.
        is_known = np.array([parameter.name in known_slopes for parameter in parameters], dtype=bool)
        self._missing = np.flatnonzero(~is_known)
        self._renewable = self._missing if reuse else np.arange(len(is_known))
        self._slopes = self._columns = np.zeros((len(is_known), 0))
        # Point u at which all renewable derivatives were computed last.
        self._fresh_at: np.ndarray | None = None
        self.predictions = 0

    def evaluate(self, u: np.ndarray) -> Point:
        """Return the rows at u (parameters,), and their Jacobian from the derivatives that were computed last."""
        predicted = self.task.experiment.predict([model_at(self.task.experiment, self.model, self.parameters, u)])[0]
        self.predictions += 1
        # First call: take the known derivatives and compute the missing ones here.
        if not self._slopes.size:
            zero = np.zeros_like(predicted)
            self._slopes = np.array([self._known.get(parameter.name, zero) for parameter in self.parameters])
            self._take_slopes(self._missing, u)
            self._fresh_at = u if len(self._missing) == len(self._renewable) else None
        return self.point(u, predicted, self._slopes, self._columns)

    def renew(self, point: Point, is_end: bool) -> Point | None:
        """Compute the derivatives at this point again and return the new point.

        Return None if the derivatives were computed at this point already, if they were computed again the maximum
        number of times, or if the descent ends here and they are not outdated.
        """
        is_fresh = self._fresh_at is point.u or not len(self._renewable)
        if is_fresh or not self._renewals or (is_end and not self._must_renew):
            return None
        self._take_slopes(self._renewable, point.u)
        self._fresh_at, self._must_renew, self._renewals = point.u, False, self._renewals - 1
        return self.point(point.u, point.predicted, self._slopes, self._columns)

    def solution(self, start: np.ndarray) -> Arrays:
        """Descend from `start` (parameters,) and return the fitted parameters u, the prediction, and its derivatives by
        u.

        The descent ends after the maximum number of steps at the latest. The prediction after the last step is computed
        from the derivatives alone.
        """
        end = descend(self, start, MIN_PROMISED_FALL, self._most)
        # The last Newton step is small and is taken by the linear model, which saves a prediction. It is skipped if the
        # descent was stopped early and the step would still be long.
        step = full_step(self, end)
        step = step if end.promised_fall(step) < MIN_PROMISED_FALL else np.zeros_like(step)
        predicted = end.predicted + np.tensordot(step, end.slopes, 1)
        count = np.array(self.predictions)
        return {"u": end.u + step, "predicted": predicted, "slopes": end.slopes, "predictions": count}

    def _take_slopes(self, which: np.ndarray, u: np.ndarray) -> None:
        """Compute the derivatives by the parameters with the indices `which` at u, and store them in place of earlier
        ones.
        """
        if len(which):
            model = model_at(self.task.experiment, self.model, self.parameters, u)
            parameters = [self.parameters[place] for place in which]
            self._slopes = self._slopes.copy()
            self._slopes[which] = slopes_at(self.task.experiment, model, parameters, u[which])
            # One model for each derivative, the model in the centre, and one with all parameters changed together.
            self.predictions += len(which) + 2
        self._columns = self.task.columns(self._slopes)
