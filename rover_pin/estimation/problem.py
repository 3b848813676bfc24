"""The weighted least-squares problem of a fit: residuals in standard deviations, priors as further rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.quantity import check
from rover_pin.estimation.coordinates import Space
from rover_pin.estimation.experiment import residual

Predictor = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Values of all known parameters -> predictions [m] and their Jacobian with respect to the free ones [m, p]."""


class Measured(Protocol):
    """Data that can be fitted: channels with `measured` values, NaN where none, their `sd`, and a model of them."""

    @property
    def channels(self) -> Sequence[Any]:
        """The measured channels."""

    def predictor(self, free: tuple[str, ...]) -> Predictor:
        """Return the model of these data, with derivatives with respect to the free parameters."""


@dataclass(frozen=True)
class Prior:
    """What is known of a parameter without these data: a normal distribution, in the parameter's unit."""

    mean: float
    sd: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mean) and np.isfinite(self.sd) and self.sd > 0):
            raise ParameterError(
                f"Prior({self.mean:g}, {self.sd:g}) needs a finite mean and a positive sd; to hold a parameter "
                f"exactly, leave it out of `free` and give its value in the soil."
            )


class Problem:
    """Residuals over their SD in the coordinates u of a `Space`, then the priors' rows, and their Jacobian.

    Parameters
    ----------
    widen : float
        Factor on the stated standard deviations of the data, not of the priors.

    Raises
    ------
    DataError
        Fewer measured values than free parameters without a prior.
    ParameterError
        A prior of a parameter that is not free, or whose mean is out of its bounds.
    """

    def __init__(self, data: Sequence[Measured], space: Space, priors: Mapping[str, Prior], widen: float = 1.0):
        for name in priors:
            if name not in space.names:
                raise ParameterError(f"the prior of '{name}' has no free parameter: {closest(name, space.names)}")
            check("prior", name, priors[name].mean, space.axes[space.names.index(name)].quantity)
        self.data, self.space, self.priors, self.widen = tuple(data), space, dict(priors), widen
        measured = np.concatenate([channel.measured for dataset in data for channel in dataset.channels])
        self._seen = np.isfinite(measured)
        self.measured = measured[self._seen]
        self.sd = widen * np.concatenate([channel.sd for dataset in data for channel in dataset.channels])[self._seen]
        self._predictors = [dataset.predictor(space.names) for dataset in data]
        self._prior_at = [space.names.index(name) for name in priors]
        self._prior_mean = np.array([prior.mean for prior in priors.values()])
        self._prior_sd = np.array([prior.sd for prior in priors.values()])
        without = len(space.names) - len(priors)
        if without > self.measured.size:
            raise DataError(
                f"{without} free parameters without a prior and {self.measured.size} measured values: more parameters "
                f"than data; free fewer, state priors or measure more points."
            )

    def widened(self, factor: float) -> Problem:
        """Return the same problem with the data's standard deviations multiplied by `factor`."""
        return Problem(self.data, self.space, self.priors, factor)

    @property
    def freedom(self) -> int:
        """Rows minus parameters."""
        return self.measured.size + len(self.priors) - len(self.space.names)

    def evaluate(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return residuals [rows] and their Jacobian [rows, p] at u."""
        fields, slopes = self.space.fields(u), self.space.slopes(u)
        parts = [predict(fields) for predict in self._predictors]
        weighted_residual = (
            residual(self.measured, np.concatenate([values for values, _ in parts])[self._seen]) / self.sd
        )
        jacobian = -np.concatenate([slope for _, slope in parts])[self._seen] * slopes / self.sd[:, None]
        if not self.priors:
            return weighted_residual, jacobian
        at = self._prior_at
        prior_residual = residual(self._prior_mean, self.space.values(u)[at]) / self._prior_sd
        rows = np.zeros((len(at), len(slopes)))
        rows[range(len(at)), at] = -slopes[at] / self._prior_sd
        return np.concatenate([weighted_residual, prior_residual]), np.concatenate([jacobian, rows])

    def unpredicted(self, u: np.ndarray) -> str:
        """Return the first point that the model does not predict at u, in words; empty where it predicts all."""
        fields = self.space.fields(u)
        for dataset, predict in zip(self.data, self._predictors, strict=True):
            lost = np.isnan(predict(fields)[0]).reshape(len(dataset.channels), -1).any(axis=0)
            if lost.any():
                return f"; no sinkage down to the axle carries the load of point {lost.argmax() + 1}"
        return ""

    def chi2(self, u: np.ndarray) -> float:
        """Return the sum of squared residuals at u, infinite where the model has no value."""
        rows, _ = self.evaluate(u)
        total = float(rows @ rows)
        return total if np.isfinite(total) else np.inf

    def data_jacobian(self, u: np.ndarray) -> np.ndarray:
        """Return the weighted Jacobian of the data alone, without the priors' rows."""
        return self.evaluate(u)[1][: self.measured.size]
