"""Fit a set of causes to data, with exact derivatives of the prediction: compute its most probable parameters, and its
evidence for one kind of discrepancy.

A hypothesis is the base model with a set of causes that act together, and one kind of discrepancy that remains in
addition to noise. u are the parameters in units of their prior SD.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.base.public import brief
from rover_pin.estimation.descent import Point, Problem, descend
from rover_pin.estimation.experiment import Differentiable, model_at
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.least_squares import Task
from rover_pin.estimation.noise import declared_noise
from rover_pin.estimation.numbers import BOUND_TOLERANCE
from rover_pin.estimation.parameter import Parameter, bounds_of
from rover_pin.estimation.residual import residual
from rover_pin.inference.cause import Cause
from rover_pin.inference.error_model import PRIORS, Discrepancy, ErrorModel
from rover_pin.inference.evidence import (
    MAX_SCALE_SDS,
    FoldPrediction,
    Linear,
    Posterior,
    learnt_scales,
    posterior,
    predict_folds,
)
from rover_pin.inference.priors import log_share_inside
from rover_pin.inference.samples import Samples

ROUGH_TOLERANCE, CLOSE_TOLERANCE = 0.1, 0.01
"""Minimum decrease of chi2 in one step. With a smaller one, a descent ends.

ROUGH_TOLERANCE is for a fit that only gives the start of another fit, CLOSE_TOLERANCE for the fit at which the model is
linearised. Probabilities change visibly only with differences of chi2 above about 0.1, so that the close tolerance is a
tenth of this value."""
MAX_ALTERNATIONS, MAX_SHRINKAGE = 4, 1.5
"""Limits of the alternation between fitting the parameters and updating the error of form (the causes' laws are right
in size but wrong in shape).

The size of an error of form is proportional to the contribution of the causes, which the fit changes. The alternation
ends after MAX_ALTERNATIONS fits, or as soon as the contribution of no cause has shrunk by more than the factor
MAX_SHRINKAGE. A smaller change is within one prior SD of the size of the error of form (a factor of 1.6)."""


@brief
@dataclass(frozen=True, eq=False)
class Hypothesis:
    """The base model with a set of causes that act together, fitted for one kind of discrepancy, with the evidence of
    this combination.
    """

    experiment: Differentiable = field(repr=False)
    causes: tuple[Cause, ...]
    """causes that act together, in addition to the base model; empty for the base model alone"""
    model: Any = field(repr=False)
    """the base model with the causes, before the fit"""
    parameters: tuple[Parameter, ...] = field(repr=False)
    """all free parameters: first of the base model, then of the causes"""
    u: np.ndarray = field(repr=False)
    """most probable parameters (parameters,), in units of their prior SD"""
    predicted: np.ndarray = field(repr=False)
    """prediction of the measured samples (n,) with the most probable parameters u"""
    slopes: np.ndarray = field(repr=False)
    """derivatives of the prediction by the parameters, d predicted / d u (n, parameters)"""
    errors: ErrorModel = field(repr=False)
    """covariance of all errors as a function of the scales (sizes of noise, drift and discrepancy)"""
    posterior: Posterior = field(repr=False)
    """evidence of the linear model around u, posterior of u, and most probable scales of the errors"""
    log_evidence: float
    """natural logarithm of the evidence [nats], corrected for the true prior of the causes' sizes and for the bounds of
    the parameters"""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes, in the order of `causes`."""
        return tuple(cause.name for cause in self.causes)

    @property
    def linear(self) -> Linear:
        """The linear model of the data around the fitted parameters u."""
        return linear_at(self.errors.samples, self.predicted, self.slopes, self.u)

    def moments(self, name: str) -> tuple[float, float]:
        """Return the posterior mean and SD of the parameter called `name`, in its coordinate u (units of
        its prior SD).
        """
        place = [parameter.name for parameter in self.parameters].index(name)
        return float(self.posterior.mean[place]), math.sqrt(self.posterior.covariance[place, place])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (n, n) of the errors of all n samples: noise (raised for outliers), errors that a fold shares,
        drift, and discrepancy.
        """
        covariance = np.zeros((len(self.errors.samples.value),) * 2)
        for channel, block in enumerate(self.errors.samples.blocks):
            covariance[np.ix_(block, block)] = self.errors.covariance(self.posterior.scales, channel)
        return covariance

    @property
    def variance(self) -> np.ndarray:
        """Variance of the error of each sample (n,): the diagonal of `covariance`."""
        return np.diag(self.covariance)

    is_fitted: ClassVar[bool] = True
    gain_shares: ClassVar[dict[str, float]] = {}
    """name of a cause -> fraction of the rise of the log evidence by this cause that counts. The mapping is empty here,
    which means that the whole rise counts, because the covariance already contains all correlations of the errors"""

    @property
    def discrepancy(self) -> Discrepancy:
        """Kind of discrepancy that remains in addition to noise."""
        return self.errors.discrepancy

    @property
    def noise_taken(self) -> dict[str, float]:
        """Name of a channel -> its estimated RMS noise divided by its declared noise.

        The discrepancy and the raised variance of outliers are not part of this noise.
        """
        samples, variance = self.errors.samples, self.variance
        squares: dict[str, list[float]] = {}
        for channel, block in enumerate(samples.blocks):
            # The discrepancy is no noise, and the raised variance of outliers is divided out again.
            noise = variance[block] - np.diag(self.errors.smooth_part(self.posterior.scales, channel))
            raised = 1.0 if self.errors.inflation is None else self.errors.inflation[block]
            name = self.experiment.channels[samples.channel[block[0]]]
            squares.setdefault(name, []).append(float(np.mean(noise / raised)) / samples.noise[channel] ** 2)
        return {name: math.sqrt(float(np.mean(values))) for name, values in squares.items()}

    @property
    def noise_at_bound(self) -> float:
        """Largest noise scale of a channel, divided by the declared noise, if it is the largest scale that the search
        allows; 0 otherwise.
        """
        letters = [letter for letter, _ in self.errors.scales]
        upper = self.errors.median + MAX_SCALE_SDS * self.errors.sd
        at_bound = [
            math.exp(scale)
            for letter, scale, bound in zip(letters, self.posterior.scales, upper, strict=True)
            if letter == "s" and scale >= bound - BOUND_TOLERANCE
        ]
        return max(at_bound, default=0.0)

    @property
    def leaves_more(self) -> bool:
        """Whether the hypothesis has a discrepancy in addition to noise."""
        return self.discrepancy is not Discrepancy.NONE

    @cached_property
    def fit(self) -> Fit:
        """The hypothesis as a `Fit`, for functions that expect a `Fit`. Its noise has the SD of all errors of the
        hypothesis, the discrepancy included.
        """
        samples, experiment = self.errors.samples, self.experiment
        # Values that are not compared get the SD 1, which is never used.
        variance = samples.table_of(self.variance)
        noise = declared_noise(np.sqrt(np.where(np.isfinite(variance), variance, 1.0)), np.asarray(experiment.observed))
        task, names = Task(experiment, noise), [parameter.name for parameter in self.parameters]
        exact = experiment.sensitivities(self.model, self.parameters, self.u)
        model = model_at(experiment, self.model, self.parameters, self.u)
        return Fit(task, model, self.parameters, self.u, exact.predicted, dict(zip(names, exact.slopes, strict=True)))

    @cached_property
    def fold_prediction(self) -> FoldPrediction:
        """Prediction of every fold (group of samples left out together) from the data of the other folds; the held-out
        residuals `missed` have the shape (folds, channels, samples).
        """
        samples = self.errors.samples
        found = predict_folds(self.covariance, self.linear, samples.fold)
        return FoldPrediction(found.log_density, samples.table_of(found.missed))


def linear_at(samples: Samples, predicted: np.ndarray, slopes: np.ndarray, u: np.ndarray) -> Linear:
    """Return the linear model of the data around the parameter values u (parameters,).

    `samples` holds the measured values, `predicted` (n,) is the prediction at u, and `slopes` (n, parameters) are its
    derivatives d predicted / d u. The target of the linear model is r_0 = measured - predicted + slopes u (n,).
    """
    return Linear(residual(samples.value, predicted) + slopes @ u, slopes)


class _WhiteRows(Problem):
    """Least-squares problem for fitting the parameters u while the covariance C of the errors is fixed.

    The loss is (y - f)' C^-1 (y - f) + u'u, with the measured values y, the prediction f, and the prior term u'u.
    `whitening` holds for each block of samples a root W of the inverse covariance, C^-1 = W'W.
    """

    def __init__(self, fitter: Fitter, model: Any, parameters: tuple[Parameter, ...], whitening: Sequence[np.ndarray]):
        self.fitter, self.model, self.parameters, self.bounds = fitter, model, parameters, bounds_of(parameters)
        self._blocks = list(zip(fitter.samples.blocks, whitening, strict=True))

    def evaluate(self, u: np.ndarray) -> Point:
        """Return the rows at u and their Jacobian: the whitened residuals, followed by u itself as the residuals of the
        prior.
        """
        # The prior N(0, I) adds u as further rows, with the identity as their Jacobian.
        predicted, slopes = self.fitter.predict_row(self.model, self.parameters, u)
        missed = residual(self.fitter.samples.value, predicted)
        rows = [white @ missed[block] for block, white in self._blocks]
        columns = [-white @ slopes[block] for block, white in self._blocks]
        return Point(u, np.concatenate([*rows, u]), np.concatenate([*columns, np.eye(len(u))]), predicted, slopes)


@dataclass(frozen=True, eq=False)
class Fitter:
    """Fits sets of causes to data. It holds the data and the base model, whose free parameters are fitted again
    together with every set of causes.
    """

    experiment: Differentiable
    samples: Samples
    model: Any = field(repr=False)
    numbers: tuple[Parameter, ...] = field(repr=False)
    """free parameters of the base model"""
    inflation: np.ndarray | None = None
    """factor on the noise variance of each sample (n,); above 1 for an outlier, None if there is no outlier"""

    def predict_row(self, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the prediction (n,) of a model for the n compared samples, and its derivatives d predicted / d u (n,
        parameters).

        `parameters` are the free parameters of the model, which are set to `u` (parameters,).
        """
        exact = self.experiment.sensitivities(model, parameters, u)
        return self.samples.row_of(exact.predicted), self.samples.row_of(exact.slopes).T

    def flat(self, causes: Sequence[Cause], starts: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
        """Fit a set of causes as if all errors were independent, and return the most probable parameters u and their
        loss.

        This fit is cheap; its result is the start of the fits with the full covariance. The variance of each error is
        the variance of the noise plus the variance of a discrepancy of median size.

        Parameters
        ----------
        causes : sequence of Cause
            The set of causes.
        starts : sequence of array (parameters,)
            Initial points u of the descent; the result with the smallest loss is returned.

        Raises
        ------
        OptimisationError
            The descent converges from none of the starts.
        """
        samples = self.samples
        spread = np.empty(len(samples.value))
        for channel, block in enumerate(samples.blocks):
            spread[block] = PRIORS["a"].median * samples.spread[channel]
        raised = 1.0 if self.inflation is None else self.inflation
        # The discrepancy counts as independent noise of its median size, which keeps this first fit cheap.
        whitening = [np.diag(1.0 / np.sqrt(samples.sd**2 * raised + spread**2)[block]) for block in samples.blocks]
        problem = _WhiteRows(self, *self.having(causes), whitening)
        ends = []
        for start in starts:
            with suppress(OptimisationError, np.linalg.LinAlgError):
                ends.append(descend(problem, start, ROUGH_TOLERANCE))
        if not ends:
            raise OptimisationError(
                "the fit of a set of causes converged from none of its start values; fit fewer parameters.", status=0
            )
        best = min(ends, key=lambda end: end.chi2)
        return best.u, best.chi2

    def having(self, causes: Sequence[Cause]) -> tuple[Any, tuple[Parameter, ...]]:
        """Return the base model with these causes added, and all its free parameters: first of the base model, then of
        the causes.
        """
        model = self.model
        for cause in causes:
            model = cause.on(model)
        return model, (*self.numbers, *(parameter for cause in causes for parameter in cause.parameters))

    def hypothesis(
        self, causes: Sequence[Cause], u: np.ndarray, discrepancy: Discrepancy, neighbour: Hypothesis | None = None
    ) -> Hypothesis:
        """Fit a set of causes for one kind of discrepancy, and return the hypothesis with its evidence.

        Parameters
        ----------
        causes : sequence of Cause
            Causes that act together.
        u : array (parameters,)
            Initial parameter values of the descent.
        discrepancy : Discrepancy
            Kind of difference between model and data that remains in addition to noise.
        neighbour : Hypothesis, optional
            A similar hypothesis, from whose scales of the errors the search for the scales starts.
        """
        # Contribution of a cause: the prediction with all causes minus the prediction without this one.
        model, parameters = self.having(causes)
        predicted, slopes = self.predict_row(model, parameters, u)
        added = self._added_rows(causes, u, predicted) if discrepancy is Discrepancy.FORM else ()
        errors = ErrorModel(self.samples, discrepancy, added, self.inflation)
        # The scales of a similar hypothesis are a good start, so that the search for the scales is short.
        scales = errors.median
        if neighbour is not None:
            scales = errors.scales_like(neighbour.errors, neighbour.posterior.scales)
        # Alternate between scales (for fixed parameters) and parameters (for fixed scales). One turn is enough, except
        # for an error of form, whose size depends on the parameters.
        for _ in range(MAX_ALTERNATIONS):
            scales = learnt_scales(errors, linear_at(self.samples, predicted, slopes, u), scales)
            whitening = [
                np.linalg.inv(np.linalg.cholesky(errors.covariance(scales, channel)))
                for channel in range(len(self.samples.blocks))
            ]
            # If this descent fails, the linear model around the first fit is kept.
            with suppress(OptimisationError, np.linalg.LinAlgError):
                end = descend(_WhiteRows(self, model, parameters, whitening), u, CLOSE_TOLERANCE)
                u, predicted, slopes = end.u, end.predicted, end.slopes
            if discrepancy is not Discrepancy.FORM:
                break
            added = self._added_rows(causes, u, predicted)
            assumed, present = (np.linalg.norm(rows, axis=1) for rows in (errors.added, added))
            if (assumed <= MAX_SHRINKAGE * present).all():
                break
            errors = replace(errors, added=added)
        # Evidence of the linear model, then corrected for the bounds and for the true prior of the sizes.
        solution = posterior(errors, linear_at(self.samples, predicted, slopes, u), scales)
        of_causes = slice(len(self.numbers), None)
        mean, covariance = solution.mean[of_causes], solution.covariance[of_causes, of_causes]
        log_evidence = solution.log_evidence + log_share_inside(causes, mean, covariance)
        return Hypothesis(
            self.experiment, tuple(causes), model, parameters, u, predicted, slopes, errors, solution, log_evidence
        )

    def _added_rows(self, causes: Sequence[Cause], u: np.ndarray, predicted: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the contribution of each cause to the prediction at u, one array (n,) for each cause."""
        model, parameters = self.having(causes)
        without = [self.predict_row(model, parameters, cause.absent(parameters, u))[0] for cause in causes]
        return tuple(np.nan_to_num(predicted - row) for row in without)
