"""Fitting a model to an experiment by least squares, what is declared of each number as its prior."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import stdtrit

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation.experiment import Differentiable, residual
from rover_pin.estimation.least_squares import LeastSquares, WithDifferences
from rover_pin.estimation.noise import huber, huber_weights, rms_of
from rover_pin.estimation.parameter import Parameter, prior_curvature
from rover_pin.estimation.profile import NORMAL_95, SURE
from rover_pin.estimation.slopes import at
from rover_pin.estimation.task import Task, objective

STRETCH = 8
"""Blocks that are taken to hang together: 4 s. Why: twice what the path remembers."""
FEW = 4
"""Runs from which their scatter tells how uncertain a number is. Why: with fewer a t spans more than is allowed of most
numbers."""
ROUND_OFF = 1e-13
"""Least eigenvalue of a scaled normal matrix that is not taken for round-off."""


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
    def missed(self) -> np.ndarray:
        """Residuals as they may be reported: NaN where nothing is predicted, and a number stood in the fit."""
        return np.where(np.abs(self.predicted) == self.task.experiment.stand_in, np.nan, self.residual)

    @property
    def rms(self) -> np.ndarray:
        """RMS of the residuals of each channel (channels,), in its unit."""
        return rms_of(self.residual, self.task.noise.good)

    @cached_property
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
        return max(self.task.noise.count - sum(not parameter.prior for parameter in self.parameters), 1)

    @property
    def columns(self) -> np.ndarray:
        """d rows / d u as a matrix (n, parameters)."""
        return self.task.columns([self.slopes[parameter.name] for parameter in self.parameters])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of u: (J^T W J + priors)^-1."""
        return covariance(self.columns, self.rows, self.parameters)

    @cached_property
    def spread(self) -> np.ndarray:
        """SD of each u: of the model, inflated as its noise says and by a misfit above 1; of stretches, or of runs.

        The largest of the three. The others are the sandwich H (sum g g^T) H with H the covariance and g the slope of
        chi2 / 2 of one stretch of one run, or of one run: they hold where rows hang together beyond what the noise
        knows, as where sand that is prepared anew differs from run to run. Few runs tell their scatter poorly: theirs
        is widened as Student's t is against the normal law.
        Source: White, Econometrica 48 (1980); Liang and Zeger, Biometrika 73 (1986); Donald and Lang, Rev. Econ.
        Stat. 89 (2007) 221 for t with as many degrees of freedom as there are runs but one.
        """
        plain = np.diag(self.covariance) * self.task.noise.inflation * max(self.misfit, 1.0)
        runs = len(self.task.noise.good)
        variances = [plain, self.stretch_sd**2]
        if runs >= FEW:
            wide = float(stdtrit(runs - 1, 0.5 + 0.5 * SURE) / NORMAL_95)
            variances.append(wide**2 * self._clustered_variance(np.arange(runs)[:, None, None]))
        return np.asarray(np.sqrt(np.max(variances, axis=0)))

    @cached_property
    def stretch_sd(self) -> np.ndarray:
        """SD of each u as stretches of the runs scatter, each with its own slope of chi2 / 2; see `spread`."""
        runs, _, blocks = self.task.noise.good.shape
        stretch = np.arange(blocks) // STRETCH
        return np.asarray(
            np.sqrt(self._clustered_variance(np.arange(runs)[:, None, None] * (stretch[-1] + 1) + stretch))
        )

    def _clustered_variance(self, owner: np.ndarray) -> np.ndarray:
        """Return the variance of each u where the rows of one owner (runs, 1, blocks) hang together."""
        good, rows = self.task.noise.good, self.rows
        row_owner = np.broadcast_to(owner, good.shape)[good]
        pushed = self.columns * (huber_weights(rows) * rows)[:, None]
        sums = np.array([pushed[row_owner == cluster].sum(axis=0) for cluster in np.unique(row_owner)])
        small_sample_factor = len(sums) / max(len(sums) - 1, 1)
        spread = self.covariance
        return np.diag(spread @ (small_sample_factor * sums.T @ sums + prior_curvature(self.parameters)) @ spread)

    def value(self, name: str) -> float:
        """Return the fitted value of a parameter [SI]."""
        at = [parameter.name for parameter in self.parameters].index(name)
        return self.parameters[at].value(self.u[at])


def table_of(fitted: Fit) -> np.ndarray:
    """Return the whitened residuals as (folds, channels, samples); NaN where nothing is compared."""
    good = fitted.task.noise.good
    table = np.full(good.shape, np.nan)
    table[good] = fitted.rows
    return table


def covariance(columns: np.ndarray, rows: np.ndarray, parameters: Sequence[Parameter]) -> np.ndarray:
    """Return (J^T W J + priors)^-1."""
    weighted = columns * huber_weights(rows)[:, None]
    return _inverse(columns.T @ weighted + prior_curvature(parameters))


def _inverse(normal: np.ndarray) -> np.ndarray:
    """Return the inverse of a positive matrix; a direction that nothing tells gets a huge variance, never none."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    return np.asarray((vectors / np.maximum(values, ROUND_OFF)) @ vectors.T / np.outer(size, size))


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

    Descends robust chi2(rows) + sum of the priors' u^2. Where the experiment tells exact slopes it ends at a minimum.
    Else slopes serve, the given ones first, until a step lowers that by less than STALE of what it promised; then they
    are computed again, with `reuse` only those that were not given. The fit ends where a step promises less than
    SETTLED, or after MOST steps and RENEWALS; given slopes that are `stale` only start it, new ones end it, and it may
    go on for longer, TO_THE_END. A fit that the experiment has kept is not made again.

    Raises OptimisationError: a descent with exact slopes does not end.
    """
    known_slopes = dict(slopes or {})
    start = np.zeros(len(parameters)) if start is None else np.asarray(start, dtype=float)
    if isinstance(task.experiment, Differentiable):
        problem = LeastSquares(task, model, parameters)
    else:
        problem = WithDifferences(task, model, parameters, known_slopes, reuse, stale)
    request = (task.noise, model, tuple(parameters), start, known_slopes, reuse, stale)
    try:
        arrays = task.experiment.cached_arrays(request, lambda: problem.solution(start))
    except np.linalg.LinAlgError as error:
        raise OptimisationError(f"a refit met a singular problem ({error}); free fewer.", status=str(error)) from error
    u, names = arrays["u"], [parameter.name for parameter in parameters]
    slopes_by_name = known_slopes | dict(zip(names, arrays["slopes"], strict=True))
    return Fit(
        task, at(task.experiment, model, parameters, u), tuple(parameters), u, arrays["predicted"], slopes_by_name
    )


def again(base: Fit, reuse: bool = False, stale: bool = False) -> Fit:
    """Return the fit taken up where it was, as after a change of the noise, or to its end; see `fit`."""
    return fit(base.task, base.model, base.parameters, base.u, base.slopes, reuse, stale)
