"""A set of causes fitted to data: its most probable numbers, and its evidence with each kind of discrepancy."""

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
from rover_pin.estimation.experiment import Differentiable
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import declared_noise
from rover_pin.estimation.parameter import Parameter, bounds_of
from rover_pin.estimation.slopes import at
from rover_pin.estimation.task import Task
from rover_pin.inference.cause import Cause
from rover_pin.inference.error_model import PRIORS, Discrepancy, ErrorModel
from rover_pin.inference.evidence import Linear, Posterior, learnt_scales, posterior
from rover_pin.inference.fold_prediction import FoldPrediction, predict_folds
from rover_pin.inference.samples import Samples
from rover_pin.inference.size_prior import log_share_inside

ROUGH, CLOSE = 0.1, 0.01
"""Fall of chi2 at which a descent ends that only leads to another, and one about which the model is linear."""
TURNS, SHRUNK = 4, 1.5
"""Turns of fit and form error, and times by which a law may add less than where its form error was taken: that is a
share of what the law adds in the end, not of what it adds without one."""


@brief
@dataclass(frozen=True, eq=False)
class Hypothesis:
    """The base model with a set of causes, at its most probable numbers for one kind of discrepancy."""

    experiment: Differentiable = field(repr=False)
    causes: tuple[Cause, ...]
    model: Any = field(repr=False)
    "with the causes, as before the fit"
    parameters: tuple[Parameter, ...] = field(repr=False)
    u: np.ndarray = field(repr=False)
    predicted: np.ndarray = field(repr=False)
    "row of what it predicts (n,) at u"
    slopes: np.ndarray = field(repr=False)
    "d predicted / d u (n, numbers)"
    errors: ErrorModel = field(repr=False)
    posterior: Posterior = field(repr=False)
    log_evidence: float
    "of its numbers inside their bounds, with amplitudes that are not none"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes."""
        return tuple(cause.name for cause in self.causes)

    @property
    def linear(self) -> Linear:
        """The data as the linear model about u has them."""
        return linear_at(self.errors.samples, self.predicted, self.slopes, self.u)

    def moments(self, name: str) -> tuple[float, float]:
        """Return mean and SD of a number's u."""
        place = [parameter.name for parameter in self.parameters].index(name)
        return float(self.posterior.mean[place]), math.sqrt(self.posterior.covariance[place, place])

    @property
    def covariance(self) -> np.ndarray:
        """The covariance (n, n) of all errors."""
        covariance = np.zeros((len(self.errors.samples.value),) * 2)
        for channel, block in enumerate(self.errors.samples.blocks):
            covariance[np.ix_(block, block)] = self.errors.covariance(self.posterior.scales, channel)
        return covariance

    @property
    def variance(self) -> np.ndarray:
        """The variance of each error (n,)."""
        return np.diag(self.covariance)

    is_fitted: ClassVar[bool] = True
    gain_shares: ClassVar[dict[str, float]] = {}
    "all that a cause adds to ln Z counts: how its errors hang together is in their covariance"

    @property
    def discrepancy(self) -> Discrepancy:
        """What is left besides noise."""
        return self.errors.discrepancy

    @property
    def noise_taken(self) -> dict[str, float]:
        """How many times its declared noise (RMS) each channel is taken to have for noise, discrepancy left out."""
        samples, variance = self.errors.samples, self.variance
        squares: dict[str, list[float]] = {}
        for channel, block in enumerate(samples.blocks):
            noise = variance[block] - np.diag(self.errors.smooth_part(self.posterior.scales, channel))
            raised = 1.0 if self.errors.inflation is None else self.errors.inflation[block]
            name = self.experiment.channels[samples.channel[block[0]]]
            squares.setdefault(name, []).append(float(np.mean(noise / raised)) / samples.noise[channel] ** 2)
        return {name: math.sqrt(float(np.mean(values))) for name, values in squares.items()}

    @property
    def leaves_more(self) -> bool:
        """Whether more than noise is left."""
        return self.discrepancy is not Discrepancy.NONE

    @cached_property
    def fit(self) -> Fit:
        """The hypothesis as a fit, its noise as large as all its errors."""
        samples, experiment = self.errors.samples, self.experiment
        variance = samples.table_of(self.variance)
        noise = declared_noise(np.sqrt(np.where(np.isfinite(variance), variance, 1.0)), np.asarray(experiment.observed))
        task, names = Task(experiment, noise), [parameter.name for parameter in self.parameters]
        exact = experiment.sensitivities(self.model, self.parameters, self.u)
        model = at(experiment, self.model, self.parameters, self.u)
        return Fit(task, model, self.parameters, self.u, exact.predicted, dict(zip(names, exact.slopes, strict=True)))

    @cached_property
    def fold_prediction(self) -> FoldPrediction:
        """Every fold as the others predict it."""
        samples = self.errors.samples
        found = predict_folds(self.covariance, self.linear, samples.fold)
        return FoldPrediction(found.log_density, samples.table_of(found.missed))


def linear_at(samples: Samples, predicted: np.ndarray, slopes: np.ndarray, u: np.ndarray) -> Linear:
    """Return the data as a model that is linear about u has them."""
    return Linear(samples.value - predicted + slopes @ u, slopes)


class _WhiteRows(Problem):
    """Rows whose squares sum to (y - f)' C^-1 (y - f) + u' u; `whitening` of each block squares to its C^-1."""

    def __init__(self, fitter: Fitter, model: Any, parameters: tuple[Parameter, ...], whitening: Sequence[np.ndarray]):
        self.fitter, self.model, self.parameters, self.bounds = fitter, model, parameters, bounds_of(parameters)
        self._blocks = list(zip(fitter.samples.blocks, whitening, strict=True))

    def evaluate(self, u: np.ndarray) -> Point:
        predicted, slopes = self.fitter.predict_row(self.model, self.parameters, u)
        missed = self.fitter.samples.value - predicted
        rows = [white @ missed[block] for block, white in self._blocks]
        columns = [-white @ slopes[block] for block, white in self._blocks]
        return Point(u, np.concatenate([*rows, u]), np.concatenate([*columns, np.eye(len(u))]), predicted, slopes)


@dataclass(frozen=True, eq=False)
class Fitter:
    """The data, and the base model whose numbers every hypothesis fits anew."""

    experiment: Differentiable
    samples: Samples
    model: Any = field(repr=False)
    numbers: tuple[Parameter, ...] = field(repr=False)
    inflation: np.ndarray | None = None

    def predict_row(self, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the row that a model predicts at u, and its slopes (n, numbers)."""
        exact = self.experiment.sensitivities(model, parameters, u)
        return self.samples.row_of(exact.predicted), self.samples.row_of(exact.slopes).T

    def flat(self, causes: Sequence[Cause], starts: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
        """Return the most probable u with independent errors as large as noise and a usual discrepancy, and its loss.

        Raises OptimisationError: no descent from any of the starts ends.
        """
        samples = self.samples
        spread = np.empty(len(samples.value))
        for channel, block in enumerate(samples.blocks):
            spread[block] = PRIORS["a"].median * samples.spread[channel]
        raised = 1.0 if self.inflation is None else self.inflation
        whitening = [np.diag(1.0 / np.sqrt(samples.sd**2 * raised + spread**2)[block]) for block in samples.blocks]
        problem = _WhiteRows(self, *self.having(causes), whitening)
        ends = []
        for start in starts:
            with suppress(OptimisationError, np.linalg.LinAlgError):
                ends.append(descend(problem, start, ROUGH))
        if not ends:
            raise OptimisationError("no start of a hypothesis leads to a fit.", status=0)
        best = min(ends, key=lambda end: end.chi2)
        return best.u, best.chi2

    def having(self, causes: Sequence[Cause]) -> tuple[Any, tuple[Parameter, ...]]:
        """Return the base model with causes, and all free numbers."""
        model = self.model
        for cause in causes:
            model = cause.on(model)
        return model, (*self.numbers, *(parameter for cause in causes for parameter in cause.parameters))

    def hypothesis(
        self, causes: Sequence[Cause], u: np.ndarray, discrepancy: Discrepancy, neighbour: Hypothesis | None = None
    ) -> Hypothesis:
        """Return a hypothesis at its most probable numbers near u, its scales sought from those of one that is near."""
        model, parameters = self.having(causes)
        predicted, slopes = self.predict_row(model, parameters, u)
        added = self._added_rows(causes, u, predicted) if discrepancy is Discrepancy.FORM else ()
        errors = ErrorModel(self.samples, discrepancy, added, self.inflation)
        scales = errors.median
        if neighbour is not None:
            scales = errors.scales_like(neighbour.errors, neighbour.posterior.scales)
        for _ in range(TURNS):
            scales = learnt_scales(errors, linear_at(self.samples, predicted, slopes, u), scales)
            whitening = [
                np.linalg.inv(np.linalg.cholesky(errors.covariance(scales, channel)))
                for channel in range(len(self.samples.blocks))
            ]
            with suppress(OptimisationError, np.linalg.LinAlgError):  # else the linear model about the first fit stays
                end = descend(_WhiteRows(self, model, parameters, whitening), u, CLOSE)
                u, predicted, slopes = end.u, end.predicted, end.slopes
            if discrepancy is not Discrepancy.FORM:
                break
            added = self._added_rows(causes, u, predicted)
            taken, present = (np.linalg.norm(rows, axis=1) for rows in (errors.added, added))
            if (taken <= SHRUNK * present).all():
                break
            errors = replace(errors, added=added)
        solution = posterior(errors, linear_at(self.samples, predicted, slopes, u), scales)
        of_causes = slice(len(self.numbers), None)
        mean, covariance = solution.mean[of_causes], solution.covariance[of_causes, of_causes]
        log_evidence = solution.log_evidence + log_share_inside(causes, mean, covariance)
        return Hypothesis(
            self.experiment, tuple(causes), model, parameters, u, predicted, slopes, errors, solution, log_evidence
        )

    def _added_rows(self, causes: Sequence[Cause], u: np.ndarray, predicted: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return what each cause adds to the prediction (n,), the numbers as they are."""
        model, parameters = self.having(causes)
        without = [self.predict_row(model, parameters, cause.absent(parameters, u))[0] for cause in causes]
        return tuple(np.nan_to_num(predicted - row) for row in without)
