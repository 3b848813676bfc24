"""Least-squares fit of a model to an experiment, with the declared or assumed values of its parameters as priors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import stdtrit

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation.descent import full_step
from rover_pin.estimation.experiment import Differentiable, model_at
from rover_pin.estimation.least_squares import LeastSquares, Task, WithDifferences
from rover_pin.estimation.noise import rms_of
from rover_pin.estimation.parameter import Parameter, prior_curvature
from rover_pin.estimation.profile import CONFIDENCE, NORMAL_95
from rover_pin.estimation.residual import chi2, huber, huber_weights, residual

STRETCH_BLOCKS = 8
"""Number of successive samples of a run that count as one correlated stretch. Residuals within a stretch may be
correlated; residuals of different stretches are treated as independent. In a drive log, 8 samples are 4 s, twice the
correlation time of the terrain along the path."""
MIN_RUNS = 4
"""Minimum number of runs for an estimate of a parameter's SD from the scatter between runs. With fewer runs, Student's
t is so wide that the interval would exceed the allowed range of most parameters."""
MIN_EIGENVALUE = 1e-13
"""Smallest allowed eigenvalue of a normal matrix (J^T W J + priors) that is scaled to a unit diagonal.

A smaller eigenvalue is rounding, and possibly negative. It is raised to this value, so that the data-free direction of
the parameters gets a very large variance."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to an experiment, with its residuals, its chi2 and the covariance of its parameters.

    Arrays have the shape (folds, channels, samples). In a drive log, the folds are the runs, and the samples are means
    over short blocks of time.
    """

    task: Task = field(repr=False)
    """experiment and noise"""
    model: Any = field(repr=False)
    """the model with its fitted parameters"""
    parameters: tuple[Parameter, ...] = field(repr=False)
    """free parameters, with their priors"""
    u: np.ndarray
    """fitted parameters in units of their prior SD (parameters,)"""
    predicted: np.ndarray = field(repr=False)
    """prediction (folds, channels, samples)"""
    slopes: Mapping[str, np.ndarray] = field(repr=False)
    """name of a parameter u -> derivatives of the prediction by this parameter, d predicted / d u (folds, channels,
    samples)"""
    predictions: int = 0
    """number of models that were predicted for this fit, if its derivatives are finite differences; 0 otherwise"""

    @property
    def residual(self) -> np.ndarray:
        """Residuals (folds, channels, samples), measured minus predicted, in the units of the channels."""
        return residual(self.task.experiment.observed, self.predicted)

    @property
    def missed(self) -> np.ndarray:
        """Residuals for reports (folds, channels, samples). A sample without a prediction is NaN.

        The fit itself uses the experiment's substitute value for such a sample.
        """
        return np.where(np.abs(self.predicted) == self.task.experiment.stand_in, np.nan, self.residual)

    @property
    def rms(self) -> np.ndarray:
        """RMS of the residuals of each channel (channels,), in its unit."""
        return rms_of(self.residual, self.task.noise.good)

    @cached_property
    def rows(self) -> np.ndarray:
        """Whitened residuals (n,) of all compared samples: residuals in SDs of the noise, with its correlations
        removed.
        """
        return self.task.rows(self.predicted)

    @property
    def chi2(self) -> float:
        """Robust chi2, which the fit minimises: Huber's losses of the whitened residuals (`rows`), plus u^2 of every
        parameter that has a prior.
        """
        return chi2(self.rows, self.u, self.parameters)

    @property
    def misfit(self) -> float:
        """Reduced chi-square: robust sum of squares of the whitened residuals divided by the degrees of freedom. 1
        means that the residual is noise.
        """
        return huber(self.rows) / self.freedom

    @property
    def freedom(self) -> int:
        """Degrees of freedom: number of compared samples minus the number of parameters without a prior, at least 1."""
        return max(self.task.noise.count - sum(not parameter.prior for parameter in self.parameters), 1)

    @property
    def columns(self) -> np.ndarray:
        """Derivatives of the whitened residuals by the parameters u: d rows / d u (n, parameters)."""
        return self.task.columns([self.slopes[parameter.name] for parameter in self.parameters])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of u (parameters, parameters): (J^T W J + priors)^-1, with the derivatives J of the whitened
        residuals (`columns`), Huber's weights W, and the curvature of the priors.
        """
        return covariance(self.columns, self.rows, self.parameters)

    @cached_property
    def spread(self) -> np.ndarray:
        """SD of each parameter u (parameters,) for the computation of its interval: the largest of three estimates,
        from the noise model, from the scatter between stretches of runs, and from the scatter between runs.

        The SD from the noise model is the SD of `covariance`, raised by the inflation of the noise and by a misfit
        above 1. The SDs from stretches (STRETCH_BLOCKS successive samples) and from runs are the square roots of the
        sandwich H (sum g g^T) H, with H the covariance and g the gradient of chi2 / 2 of one stretch or run. These two
        SDs also hold for correlations that the noise model does not have, for example for sand that is prepared anew
        for each run. A few runs determine their scatter poorly, so that their SD is widened by the ratio of Student's t
        to the normal law. Source: White, Econometrica 48 (1980); Liang and Zeger, Biometrika 73 (1986); Donald and
        Lang, Rev. Econ. Stat. 89 (2007) 221, for t with the number of runs minus one as degrees of freedom.
        """
        # The model of the noise may be wrong, so that three estimates of the variance compete and the largest counts.
        plain = np.diag(self.covariance) * self.task.noise.inflation * max(self.misfit, 1.0)
        runs = len(self.task.noise.good)
        variances = [plain, self.stretch_sd**2]
        if runs >= MIN_RUNS:
            # Student's t with few runs, expressed as a factor on the SD, so that the caller can go on with 1.96 SD.
            wide = float(stdtrit(runs - 1, 0.5 + 0.5 * CONFIDENCE) / NORMAL_95)
            variances.append(wide**2 * self._clustered_variance(np.arange(runs)[:, None, None]))
        return np.asarray(np.sqrt(np.max(variances, axis=0)))

    @cached_property
    def stretch_sd(self) -> np.ndarray:
        """SD of each parameter u (parameters,), estimated from the scatter between stretches (STRETCH_BLOCKS successive
        samples) of the runs; see `spread`.
        """
        runs, _, blocks = self.task.noise.good.shape
        # Stretches are numbered through all runs: a stretch never crosses the end of a run.
        stretch = np.arange(blocks) // STRETCH_BLOCKS
        return np.asarray(
            np.sqrt(self._clustered_variance(np.arange(runs)[:, None, None] * (stretch[-1] + 1) + stretch))
        )

    def _clustered_variance(self, owner: np.ndarray) -> np.ndarray:
        """Return the variance of each parameter u (parameters,) for residuals that are correlated within clusters, such
        as runs.

        `owner` holds the index of each sample's cluster; its shape broadcasts to (folds, channels, samples).
        """
        good, rows = self.task.noise.good, self.rows
        row_owner = np.broadcast_to(owner, good.shape)[good]
        # Slope of chi2 / 2 of each row; their sum over a cluster has the cluster's own scatter.
        pushed = self.columns * (huber_weights(rows) * rows)[:, None]
        # One pass over the rows, because a long run has thousands of clusters.
        _, cluster = np.unique(row_owner, return_inverse=True)
        sums = np.array([np.bincount(cluster, column) for column in pushed.T]).reshape(pushed.shape[1], -1).T
        # The slopes of all clusters sum to zero at the optimum, which costs one degree of freedom.
        small_sample_factor = len(sums) / max(len(sums) - 1, 1)
        spread = self.covariance
        return np.diag(spread @ (small_sample_factor * sums.T @ sums + prior_curvature(self.parameters)) @ spread)

    @property
    def remaining_fall(self) -> float:
        """Decrease of chi2 that the derivatives predict for one more Newton step within the bounds of the parameters.

        At a minimum of chi2 it is 0. A large value shows that the fit ended before its minimum.
        """
        problem = LeastSquares(self.task, self.model, self.parameters)
        point = problem.point(self.u, self.predicted, np.array([self.slopes[row.name] for row in self.parameters]))
        return point.promised_fall(full_step(problem, point)) if len(self.u) else 0.0

    def value(self, name: str) -> float:
        """Return the fitted value of the parameter with this name [SI]."""
        at = [parameter.name for parameter in self.parameters].index(name)
        return self.parameters[at].value(self.u[at])


def table_of(fitted: Fit) -> np.ndarray:
    """Return the whitened residuals of a fit as a table (folds, channels, samples), with NaN for samples that are not
    compared.
    """
    good = fitted.task.noise.good
    table = np.full(good.shape, np.nan)
    table[good] = fitted.rows
    return table


def covariance(columns: np.ndarray, rows: np.ndarray, parameters: Sequence[Parameter]) -> np.ndarray:
    """Return the covariance (parameters, parameters) of the fitted parameters u: the inverse of J^T W J + P.

    J = d rows / d u (n, parameters) are the derivatives of the whitened residuals (the argument `columns`), W are
    Huber's weights of the whitened residuals `rows` (n,), and P is the curvature of the priors.
    """
    # An outlier carries little information about the parameters, as it does in the fit itself.
    weighted = columns * huber_weights(rows)[:, None]
    normal = columns.T @ weighted + prior_curvature(parameters)
    # The matrix is scaled to a unit diagonal, because parameters differ by orders of magnitude. A direction without
    # information has an eigenvalue of round-off, possibly negative. This eigenvalue is raised, so that the direction
    # gets a very large variance.
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    return np.asarray((vectors / np.maximum(values, MIN_EIGENVALUE)) @ vectors.T / np.outer(size, size))


def fit(
    task: Task,
    model: Any,
    parameters: Sequence[Parameter],
    start: np.ndarray | None = None,
    slopes: Mapping[str, np.ndarray] | None = None,
    reuse: bool = False,
    stale: bool = False,
) -> Fit:
    """Fit the free parameters of a model to an experiment: minimise the robust chi2, which includes the priors.

    With exact derivatives of the prediction (`Differentiable`) the descent ends at a minimum. Otherwise the derivatives
    are finite differences. They are reused until a step lowers chi2 by much less than they predict, and are then
    computed again (limits in `least_squares.py`). A fit that the experiment has stored is not repeated.

    Parameters
    ----------
    task : Task
        Experiment and noise.
    model : model
        Model whose free parameters are fitted.
    parameters : sequence of Parameter
        Free parameters.
    start : array (parameters,), optional
        Start values of u; by default the means of the priors.
    slopes : mapping, optional
        Known derivatives d predicted / d u by the name of the parameter, for the start of the fit.
    reuse : bool
        Whether the given derivatives are kept during the whole fit; only derivatives that were not given may then be
        computed again.
    stale : bool
        Whether the given derivatives are outdated. The fit then computes all derivatives again before it ends, and may
        take more steps.

    Raises
    ------
    OptimisationError
        A descent with exact derivatives does not end, or its matrix is singular.
    """
    known_slopes = dict(slopes or {})
    start = np.zeros(len(parameters)) if start is None else np.asarray(start, dtype=float)
    # Exact derivatives are cheap and always fresh; finite differences cost a prediction each and are reused.
    if isinstance(task.experiment, Differentiable):
        problem = LeastSquares(task, model, parameters)
    else:
        problem = WithDifferences(task, model, parameters, known_slopes, reuse, stale)
    # The request has everything on which the fit depends, so that a stored result is used for an equal fit only.
    request = (task.noise, model, tuple(parameters), start, known_slopes, reuse, stale)
    try:
        arrays = task.experiment.cached_arrays(request, lambda: problem.solution(start))
    except np.linalg.LinAlgError as error:
        raise OptimisationError(
            f"the equations of the fit are singular ({error}): the data cannot separate all parameters; fit fewer.",
            status=str(error),
        ) from error
    # The derivatives at the end are handed on by name, so that the next fit with more or fewer parameters can start
    # with them.
    u, names = arrays["u"], [parameter.name for parameter in parameters]
    slopes_by_name = known_slopes | dict(zip(names, arrays["slopes"], strict=True))
    fitted = model_at(task.experiment, model, parameters, u)
    predictions = int(arrays.get("predictions", 0))
    return Fit(task, fitted, tuple(parameters), u, arrays["predicted"], slopes_by_name, predictions)


def again(base: Fit, reuse: bool = False, stale: bool = False) -> Fit:
    """Continue a fit from its present parameters, for example after a change of its noise, and return the new fit.

    `reuse` and `stale` have the meaning of the arguments of `fit`.
    """
    return fit(base.task, base.model, base.parameters, base.u, base.slopes, reuse, stale)
