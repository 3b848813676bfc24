"""What a set of causes expects of measurements that were not made, given those that were.

It expects its prediction f(u), with what its discrepancy is there by that of the samples, r = y - f(u) of errors C:
    mean = f + K C^-1 r,  covariance = noise + K_o - K C^-1 K' + (J_o - K C^-1 J) V (J_o - K C^-1 J)'
K the covariance of the discrepancy there with that at the samples, K_o with itself, J slopes, V the covariance of u.
Beside noise that was learnt from what is left K is 0.
Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), section 2.7.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.noise import Noise
from rover_pin.estimation.slopes import at, slopes_at
from rover_pin.inference import hypothesis as fitted
from rover_pin.inference.beliefs import Hypothesis
from rover_pin.inference.error_model import Settings
from rover_pin.inference.samples import scale_inputs


@brief
@dataclass(frozen=True, eq=False)
class Offer:
    """Measurements that could be made next: each fold of an experiment in which nothing is measured yet."""

    experiment: Experiment
    noise: Noise
    "of its samples, those that would be compared"
    meets: Callable[[Any], Any] = lambda model: model
    "a model as it meets them"
    unmeasured: tuple[str, ...] = ()
    "channels that were not measured so far"

    @property
    def label(self) -> str:
        """What is offered, in words."""
        return self.experiment.folds[0] if len(self.experiment.folds) == 1 else "what could be measured next"

    @property
    def in_addition(self) -> str:
        """The channels that were not measured so far, in words."""
        many = (
            f"{self.unmeasured[0]} to {self.unmeasured[-1]}" if len(self.unmeasured) > 1 else "".join(self.unmeasured)
        )
        return f", with {many} too" if many else ""


class Expected(NamedTuple):
    """What a set of causes expects of an offer's rows, in SDs of its noise.

    Mean and variance of the errors (n,), by how much uncertain numbers and what is left move the mean (n, k), and how
    the rows of all samples move it, K C^-1 (n, samples); None where nothing is left.
    """

    mean: np.ndarray
    columns: np.ndarray
    variance: np.ndarray
    gain: np.ndarray | None = None

    def at(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and covariance of some of the rows."""
        columns = self.columns[rows]
        return self.mean[rows], columns @ columns.T + np.diag(self.variance[rows])


def expectation(offer: Offer, hypothesis: Hypothesis, first: Hypothesis) -> Expected:
    """Return what a set of causes expects of an offer, as if its numbers were known."""
    noise, channel = offer.noise, np.nonzero(offer.noise.good)[1]
    mean = _predict(offer, offer.meets(hypothesis.fit.model))
    if not isinstance(hypothesis, fitted.Hypothesis):
        variance = noise.inflation * _scales(offer, hypothesis, first) ** 2
        return Expected(mean, np.zeros((len(mean), 0)), variance[channel])
    noise_taken = hypothesis.noise_taken
    times = np.array([noise_taken.get(name, 1.0) for name in offer.experiment.channels])
    cross, prior = _discrepancy(offer, hypothesis)
    gain = np.linalg.solve(hypothesis.covariance, cross.T).T
    missed = hypothesis.errors.samples.value - hypothesis.predicted
    return Expected(mean + gain @ missed, _root(prior - gain @ cross.T), (times**2)[channel], gain)


def with_uncertain_numbers(offer: Offer, hypothesis: Hypothesis, expected: Expected) -> Expected:
    """Return the same with the numbers as uncertain as they are."""
    noise, fit = offer.noise, hypothesis.fit
    rows = noise.white(slopes_at(offer.experiment, offer.meets(fit.model), fit.parameters, fit.u)).T
    if isinstance(hypothesis, fitted.Hypothesis) and expected.gain is not None:
        rows = rows - expected.gain @ hypothesis.slopes
    columns = rows @ _root(hypothesis.posterior.covariance)
    return expected._replace(columns=np.concatenate([expected.columns, columns], axis=1))


def _predict(offer: Offer, model: Any) -> np.ndarray:
    """Return the rows that a model predicts, NaN where it does not."""
    predicted = offer.experiment.predict([model])[0]
    return offer.noise.white(np.where(np.abs(predicted) == offer.experiment.stand_in, np.nan, predicted))


def _discrepancy(offer: Offer, hypothesis: fitted.Hypothesis) -> tuple[np.ndarray, np.ndarray]:
    """Return K and K_o, in SDs of the noise of an offer's rows: (n, samples) and (n, n)."""
    ahead, measured, errors = offer.experiment, hypothesis.experiment, hypothesis.errors
    samples, eta = errors.samples, hypothesis.posterior.scales
    fold, channel, sample = np.nonzero(offer.noise.good)
    at_channel, at_fold, at_sample = np.nonzero(samples.good)
    inputs, inputs_ahead = scale_inputs(measured.varied[at_fold, at_sample], ahead.varied[fold, sample])
    sd = np.broadcast_to(offer.noise.sd if offer.noise.sd.ndim > 1 else offer.noise.sd[:, None], offer.noise.good.shape)
    row_sd = sd[fold, channel, sample]
    added = _added_ahead(offer, hypothesis) * row_sd
    names, campaigns = np.array(ahead.channels)[channel], ahead.campaigns[fold]
    cross, prior = np.zeros((len(fold), len(samples.value))), np.zeros((len(fold), len(fold)))
    for which, block in enumerate(samples.blocks):
        is_channel = names == measured.channels[at_channel[block[0]]]
        rows = np.flatnonzero(is_channel & (campaigns == measured.campaigns[at_fold[block[0]]]))
        ahead_settings, settings = Settings(inputs_ahead[rows], added[:, rows]), errors.settings_of(which, inputs)
        cross[np.ix_(rows, block)] = errors.smooth_between(eta, which, ahead_settings, settings)
        prior[np.ix_(rows, rows)] = errors.smooth_between(eta, which, ahead_settings, ahead_settings)
    return cross / row_sd[:, None], prior / row_sd[:, None] / row_sd


def _added_ahead(offer: Offer, hypothesis: fitted.Hypothesis) -> np.ndarray:
    """Return what each cause adds to an offer's rows (causes, n), where an error of form is left of it; else none."""
    if not len(hypothesis.errors.added):
        return np.zeros((0, int(offer.noise.good.sum())))
    fit, causes = hypothesis.fit, hypothesis.causes
    absent = [at(offer.experiment, fit.model, fit.parameters, cause.absent(fit.parameters, fit.u)) for cause in causes]
    present, *without = (_predict(offer, offer.meets(model)) for model in (fit.model, *absent))
    return np.array([np.nan_to_num(present - row) for row in without])


def _scales(offer: Offer, hypothesis: Hypothesis, first: Hypothesis) -> np.ndarray:
    """Return by how much all errors of each channel (channels,) are larger than those of the most probable set."""
    channels = hypothesis.experiment.channels
    larger = dict(zip(channels, hypothesis.fit.task.noise.floor / first.fit.task.noise.floor, strict=True))
    return np.array([larger.get(name, 1.0) for name in offer.experiment.channels])


def _root(covariance: np.ndarray) -> np.ndarray:
    """Return a matrix L with L L' the covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
