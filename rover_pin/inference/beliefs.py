"""Probabilities of all hypotheses, given the data of all folds or without the data of one fold, and models that are
drawn at random with these probabilities.

A hypothesis is a set of causes that act together, with one kind of remaining discrepancy. A cause is an effect that the
model lacks, a wrong declared number, or an error of the measurement. A fold is a group of samples that cross-validation
leaves out together.
"""

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.special import logsumexp, softmax

from rover_pin.base.public import brief
from rover_pin.inference import hypothesis as fitted
from rover_pin.inference.error_model import Discrepancy
from rover_pin.inference.linear_hypothesis import LinearHypothesis
from rover_pin.inference.priors import log_prior

Key = TypeVar("Key", bound=Hashable)
MIN_WRITTEN = 1e-3
"""Smallest probability that verdict.json lists. Causes and sets of causes with a smaller probability are not shown,
because there are hundreds of them and a report shows probabilities to two digits only."""


Hypothesis = fitted.Hypothesis | LinearHypothesis
"""A set of causes that act together, with one kind of remaining discrepancy (none, smooth, or an error of form).

Either the set was fitted itself, or its evidence was estimated from the fit of a subset of its causes."""


class SearchEnd(NamedTuple):
    """How far a search for the sets of causes came: its predictions, the sets that it left out, and the fits that did
    not reach their minimum.
    """

    predictions: int
    """number of models that were predicted"""
    budget: int
    """largest number of models that the search may predict"""
    unfitted: tuple[tuple[str, ...], ...] = ()
    """sets of causes that were not fitted because the budget was spent, although their estimated evidence exceeds the
    evidence of every fitted set"""
    falls: Mapping[frozenset[str], float] = {}
    """sets of causes whose fit did not reach its minimum -> decrease of chi2 that is still possible"""


class HeldOutGain(NamedTuple):
    """Improvement of the prediction of held-out data by a set of causes: the log predictive density of every fold with
    the set minus the log predictive density without any cause, summed over the folds [nats].
    """

    total: float
    scatter: float
    """SD of `total` that follows from the scatter of the improvement between folds; NaN with a single fold"""


@brief
@dataclass(frozen=True, eq=False)
class Beliefs:
    """All hypotheses (sets of causes) that were tried, with the probability of each given the data."""

    hypotheses: tuple[Hypothesis, ...] = field(repr=False)
    choice: int
    """number of possible causes; the sets of causes were formed from them"""
    untried: tuple[str, ...] = ()
    """names of the causes without a converged fit, so that they are in no hypothesis"""
    given_scores: np.ndarray | None = field(default=None, repr=False)
    """scores (hypotheses,) that replace the scores from the evidence, for example averages over folds; None if the
    scores follow from the evidence"""
    end: SearchEnd | None = field(default=None, repr=False)
    """how far the search came; None if every fit has exact derivatives and the number of fits is fixed"""
    given_raises: np.ndarray | None = field(default=None, repr=False)
    """raises of the log densities of the folds (hypotheses, folds) that belong to `given_scores`"""

    @cached_property
    def scores(self) -> np.ndarray:
        """Score of each hypothesis (hypotheses,): log evidence plus log prior [nats]. The probability of a hypothesis
        is proportional to the exponential of its score.

        Correlated residuals can exaggerate the increase of the evidence by a cause. Therefore only a fraction of each
        increase counts (`LinearHypothesis.gain_shares`): the evidence of the set without the cause is raised until only
        this fraction of the increase remains.
        """
        if self.given_scores is not None:
            return self.given_scores
        priors = [log_prior(len(row.causes), self.choice, row.discrepancy) for row in self.hypotheses]
        return np.asarray(self._raised_evidence[0] + priors)

    @cached_property
    def _raised_evidence(self) -> tuple[np.ndarray, np.ndarray]:
        """Raised log evidence of each hypothesis, and the index of the hypothesis with one more cause that raised it
        (its own index if it was not raised).
        """
        plain = np.array([row.log_evidence for row in self.hypotheses])
        evidence, raised_by = plain.copy(), np.arange(len(plain))
        index_of = {(frozenset(row.names), row.discrepancy): index for index, row in enumerate(self.hypotheses)}
        # From large sets to small ones, so that a raised evidence of a set also raises those of its subsets.
        for (names, discrepancy), index in sorted(index_of.items(), key=lambda item: -len(item[0][0])):
            for name, share in self.hypotheses[index].gain_shares.items():
                without = index_of.get((names - {name}, discrepancy), index)
                # The gain of the cause counts in part only. If the set without the cause was not tried, `without` is
                # the set itself and nothing changes.
                gain = share * (plain[index] - plain[without])
                if evidence[index] - gain > evidence[without]:
                    evidence[without], raised_by[without] = evidence[index] - gain, index
        return evidence, raised_by

    @cached_property
    def fold_densities(self) -> np.ndarray:
        """Log density of each fold given the other folds (hypotheses, folds) [nats].

        If the evidence of a hypothesis was raised, the densities of its folds are raised by the same sum: each fold in
        proportion to the density that the additional cause gains in this fold. Otherwise the evidence without a fold
        would contain the whole raise, but the density that is subtracted would contain nothing of it.
        """
        plain = np.array([hypothesis.fold_prediction.log_density for hypothesis in self.hypotheses])
        return plain + self._fold_raises(plain)

    def _fold_raises(self, plain: np.ndarray) -> np.ndarray:
        """Return the raise of the log density of each fold (hypotheses, folds), for the densities `plain`."""
        if self.given_scores is not None:
            return np.zeros(1) if self.given_raises is None else self.given_raises
        evidence, raised_by = self._raised_evidence
        raises = evidence - [row.log_evidence for row in self.hypotheses]
        gains = np.maximum(plain[raised_by] - plain, 0.0)
        totals = gains.sum(axis=1, keepdims=True)
        shares = np.where(totals > 0.0, gains / np.where(totals > 0.0, totals, 1.0), 1.0 / plain.shape[1])
        return np.asarray(raises[:, None] * shares)

    @cached_property
    def weights(self) -> np.ndarray:
        """Probability of each hypothesis (hypotheses,); the sum is 1."""
        return np.asarray(np.exp(self.scores - logsumexp(self.scores)))

    def probability(self, holds: Callable[[Hypothesis], bool]) -> float:
        """Return the total probability of all hypotheses that make the function `holds` return True."""
        rows = zip(self.weights, self.hypotheses, strict=True)
        return float(sum(weight for weight, hypothesis in rows if holds(hypothesis)))

    def totals(self, keys: Callable[[Hypothesis], Set[Key]], weights: np.ndarray | None = None) -> dict[Key, float]:
        """Return, for each key, the total probability of all hypotheses that have this key; the largest probability
        comes first.

        Parameters
        ----------
        keys : function
            Takes a hypothesis and returns the set of its keys, for example the names of its causes.
        weights : array (hypotheses,), optional
            Probabilities of the hypotheses; by default the probabilities given all data.
        """
        # A hypothesis counts for each of its keys, so that the totals of overlapping keys may add up to more than 1.
        totals: dict[Key, float] = {}
        for weight, hypothesis in zip(self.weights if weights is None else weights, self.hypotheses, strict=True):
            for key in keys(hypothesis):
                totals[key] = totals.get(key, 0.0) + float(weight)
        return dict(sorted(totals.items(), key=lambda pair: -pair[1]))

    def inclusion(self, name: str) -> float:
        """Return the probability that the cause with this name acts, alone or together with others."""
        return self.probability(lambda hypothesis: name in hypothesis.names)

    @property
    def included(self) -> dict[str, float]:
        """Name of each cause -> probability that the cause acts, alone or together with other causes. The largest
        probability comes first.
        """
        return self.totals(lambda hypothesis: set(hypothesis.names))

    @property
    def families(self) -> dict[str, float]:
        """Name of each family of causes -> probability that at least one cause of the family acts. The largest
        probability comes first.

        A family is a group of causes with similar effects, such as errors of the declaration. A cause without a family
        counts as a family of one.
        """
        return self.totals(lambda hypothesis: {cause.family or cause.name for cause in hypothesis.causes})

    @property
    def sets(self) -> dict[frozenset[str], float]:
        """Probability of each set of causes: that exactly these causes act, with or without a remaining discrepancy.
        The keys are the names of the causes, and the largest probability comes first.
        """
        return self.totals(lambda hypothesis: {frozenset(hypothesis.names)})

    def leaves_more(self, names: Iterable[str]) -> float:
        """Return the probability that a discrepancy larger than the noise remains, if exactly the causes
        `names` act.
        """
        return self._probability_given(names, lambda hypothesis: hypothesis.leaves_more)

    def has_discrepancy(self, names: Iterable[str]) -> float:
        """Return the probability that a discrepancy of any size remains, if exactly the causes `names` act."""
        return self._probability_given(names, lambda hypothesis: hypothesis.discrepancy is not Discrepancy.NONE)

    def _probability_given(self, names: Iterable[str], holds: Callable[[Hypothesis], bool]) -> float:
        """Return the probability that `holds` returns True for a hypothesis, if exactly the causes `names` act; NaN if
        this set of causes has no probability.
        """
        # The conditional probability: of all hypotheses with exactly these causes, the part for which `holds` is True.
        wanted = frozenset(names)
        among = self.probability(lambda hypothesis: frozenset(hypothesis.names) == wanted)
        both = self.probability(lambda hypothesis: frozenset(hypothesis.names) == wanted and holds(hypothesis))
        return both / among if among else math.nan

    def best(self, names: Sequence[str] | None = None) -> Hypothesis:
        """Return the most probable hypothesis, among all hypotheses or among those with exactly the causes `names`."""
        rows = zip(self.scores, self.hypotheses, strict=True)
        wanted = None if names is None else frozenset(names)
        # The most probable kind of discrepancy is chosen together with the set.
        among = [row for row in rows if wanted is None or frozenset(row[1].names) == wanted]
        return max(among, key=lambda row: row[0])[1]

    def moments(self, of: Hypothesis, name: str) -> tuple[float, float]:
        """Return the posterior mean and SD of one parameter, averaged over hypotheses, for the interval that a verdict
        reports.

        `name` is the name of the parameter, and both results are in the parameter's coordinate u (units of its prior
        SD). The average is over all fitted hypotheses that contain the causes of the hypothesis `of`, weighted with
        their probabilities. If `of` has no causes, only hypotheses without causes are averaged.
        """
        rows = [
            (weight, *hypothesis.moments(name))
            for weight, hypothesis in zip(self.weights, self.hypotheses, strict=True)
            if hypothesis.is_fitted and (set(of.names) <= set(hypothesis.names) if of.names else not hypothesis.names)
        ]
        # Variance of a mixture: mean of the variances plus variance of the means.
        weights, means, sds = np.array(rows).T
        weights = weights / weights.sum() if weights.sum() > 0 else np.full(len(weights), 1.0 / len(weights))
        mean = float(weights @ means)
        return mean, math.sqrt(float(weights @ (sds**2 + (means - mean) ** 2)))

    def noise_taken(self, names: Sequence[str]) -> dict[str, float]:
        """Return a mapping from the name of each channel to the ratio of its estimated noise to its declared noise.

        The estimate belongs to the most probable hypothesis with exactly the causes `names`, without its discrepancy. A
        value above 1 means that the residual is larger than the declared noise, and that the excess counts as noise.
        """
        return self.best(names).noise_taken

    def as_dict(self) -> dict[str, Any]:
        """Return the probabilities of families, causes and sets of causes as plain values for verdict.json."""
        return {
            "tried": self.choice,
            "families": {name: probability for name, probability in self.families.items() if probability > MIN_WRITTEN},
            "inclusion": {
                name: probability for name, probability in self.included.items() if probability > MIN_WRITTEN
            },
            "sets": [
                {
                    "causes": sorted(names),
                    "probability": probability,
                    "leaves_more": self.leaves_more(names),
                    "held_out_gain": held_out_gain(self, names)._asdict(),
                }
                for names, probability in self.sets.items()
                if probability > MIN_WRITTEN
            ],
        }


def scores_without(beliefs: Beliefs) -> np.ndarray:
    """Return the score of each hypothesis (log evidence plus log prior) without the data of one fold (folds,
    hypotheses) [nats].

    Row f holds the scores without fold f. The log evidence without a fold is the log evidence of all data minus the log
    density of this fold given the other folds.
    """
    # ln p(all data) = ln p(other folds) + ln p(fold | other folds), so that a subtraction leaves the fold out.
    return np.asarray(beliefs.scores - beliefs.fold_densities.T)


def weights_without(beliefs: Beliefs) -> np.ndarray:
    """Return the probability of each hypothesis without the data of one fold (folds, hypotheses); row f is without fold
    f.
    """
    return np.asarray(softmax(scores_without(beliefs), axis=1))


def chosen_without(beliefs: Beliefs) -> list[frozenset[str]]:
    """Return, for each fold, the set of causes that would be most probable without the data of this fold (folds,).

    A verdict is stable if this set does not depend on the fold.
    """
    names = [beliefs.totals(lambda hypothesis: {frozenset(hypothesis.names)}, row) for row in weights_without(beliefs)]
    return [next(iter(totals)) for totals in names]


def fold_densities(beliefs: Beliefs, names: Iterable[str]) -> np.ndarray:
    """Return the log predictive density of each fold given the other folds (folds,) [nats], if exactly the causes
    `names` act.

    With the score s_h of a hypothesis (log evidence plus log prior) and its log density d_h of fold f, the density is
    ln sum_h exp(s_h) - ln sum_h exp(s_h - d_h): the hypotheses of the set, without and with a remaining discrepancy,
    are averaged with the probabilities that they have without fold f. It is NaN if the set has no hypothesis.
    """
    wanted = frozenset(names)
    rows = np.array([frozenset(hypothesis.names) == wanted for hypothesis in beliefs.hypotheses], dtype=bool)
    without = scores_without(beliefs)
    if not rows.any():
        return np.full(len(without), np.nan)
    return np.asarray(logsumexp(beliefs.scores[rows]) - logsumexp(without[:, rows], axis=1))


def held_out_gain(beliefs: Beliefs, names: Iterable[str]) -> HeldOutGain:
    """Return by how much the causes `names` raise the log predictive density of the held-out folds, compared with no
    cause, and the SD of this sum.

    With the increases g_f of the log predictive density in F folds, the sum is the total of the g_f, and its SD is
    sqrt(F) times the SD of the g_f. Source: Vehtari, Gelman and Gabry, Stat. Comput. 27 (2017) 1413, section 5.
    """
    gains = fold_densities(beliefs, names) - fold_densities(beliefs, ())
    scatter = math.sqrt(len(gains)) * float(np.std(gains, ddof=1)) if len(gains) > 1 else math.nan
    return HeldOutGain(float(gains.sum()), scatter)


def across_folds(beliefs: Beliefs) -> Beliefs:
    """Return the same hypotheses with probabilities that are averaged over the folds: each fold is left out once.

    If no hypothesis describes the data, the probabilities given all data approach 0 or 1 although a few other data
    would reverse them. The average over data sets remains between 0 and 1. Source: Huggins and Miller, Bayesian Anal.
    18 (2023) 79, who average over bootstrapped data sets.
    """
    log_weights = scores_without(beliefs)
    log_weights = log_weights - logsumexp(log_weights, axis=1, keepdims=True)
    averages = np.asarray(logsumexp(log_weights, axis=0) - math.log(len(log_weights)))
    return replace(beliefs, given_scores=averages, given_raises=_raises_of(beliefs))


def _raises_of(beliefs: Beliefs) -> np.ndarray:
    """Return the raises of the log densities of the folds (hypotheses, folds), to keep them next to other scores."""
    plain = np.array([hypothesis.fold_prediction.log_density for hypothesis in beliefs.hypotheses])
    return np.asarray(beliefs.fold_densities - plain)


def toward_prior(averaged: Beliefs, folds: int) -> Beliefs:
    """Return the same hypotheses with probabilities that count one further fold, about which nothing is known.

    `averaged` has the probabilities that were averaged over the folds (`across_folds`), and `folds` is their number F.
    The result is (F p + p_0) / (F + 1), with the averages p and the prior probabilities p_0. If no hypothesis describes
    the data, all folds may agree on the same wrong set, and their average is 0 or 1. F folds that agree are then F
    observations and no proof, so that no probability exceeds F / (F + 1) by more than its prior.
    """
    priors = [log_prior(len(row.causes), averaged.choice, row.discrepancy) for row in averaged.hypotheses]
    weights = (folds * averaged.weights + np.exp(priors - logsumexp(priors))) / (folds + 1)
    return replace(averaged, given_scores=np.log(weights))


def excluding(beliefs: Beliefs, names: Iterable[str]) -> Beliefs:
    """Return the fitted hypotheses that do not contain all causes `names`, with their probabilities in proportion.

    Sets of causes that were only estimated are left out as well, because their held-out predictions are unknown.
    """
    unwanted = set(names)
    rows = [at for at, row in enumerate(beliefs.hypotheses) if row.is_fitted and not unwanted <= set(row.names)]
    return replace(
        beliefs,
        hypotheses=tuple(beliefs.hypotheses[at] for at in rows),
        given_scores=beliefs.scores[rows],
        given_raises=_raises_of(beliefs)[rows],
    )


def errors_without(beliefs: Beliefs) -> list[float]:
    """Return the held-out RMSE of each channel (channels,) in its unit, averaged over all fitted hypotheses.

    Each fold is predicted with the probabilities and the fits of the other folds, so that the choice of the causes is
    also tested on data that were not used for this choice.
    """
    fitted = np.array([hypothesis.is_fitted for hypothesis in beliefs.hypotheses])
    rows = [hypothesis.fold_prediction.missed for hypothesis in beliefs.hypotheses if hypothesis.is_fitted]
    weights = softmax(scores_without(beliefs)[:, fitted], axis=1)
    # The prediction of a fold is the average over the hypotheses, weighted by probabilities that do not know this fold.
    averaged = np.einsum("fh,hfcs->fcs", weights, np.array(rows))
    return [float(np.sqrt(np.nanmean(averaged[:, at] ** 2))) for at in range(averaged.shape[1])]


def drawn_models(beliefs: Beliefs, count: int, seed: int = 0) -> list[Any]:
    """Draw `count` models of equal weight from the posterior of causes and parameters, and return them.

    Simulating all of them shows the uncertainty of a prediction. For each model, a hypothesis is drawn by its
    probability (systematic resampling). Its parameters u (in units of their prior SD) are drawn from a normal
    distribution and clipped to their bounds. The distribution has the posterior mean and the posterior correlations of
    the hypothesis, and the SDs of the reported intervals. The models contain causes only, no remaining discrepancy.
    """
    random = np.random.default_rng(seed)
    fitted = [(weight, row) for weight, row in zip(beliefs.weights, beliefs.hypotheses, strict=True) if row.is_fitted]
    # Systematic resampling: evenly spaced points in the cumulated probability, with one common random shift.
    edges = np.cumsum([weight for weight, _ in fitted])
    indices = np.searchsorted(edges, edges[-1] * (np.arange(count) + random.random()) / count)
    models = []
    for index in indices:
        hypothesis = fitted[min(index, len(fitted) - 1)][1]
        names = [parameter.name for parameter in hypothesis.parameters]
        mean, sd = np.array([hypothesis.moments(name) for name in names]).reshape(-1, 2).T
        covariance = hypothesis.posterior.covariance[: len(names), : len(names)]
        # The reported SD can exceed that of the posterior (scatter between runs), so the draws are widened to it.
        scale = np.sqrt(np.diag(covariance))
        u = mean + sd / scale * random.multivariate_normal(np.zeros(len(names)), covariance, method="eigh")
        values = {
            parameter.name: parameter.value(float(np.clip(x, *parameter.bounds)))
            for parameter, x in zip(hypothesis.parameters, u, strict=True)
        }
        models.append(hypothesis.experiment.with_values(hypothesis.model, values))
    return models
