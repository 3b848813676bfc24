"""A hypothesis whose evidence is not computed by a fit of its own, but from a model that is linear around another fit.

Such a hypothesis is used for experiments without exact derivatives of the prediction, where a fit takes minutes. The
other fit contains some or all of the causes of the set; the sizes of the remaining causes are estimated from the
changes of the prediction that they make.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.parameter import Parameter, bounds_of
from rover_pin.estimation.residual import huber_losses
from rover_pin.inference.cause import Cause
from rover_pin.inference.error_model import Discrepancy
from rover_pin.inference.evidence import FoldPrediction
from rover_pin.inference.expansion import Expansion, Laplace
from rover_pin.inference.priors import log_share_inside
from rover_pin.inference.residual_function import FunctionEvidence

MIN_DISCREPANCY_RATIO = 1.0
"""Minimum RMS of a discrepancy that counts as larger than the noise, in SDs of the noise.

At least one channel of one fold has to exceed this value. A smaller discrepancy changes no prediction beyond the noise,
so that an answer need not mention it."""


@brief
@dataclass(frozen=True, eq=False)
class LinearHypothesis:
    """The base model with a set of causes that act together, described by the quadratic expansion of the loss around a
    fit.

    It offers the properties of a `Hypothesis` that was fitted with exact derivatives, so that `Beliefs` can hold both.
    """

    causes: tuple[Cause, ...]
    """all causes of the set: first the causes that were fitted, then those whose sizes were only estimated"""
    expansion: Expansion = field(repr=False)
    extra: tuple[int, ...]
    """indices (among the further causes of the expansion) of the causes whose sizes were only estimated; empty if all
    causes were fitted"""
    parameters: tuple[Parameter, ...] = field(repr=False)
    """free parameters of the fit, followed by the size of each cause that was not fitted, so that its size is only
    estimated"""
    posterior: Laplace = field(repr=False)
    log_evidence: float
    discrepancy: Discrepancy = Discrepancy.NONE
    leaves_more: bool = False
    """whether the discrepancy is larger than the noise in at least one channel of one fold"""
    shares: np.ndarray | None = None
    """contribution of each fold (folds,) to the log evidence if there is a discrepancy; None without a discrepancy"""
    missed: np.ndarray | None = field(default=None, repr=False)
    """whitened residuals (n,) after the discrepancy was subtracted; None without a discrepancy"""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes, in the order of `causes`."""
        return tuple(cause.name for cause in self.causes)

    @property
    def added(self) -> tuple[str, ...]:
        """Names of the causes whose sizes were not fitted but only estimated, in the order of `extra`."""
        return self.names[len(self.names) - len(self.extra) :]

    @property
    def experiment(self) -> Experiment:
        """The experiment whose data were fitted."""
        return self.expansion.fit.task.experiment

    @property
    def model(self) -> Any:
        """The fitted model around which the hypothesis is linear. It contains the fitted causes, but not the causes
        that were only estimated.
        """
        return self.expansion.fit.model

    @property
    def is_fitted(self) -> bool:
        """Whether all causes of the set were fitted; False if the sizes of some causes were only estimated."""
        return not self.extra

    @property
    def fit(self) -> Fit:
        """The fit around which the hypothesis is linear. It contains the fitted causes, but not the causes that were
        only estimated.
        """
        return self.expansion.fit

    @cached_property
    def _sd(self) -> np.ndarray:
        """SD of each parameter u (parameters,): the larger one of the posterior SD and the SD from the scatter between
        runs and between stretches of runs.
        """
        # The posterior SD assumes the noise model; the scatter between runs also counts correlations that it lacks.
        sd = np.sqrt(np.diag(self.posterior.covariance))
        spread = self.fit.spread
        return np.concatenate([np.maximum(sd[: len(spread)], spread), sd[len(spread) :]])

    def moments(self, name: str) -> tuple[float, float]:
        """Return the posterior mean and SD of the parameter called `name`, in its coordinate u (units of its prior SD).

        If a cause frees a parameter of the base model from its prior, the set has two parameters of this name; the
        result is then for the freed parameter.
        """
        place = {parameter.name: at for at, parameter in enumerate(self.parameters)}[name]
        return float(self.posterior.mean[place]), float(self._sd[place])

    @cached_property
    def gain_shares(self) -> dict[str, float]:
        """Name of a cause -> fraction of the rise of the log evidence by this cause that counts.

        Correlated residuals carry less information than independent ones, so that their likelihood must count as the
        likelihood of fewer residuals. The fraction is the posterior variance of the cause's sizes divided by the
        variance that follows from the scatter of these sizes between stretches of the runs. It is 1 if this scatter is
        smaller than the posterior SD, and 1 for a size that does not vanish at 0. For hypotheses that were not fitted
        or have a discrepancy the result is empty, which means that their whole gains count. Source: Mueller,
        Econometrica 81 (2013) 1805, for the variance; see also `Fit.spread`.
        """
        if not self.is_fitted or self.discrepancy is not Discrepancy.NONE:
            return {}
        sd = np.sqrt(np.diag(self.posterior.covariance))
        # Squared size of each parameter in SDs: of the posterior, and of the scatter between stretches if this is
        # larger.
        squares = np.array([self.posterior.mean / sd, self.posterior.mean / np.maximum(sd, self.fit.stretch_sd)]) ** 2
        shares = {}
        for cause in self.causes:
            is_size = [number.name in cause.amplitudes and not number.log for number in self.parameters]
            plain, scattered = squares[:, is_size].sum(axis=1)
            shares[cause.name] = float(scattered / plain) if plain > 0 else 1.0
        return shares

    @property
    def noise_taken(self) -> dict[str, float]:
        """Name of a channel -> its estimated noise divided by its declared noise. If the data declare no noise, the
        estimated noise is divided by the scatter of the samples.

        With declared noise, this is the robust RMS of the channel's residual, because the noise scale of the evidence
        is common to all channels and lies within the range of its prior, however large a residual is.
        """
        scatter, noise = self.experiment.floor(), self.fit.task.noise
        if self.experiment.noise() is not None or scatter is None:
            losses = np.zeros(noise.good.shape)
            losses[noise.good] = huber_losses(self.fit.rows if self.missed is None else self.missed)
            means = losses.sum(axis=(0, 2)) / np.maximum(noise.good.sum(axis=(0, 2)), 1)
            return dict(zip(self.experiment.channels, np.sqrt(means).tolist(), strict=True))
        # Learnt noise is compared with the scatter of the samples within a block, the smallest noise that is possible.
        times = noise.floor / noise.lower_bound(scatter)
        return dict(zip(self.experiment.channels, times.tolist(), strict=True))

    @property
    def noise_at_bound(self) -> float:
        """Noise scale of the evidence, divided by the declared noise, if it is the largest scale that its prior allows;
        0 otherwise, and 0 for noise that was estimated from the residual.
        """
        scales = self.expansion.scales
        is_largest = len(scales) > 1 and self.posterior.scale >= scales[-1]
        return float(self.posterior.scale / math.sqrt(self.fit.task.noise.inflation)) if is_largest else 0.0

    @cached_property
    def fold_prediction(self) -> FoldPrediction:
        """Prediction of every fold (group of samples left out together) from the data of the other folds, with all
        parameters within their bounds.

        If the sizes of some causes were only estimated, the result contains the log density of each fold, but NaN for
        the residuals.
        """
        # The log density of a fold is the log evidence with it minus that without it.
        others = [self.expansion.posterior(self.extra, fold) for fold in range(len(self.experiment.folds))]
        log_evidence = self.expansion.posterior(self.extra).log_evidence
        plain = np.array([log_evidence - posterior.log_evidence for posterior in others])
        density = plain if self.shares is None else self.shares
        if not self.is_fitted:
            return FoldPrediction(density, np.full(np.shape(self.experiment.observed), np.nan))
        slopes = np.array([self.fit.slopes[parameter.name] for parameter in self.fit.parameters])
        low, high = bounds_of(self.fit.parameters).T
        # Held-out residual of a fold: the parameters move to the posterior without this fold, and the prediction
        # follows linearly.
        steps = np.array([np.clip(posterior.mean, low, high) - self.fit.u for posterior in others])
        missed = self.fit.residual - np.einsum("fp,pfcs->fcs", steps, slopes)
        return FoldPrediction(density, np.where(self.fit.task.noise.good, missed, np.nan))


def linear_hypothesis(
    causes: Sequence[Cause], expansion: Expansion, extra: Sequence[int] = (), partial: Sequence[Cause] = ()
) -> LinearHypothesis:
    """Return a hypothesis for a set of causes, whose evidence is computed from the expansion around a fit, without a
    new fit.

    Parameters
    ----------
    causes : sequence of Cause
        All causes of the set; the causes of `partial` come last.
    expansion : Expansion
        Expansion of the loss around a fit of the other causes.
    extra : sequence of int
        Index among the further causes of the expansion, for each cause of `partial`.
    partial : sequence of Cause
        Causes whose sizes are only estimated, not fitted; each has one size.
    """
    posterior = expansion.posterior(extra)
    inside = _log_share_inside(causes, posterior)
    parameters = (*expansion.fit.parameters, *(cause.parameters[0] for cause in partial))
    return LinearHypothesis(
        tuple(causes), expansion, tuple(extra), parameters, posterior, posterior.log_evidence + inside
    )


def _log_share_inside(causes: Sequence[Cause], posterior: Laplace) -> float:
    """Return the correction of the log evidence for the bounds of the causes' parameters and for the true prior of
    their sizes (see `priors.log_share_inside`).

    The parameters of `causes` must be the last parameters of the posterior.
    """
    at = slice(len(posterior.mean) - sum(len(cause.parameters) for cause in causes), None)
    return log_share_inside(causes, posterior.mean[at], posterior.covariance[at, at])


def with_function(plain: LinearHypothesis, evidence: FunctionEvidence) -> LinearHypothesis:
    """Return the hypothesis with a discrepancy in addition to its causes: a function of the inputs that no cause
    explains.

    `evidence` is the result of `residual_function.with_functions` for this hypothesis. The total evidence is divided
    among the folds: each fold gets the losses of its residuals, and a part of the cost of the parameters in proportion
    to its number of residuals.
    """
    posterior = plain.posterior._replace(mean=evidence.mean, covariance=evidence.covariance)
    good = plain.fit.task.noise.good
    table = np.zeros(good.shape)
    table[good] = evidence.rows
    inside = _log_share_inside(plain.causes, posterior) - _log_share_inside(plain.causes, plain.posterior)
    fold, total = plain.fit.task.noise.fold, plain.posterior.log_evidence + evidence.gain
    # Each residual contributes its own loss; the rest of the evidence (the cost of the parameters) is spread evenly.
    by_row = -0.5 * huber_losses(evidence.missed) / evidence.scale**2 - math.log(evidence.scale)
    shares = np.bincount(fold, by_row + (total - by_row.sum()) / len(by_row), minlength=len(good))
    rms = np.sqrt((table**2).sum(axis=2) / np.maximum(good.sum(axis=2), 1))
    return replace(
        plain,
        posterior=posterior,
        log_evidence=plain.log_evidence + evidence.gain + inside,
        discrepancy=Discrepancy.SMOOTH,
        leaves_more=bool(rms.max() > MIN_DISCREPANCY_RATIO),
        shares=shares,
        missed=evidence.missed,
    )
