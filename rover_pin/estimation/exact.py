"""The least-squares problem of an experiment with exact sensitivities, as descents and profiles ask for it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_pin.estimation.experiment import Sensitivities
from rover_pin.estimation.noise import HUBER_THRESHOLD, huber_losses
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.task import Task


class ExactProblem:
    """Rows whose squares sum to the robust chi2 of a model's numbers, the priors' u last, and their Jacobian."""

    def __init__(self, task: Task, model: Any, parameters: Sequence[Parameter]):
        self.task, self.model, self.parameters = task, model, tuple(parameters)
        self._known = np.array([parameter.prior for parameter in parameters], dtype=bool)
        self._last: tuple[np.ndarray, Sensitivities] | None = None

    def sensitivities(self, u: np.ndarray) -> Sensitivities:
        """Return the prediction at u and its slopes; where the last was asked for again, as they were."""
        if self._last is None or not np.array_equal(self._last[0], u):
            self._last = u.copy(), self.task.experiment.sensitivities(self.model, self.parameters, u)
        return self._last[1]

    def evaluate(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and their Jacobian at u; beyond HUBER_THRESHOLD SDs a row grows as the root of what it counts."""
        sensitivities = self.sensitivities(u)
        rows, columns = self.task.rows(sensitivities.predicted), self.task.columns(sensitivities.slopes)
        is_outlier = np.abs(rows) > HUBER_THRESHOLD
        root = np.sqrt(np.where(is_outlier, huber_losses(rows), 1.0))
        slope = np.where(is_outlier, HUBER_THRESHOLD / root, 1.0)
        rows = np.where(is_outlier, np.sign(rows) * root, rows)
        prior = np.eye(len(u))[self._known]
        return np.concatenate([rows, u[self._known]]), np.concatenate([columns * slope[:, None], prior])
