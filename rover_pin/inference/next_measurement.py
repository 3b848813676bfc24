"""Choose the next measurement, which is expected to distinguish best between the sets of causes that remain possible.

First, each set of causes predicts a possible measurement, given the measurements so far. The prediction is the
prediction f(u) of the fitted model plus the discrepancy that follows from the residual r = y - f(u) of the measured
values y, whose errors have the covariance C:

    mean = f + K C^-1 r,  covariance = noise + K_o - K C^-1 K' + (J_o - K C^-1 J) V (J_o - K C^-1 J)'

where K is the covariance between the discrepancies of the new measurement and of the samples so far, K_o is the
covariance of the discrepancy of the new measurement, J and J_o are the slopes by u of the samples and of the new
measurement, and V is the posterior covariance of u. If the noise was learnt from the residual, K is 0.

Then the expected information about the sets is computed. A set i of probability w_i predicts the measurement as N(m_i,
C_i). The information is at least

    I = -sum_i w_i ln sum_j w_j exp(-B_ij) [nats], with Bhattacharyya's distance B and C = (C_i + C_j) / 2:
    B_ij = (m_i - m_j)' C^-1 (m_i - m_j) / 8 + ln|C| / 2 - ln|C_i| / 4 - ln|C_j| / 4

I is 0 if all sets give one prediction, and equals the whole uncertainty -sum_i w_i ln w_i if no two predictions
overlap. Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), section 2.7; Lindley, Ann.
Math. Stat. 27 (1956) 986; Kolchinsky and Tracey, Entropy 19 (2017) 361, their lower bound.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.special import entr, logsumexp

from rover_pin.base.public import brief
from rover_pin.estimation.experiment import Experiment, model_at, slopes_at
from rover_pin.estimation.noise import Noise
from rover_pin.estimation.profile import CONFIDENCE, MAJORITY
from rover_pin.estimation.residual import residual
from rover_pin.estimation.wording import MAX_LISTED, MIN_MENTIONED
from rover_pin.inference import hypothesis as fitted
from rover_pin.inference.beliefs import Beliefs, Hypothesis
from rover_pin.inference.error_model import Settings
from rover_pin.inference.samples import scale_inputs


@brief
@dataclass(frozen=True, eq=False)
class Offer:
    """A group of possible next measurements. The search for missing effects proposes the most informative one.

    It is an experiment. Each of its folds (for example a run) is one measurement that can be made but has no values
    yet.
    """

    experiment: Experiment
    """experiment that predicts the possible measurements, each as a fold"""
    noise: Noise
    """noise of the samples that would be measured and compared"""
    meets: Callable[[Any], Any] = lambda model: model
    """function that adapts a fitted model to the new measurement, for example to another terrain"""
    unmeasured: tuple[str, ...] = ()
    """channels that were not measured so far and would need a new sensor"""

    @property
    def label(self) -> str:
        """Name of the possible measurements for progress messages: the name of the only measurement, or a general
        phrase if there are several.
        """
        return self.experiment.folds[0] if len(self.experiment.folds) == 1 else "possible next measurements"

    @property
    def in_addition(self) -> str:
        """Phrase about the channels that would need a new sensor, for the proposal of a measurement, such as ", with
        sinkage too"; empty if no channel needs a new sensor.
        """
        many = (
            f"{self.unmeasured[0]} to {self.unmeasured[-1]}" if len(self.unmeasured) > 1 else "".join(self.unmeasured)
        )
        return f", with {many} too" if many else ""


class OfferPrediction(NamedTuple):
    """Prediction of the possible measurements of an offer by one set of causes, in SDs of the noise of these
    measurements.
    """

    mean: np.ndarray
    "expected value of each sample (n,)"
    columns: np.ndarray
    """matrix L (n, k): L L' is the part of the covariance that comes from uncertain parameters and from the
    discrepancy"""
    variance: np.ndarray
    """variance of the noise (n,)"""
    gain: np.ndarray | None = None
    """matrix (n, samples so far) that turns the residuals so far into the expected discrepancy of the new samples; None
    if the hypothesis was not fitted with exact derivatives"""

    def at(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the predicted mean (m,) and covariance (m, m) of m selected samples; `rows` (n,) is the mask that
        selects them.
        """
        columns = self.columns[rows]
        return self.mean[rows], columns @ columns.T + np.diag(self.variance[rows])


def expectation(offer: Offer, hypothesis: Hypothesis, first: Hypothesis) -> OfferPrediction:
    """Return the prediction of possible measurements by a set of causes, as if its parameters were known exactly.

    Parameters
    ----------
    offer : Offer
        The possible measurements.
    hypothesis : Hypothesis
        The set of causes, fitted to the measurements so far.
    first : Hypothesis
        The most probable set of causes. Noise that was estimated from the residual is stated relative to the noise of
        this set.
    """
    noise, channel = offer.noise, np.nonzero(offer.noise.good)[1]
    mean = _predict(offer, offer.meets(hypothesis.fit.model))
    if not isinstance(hypothesis, fitted.Hypothesis):
        # Learnt noise of each channel, relative to that of the most probable set.
        channels = hypothesis.experiment.channels
        larger = dict(zip(channels, hypothesis.fit.task.noise.floor / first.fit.task.noise.floor, strict=True))
        scales = np.array([larger.get(name, 1.0) for name in offer.experiment.channels])
        variance = noise.inflation * scales**2
        return OfferPrediction(mean, np.zeros((len(mean), 0)), variance[channel])
    noise_taken = hypothesis.noise_taken
    # A hypothesis that needed more noise than declared also expects more noise in the new measurement.
    times = np.array([noise_taken.get(name, 1.0) for name in offer.experiment.channels])
    # Covariances of the discrepancy: `cross` (n, samples so far) between the samples of the offer and the samples so
    # far, and `prior` (n, n) between the samples of the offer. In the end, the samples of the offer are in SDs of the
    # offer's noise.
    ahead, measured, errors = offer.experiment, hypothesis.experiment, hypothesis.errors
    samples, eta = errors.samples, hypothesis.posterior.scales
    fold, _, sample = np.nonzero(noise.good)
    at_channel, at_fold, at_sample = np.nonzero(samples.good)
    # The inputs of both experiments are put on one scale, as the correlation length is in ranges of the inputs.
    inputs, inputs_ahead = scale_inputs(measured.varied[at_fold, at_sample], ahead.varied[fold, sample])
    sd = np.broadcast_to(noise.sd if noise.sd.ndim > 1 else noise.sd[:, None], noise.good.shape)
    row_sd = sd[fold, channel, sample]
    # Contribution of each cause to the prediction (causes, n): the prediction changes by it when the cause is switched
    # off. A hypothesis without an error of form needs no contributions, so the array has no rows.
    added = np.zeros((0, len(row_sd)))
    if len(errors.added):
        fit, numbers = hypothesis.fit, hypothesis.fit.parameters
        absent = [model_at(ahead, fit.model, numbers, cause.absent(numbers, fit.u)) for cause in hypothesis.causes]
        present, *without = (_predict(offer, offer.meets(model)) for model in (fit.model, *absent))
        added = np.array([np.nan_to_num(present - row) for row in without]) * row_sd
    # A discrepancy is correlated only within one channel of one campaign; elsewhere both covariances are 0.
    names, campaigns = np.array(ahead.channels)[channel], ahead.campaigns[fold]
    cross, prior = np.zeros((len(fold), len(samples.value))), np.zeros((len(fold), len(fold)))
    for which, block in enumerate(samples.blocks):
        is_channel = names == measured.channels[at_channel[block[0]]]
        rows = np.flatnonzero(is_channel & (campaigns == measured.campaigns[at_fold[block[0]]]))
        ahead_settings, settings = Settings(inputs_ahead[rows], added[:, rows]), errors.settings_of(which, inputs)
        cross[np.ix_(rows, block)] = errors.smooth_between(eta, which, ahead_settings, settings)
        prior[np.ix_(rows, rows)] = errors.smooth_between(eta, which, ahead_settings, ahead_settings)
    cross, prior = cross / row_sd[:, None], prior / row_sd[:, None] / row_sd
    # Kriging: the residuals so far predict the discrepancy of the new samples, and reduce its variance.
    gain = np.linalg.solve(hypothesis.covariance, cross.T).T
    missed = residual(hypothesis.errors.samples.value, hypothesis.predicted)
    return OfferPrediction(mean + gain @ missed, _root(prior - gain @ cross.T), (times**2)[channel], gain)


def with_uncertain_numbers(offer: Offer, hypothesis: Hypothesis, expected: OfferPrediction) -> OfferPrediction:
    """Add the uncertainty of the hypothesis's parameters to the covariance of the prediction `expected`, and return the
    result.

    The computation needs the derivatives of the prediction by the parameters, which take long for a drive log.
    """
    noise, fit = offer.noise, hypothesis.fit
    rows = noise.white(slopes_at(offer.experiment, offer.meets(fit.model), fit.parameters, fit.u)).T
    if isinstance(hypothesis, fitted.Hypothesis) and expected.gain is not None:
        # A parameter that changes the new prediction also changes the residuals so far, and with them the predicted
        # discrepancy.
        rows = rows - expected.gain @ hypothesis.slopes
    columns = rows @ _root(hypothesis.posterior.covariance)
    return expected._replace(columns=np.concatenate([expected.columns, columns], axis=1))


def _predict(offer: Offer, model: Any) -> np.ndarray:
    """Return the prediction (n,) of all samples of an offer (possible next measurements) by a model, in SDs of the
    noise; NaN for a missing prediction.
    """
    predicted = offer.experiment.predict([model])[0]
    return offer.noise.white(np.where(np.abs(predicted) == offer.experiment.stand_in, np.nan, predicted))


def _root(covariance: np.ndarray) -> np.ndarray:
    """Return a root L of a covariance: L L' equals the covariance. Small eigenvalues that rounding made negative count
    as 0.
    """
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


MAX_CLOSER_LOOKS = 4
"""Maximum number of offers (possible next measurements) whose expected information is computed with uncertain
parameters.

First the information of all offers is computed as if all parameters were known exactly, and the best offers are chosen;
the others are dropped. The computation with uncertain parameters needs the derivatives of the prediction for every set
of causes and takes minutes. An offer beyond the first four is assumed not to become the best."""


class NextMeasurement(NamedTuple):
    """The proposed next measurement, and the information that it is expected to give about the question which set of
    causes acts.
    """

    sets: tuple[str, ...]
    """names of the sets of causes that the measurement should distinguish, the most probable first"""
    what: str
    """description of the measurement"""
    channel: str
    """channel that gives most of the information"""
    nats: float
    """Expected information about the question which set of causes acts [nats]: the expected decrease of the entropy
    `open_nats`. One nat is 1.44 bits."""
    open_nats: float
    """Entropy of the probabilities of the sets of causes before this measurement [nats]. It is 0 if one set is certain,
    and ln k if k sets are equally probable."""

    @property
    def sentence(self) -> str:
        """The proposal as a sentence: the sets of causes to distinguish, the measurement, and the fraction of the
        remaining uncertainty that it is expected to resolve.
        """
        first, *others = self.sets[:MAX_LISTED]
        others += ["others"] if len(self.sets) > MAX_LISTED else []
        return (
            f"to distinguish {first} from {' or '.join(others)}: {self.what}; expected to resolve "
            f"{self.nats / self.open_nats:.0%} of the remaining uncertainty, mainly through {self.channel}"
        )


def open_sets(beliefs: Beliefs) -> list[tuple[float, Hypothesis]]:
    """Return the sets of causes that remain possible, as pairs (probability, most probable hypothesis of the set).

    These are the most probable fitted sets whose probabilities together reach CONFIDENCE, and at least two sets if two
    were fitted. Their probabilities are scaled so that the sum is 1.
    """
    rows = ((share, beliefs.best(tuple(names))) for names, share in beliefs.sets.items())
    fitted = [(share, best) for share, best in rows if best.is_fitted]
    # A set belongs to the leading ones as long as the sets before it do not reach the confidence.
    before = np.cumsum([0.0, *(share for share, _ in fitted)])
    leading = [row for at, row in enumerate(fitted) if at < 2 or before[at] < CONFIDENCE]
    total = sum(share for share, _ in leading)
    return [(share / total, hypothesis) for share, hypothesis in leading]


def next_measurement(
    leading: Sequence[tuple[float, Hypothesis]],
    offers: Iterable[Offer],
    progress: Callable[[str], None] = lambda message: None,
) -> NextMeasurement | None:
    """Return the possible measurement that is expected to give the most information about the question which set of
    causes acts.

    The result is None if no measurement can distinguish the sets noticeably. A measurement with channels that need a
    new sensor is proposed only if it gives more than twice the information of the best measurement without such
    channels.

    Parameters
    ----------
    leading : sequence of (float, Hypothesis)
        The sets of causes that remain possible, with their probabilities, from `open_sets`.
    offers : iterable of Offer
        Possible measurements.
    progress : function, optional
        Called with one line of text before each step.
    """
    if len(leading) < 2:
        return None
    # First round: the information if all numbers were known. It needs only predictions, no slopes.
    weights = np.array([share for share, _ in leading])
    hypotheses = [hypothesis for _, hypothesis in leading]
    if_known: list[tuple[float, Offer, list[OfferPrediction]]] = []
    for offer in offers:
        progress(f"predicting {offer.label}")
        expected = [expectation(offer, hypothesis, hypotheses[0]) for hypothesis in hypotheses]
        if_known.append((_best(weights, offer, expected, offer.unmeasured).nats, offer, expected))
    # Second round for the best offers, with uncertain numbers: each without and with channels not measured so far.
    choices: list[_Choice] = []
    for _, offer, known in sorted(if_known, key=lambda row: -row[0])[:MAX_CLOSER_LOOKS]:
        progress(f"expected information of {offer.label}")
        expected = [with_uncertain_numbers(offer, *pair) for pair in zip(hypotheses, known, strict=True)]
        choices += [_best(weights, offer, expected, offer.unmeasured), _best(weights, offer, expected)]
    open_nats = float(entr(weights).sum())
    # A new sensor is only worth its effort if it brings at least twice the information.
    measured, best = _greatest(choices[::2]), _greatest(choices)
    best = measured if measured.nats >= MAJORITY * best.nats else best
    if best.nats < MIN_MENTIONED * open_nats:
        return None
    sets = tuple(" + ".join(hypothesis.names) or "nothing" for hypothesis in hypotheses)
    return NextMeasurement(sets, best.what, best.channel, best.nats, open_nats)


class _Choice(NamedTuple):
    """A possible next measurement: its expected information [nats] about the sets of causes, its description, and its
    most informative channel.
    """

    nats: float
    what: str = ""
    channel: str = ""


def _greatest(choices: Sequence[_Choice]) -> _Choice:
    return max(choices, key=lambda choice: choice.nats, default=_Choice(0.0))


def _best(
    weights: np.ndarray, offer: Offer, expected: Sequence[OfferPrediction], without: Sequence[str] = ()
) -> _Choice:
    """Return the most informative fold of an offer: each fold is one possible measurement.

    `weights` (sets,) are the probabilities of the sets of causes, `expected` are their predictions of the offer, and
    `without` are the channels that are not measured.
    """
    fold, channel, _ = np.nonzero(offer.noise.good)
    used = ~np.isin(channel, [offer.experiment.channels.index(name) for name in without])
    # A measurement that a set cannot predict gives no information here, although it might be informative.
    foreseen = np.all([np.isfinite(outlook.mean) for outlook in expected], axis=0)
    folds = [used & (fold == at) for at in range(len(offer.experiment.folds))]
    nats = [_information(weights, expected, rows) if foreseen[rows].all() else 0.0 for rows in folds]
    at = int(np.argmax(nats))
    by_channel = [_information(weights, expected, folds[at] & (channel == which)) for which in range(channel.max() + 1)]
    also = offer.in_addition if len(without) < len(offer.unmeasured) else ""
    return _Choice(nats[at], offer.experiment.folds[at] + also, offer.experiment.channels[int(np.argmax(by_channel))])


def _information(weights: np.ndarray, expected: Sequence[OfferPrediction], rows: np.ndarray) -> float:
    """Return the expected information [nats] of the samples selected by the mask `rows` about the question which set of
    causes acts; 0 if no sample is selected.

    `weights` (sets,) are the probabilities of the sets, and `expected` their predictions.
    """
    if not rows.any():
        return 0.0
    mean, covariance = zip(*(outlook.at(rows) for outlook in expected), strict=True)
    return information(weights, np.array(mean), np.array(covariance))


def information(weights: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> float:
    """Return a lower bound of the expected information [nats] that a measurement of n values gives about the question
    which set of causes acts.

    Parameters
    ----------
    weights : array (sets,)
        Probabilities of the sets.
    mean : array (sets, n)
        Prediction of the n values by each set.
    covariance : array (sets, n, n)
        Covariance of each prediction.
    """
    # Bhattacharyya's distance between each pair of predictions, one row at a time.
    log_determinant = np.linalg.slogdet(covariance)[1]
    distance = np.empty((len(weights),) * 2)
    for row, center in enumerate(mean):
        both = (covariance[row] + covariance) / 2
        difference = center - mean
        squares = np.sum(difference * np.linalg.solve(both, difference[..., None])[..., 0], axis=1)
        distance[row] = squares / 8 + np.linalg.slogdet(both)[1] / 2 - (log_determinant[row] + log_determinant) / 4
    return max(0.0, -float(weights @ logsumexp(-distance, b=weights[None], axis=1)))
