"""What stays while models are compared: the experiment and its noise, and the robust chi2 that both define."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.experiment import Experiment, residual
from rover_pin.estimation.noise import Noise, huber
from rover_pin.estimation.parameter import Parameter


@brief
@dataclass(frozen=True, eq=False)
class Task:
    """What stays while models are compared: the experiment, the noise."""

    experiment: Experiment
    noise: Noise

    def rows(self, predicted: np.ndarray) -> np.ndarray:
        """Return whitened residuals of features (..., runs, channels, blocks)."""
        return self.noise.white(residual(self.experiment.observed, predicted))

    def columns(self, slopes: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
        """Return d rows / d u (n, parameters) from d predicted / d u (runs, channels, blocks) of each parameter."""
        return -self.noise.white(np.array(slopes)).T if len(slopes) else np.zeros((self.noise.count, 0))


def objective(rows: np.ndarray, u: np.ndarray, parameters: Sequence[Parameter]) -> float:
    """Return the robust chi2 with the priors."""
    has_prior = np.array([parameter.prior for parameter in parameters], dtype=bool)
    return huber(rows) + float(np.sum(np.asarray(u)[has_prior] ** 2))
