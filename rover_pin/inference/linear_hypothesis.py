"""A set of causes by a model that is linear about a fit: of all of them, or of some, with the sizes of the others."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import huber_losses
from rover_pin.estimation.parameter import Parameter, bounds_of
from rover_pin.inference.cause import Cause
from rover_pin.inference.error_model import Discrepancy
from rover_pin.inference.expansion import Expansion, Laplace
from rover_pin.inference.fold_prediction import FoldPrediction
from rover_pin.inference.residual_function import FunctionEvidence
from rover_pin.inference.size_prior import log_share_inside

NOISE = 1.0
"""RMS of what is left besides, in SDs of the noise, up to which it is none. Why: it is then no larger than that."""


@brief
@dataclass(frozen=True, eq=False)
class LinearHypothesis:
    """The base model with a set of causes, by the second order of a fit."""

    causes: tuple[Cause, ...]
    expansion: Expansion = field(repr=False)
    extra: tuple[int, ...]
    "which of the expansion's other columns act besides: none where all causes were fitted"
    parameters: tuple[Parameter, ...] = field(repr=False)
    "the fit's, then the sizes of the others"
    posterior: Laplace = field(repr=False)
    log_evidence: float
    discrepancy: Discrepancy = Discrepancy.NONE
    leaves_more: bool = False
    "whether what is left besides is more than noise, in some channel of some fold"
    shares: np.ndarray | None = None
    "logarithm of the probability of each fold (folds,) with what is left besides: they sum to the evidence"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes."""
        return tuple(cause.name for cause in self.causes)

    @property
    def added(self) -> tuple[str, ...]:
        """Names of the causes that were not fitted, in the order of `extra`."""
        return self.names[len(self.names) - len(self.extra) :]

    @property
    def experiment(self) -> Experiment:
        """What was measured."""
        return self.expansion.fit.task.experiment

    @property
    def model(self) -> Any:
        """The model of the fit."""
        return self.expansion.fit.model

    @property
    def is_fitted(self) -> bool:
        """Whether all its causes were fitted."""
        return not self.extra

    @property
    def fit(self) -> Fit:
        """The fit about which it is linear."""
        return self.expansion.fit

    @cached_property
    def _sd(self) -> np.ndarray:
        """SD of each u: of the posterior, or as runs and stretches scatter, if that is more."""
        sd = np.sqrt(np.diag(self.posterior.covariance))
        spread = self.fit.spread
        return np.concatenate([np.maximum(sd[: len(spread)], spread), sd[len(spread) :]])

    def moments(self, name: str) -> tuple[float, float]:
        """Return mean and SD of a number's u; of one that a cause frees, of that."""
        place = {parameter.name: at for at, parameter in enumerate(self.parameters)}[name]
        return float(self.posterior.mean[place]), float(self._sd[place])

    @cached_property
    def gain_shares(self) -> dict[str, float]:
        """How much of what each cause adds to ln Z counts: variance of its sizes over that by which stretches scatter.

        Rows that hang together along a size tell it as fewer would, and their likelihood counts as that of fewer. Only
        of what was fitted and leaves noise; 1 where stretches scatter less, or a size does not vanish at 0.
        Source: Mueller, Econometrica 81 (2013) 1805, for the variance; see also `Fit.spread`.
        """
        if not self.is_fitted or self.discrepancy is not Discrepancy.NONE:
            return {}
        sd = np.sqrt(np.diag(self.posterior.covariance))
        squares = np.array([self.posterior.mean / sd, self.posterior.mean / np.maximum(sd, self.fit.stretch_sd)]) ** 2
        shares = {}
        for cause in self.causes:
            is_size = [number.name in cause.amplitudes and not number.log for number in self.parameters]
            plain, scattered = squares[:, is_size].sum(axis=1)
            shares[cause.name] = float(scattered / plain) if plain > 0 else 1.0
        return shares

    @property
    def noise_taken(self) -> dict[str, float]:
        """How many times the declared noise, or what samples scatter, each channel is taken to have for noise."""
        scatter, noise = self.experiment.floor(), self.fit.task.noise
        if self.experiment.noise() is not None or scatter is None:
            return dict.fromkeys(self.experiment.channels, self.posterior.scale / math.sqrt(noise.inflation))
        times = noise.floor / noise.lower_bound(scatter)
        return dict(zip(self.experiment.channels, times.tolist(), strict=True))

    @cached_property
    def fold_prediction(self) -> FoldPrediction:
        """Every fold as the others predict it, in the bounds; an estimate says how probable it is alone."""
        others = [self.expansion.posterior(self.extra, fold) for fold in range(len(self.experiment.folds))]
        log_evidence = self.expansion.posterior(self.extra).log_evidence
        plain = np.array([log_evidence - posterior.log_evidence for posterior in others])
        density = plain if self.shares is None else self.shares
        if not self.is_fitted:
            return FoldPrediction(density, np.full(np.shape(self.experiment.observed), np.nan))
        slopes = np.array([self.fit.slopes[parameter.name] for parameter in self.fit.parameters])
        low, high = bounds_of(self.fit.parameters).T
        steps = np.array([np.clip(posterior.mean, low, high) - self.fit.u for posterior in others])
        missed = self.fit.residual - np.einsum("fp,pfcs->fcs", steps, slopes)
        return FoldPrediction(density, np.where(self.fit.task.noise.good, missed, np.nan))


def linear_hypothesis(
    causes: Sequence[Cause], expansion: Expansion, extra: Sequence[int] = (), partial: Sequence[Cause] = ()
) -> LinearHypothesis:
    """Return a set of causes about a fit; the last, `partial`, have one size each, that `extra` columns move."""
    posterior = expansion.posterior(extra)
    inside = _log_share_inside(causes, posterior)
    parameters = (*expansion.fit.parameters, *(cause.parameters[0] for cause in partial))
    return LinearHypothesis(
        tuple(causes), expansion, tuple(extra), parameters, posterior, posterior.log_evidence + inside
    )


def _log_share_inside(causes: Sequence[Cause], posterior: Laplace) -> float:
    """Return the logarithm of how much of the posterior of the causes' numbers, the last, their priors allow."""
    at = slice(len(posterior.mean) - sum(len(cause.parameters) for cause in causes), None)
    return log_share_inside(causes, posterior.mean[at], posterior.covariance[at, at])


def with_function(plain: LinearHypothesis, evidence: FunctionEvidence) -> LinearHypothesis:
    """Return the same set of causes, something smooth or otherwise unlisted left besides.

    Its evidence is that of its folds: what each is missed by, and of what the numbers cost as much as it has rows.
    """
    posterior = plain.posterior._replace(mean=evidence.mean, covariance=evidence.covariance)
    good = plain.fit.task.noise.good
    table = np.zeros(good.shape)
    table[good] = evidence.rows
    inside = _log_share_inside(plain.causes, posterior) - _log_share_inside(plain.causes, plain.posterior)
    fold, total = plain.fit.task.noise.fold, plain.posterior.log_evidence + evidence.gain
    by_row = -0.5 * huber_losses(evidence.missed) / evidence.scale**2 - math.log(evidence.scale)
    shares = np.bincount(fold, by_row + (total - by_row.sum()) / len(by_row), minlength=len(good))
    rms = np.sqrt((table**2).sum(axis=2) / np.maximum(good.sum(axis=2), 1))
    return replace(
        plain,
        posterior=posterior,
        log_evidence=plain.log_evidence + evidence.gain + inside,
        discrepancy=Discrepancy.SMOOTH,
        leaves_more=bool(rms.max() > NOISE),
        shares=shares,
    )
