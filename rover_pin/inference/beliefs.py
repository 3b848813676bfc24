"""What the data make of all hypotheses: their probabilities, those of each cause, and of a discrepancy left."""

import math
from collections.abc import Callable, Hashable, Iterable, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from scipy.special import logsumexp

from rover_pin.base.public import brief
from rover_pin.inference import hypothesis as fitted
from rover_pin.inference.error_model import Discrepancy
from rover_pin.inference.linear_hypothesis import LinearHypothesis
from rover_pin.inference.set_prior import log_prior

Key = TypeVar("Key", bound=Hashable)
LEAST = 1e-3
"""Least probability that is written down."""


Hypothesis = fitted.Hypothesis | LinearHypothesis
"""A set of causes as the data have it, with one kind of discrepancy: fitted, or about a fit of it or of a part."""


@brief
@dataclass(frozen=True, eq=False)
class Beliefs:
    """Hypotheses, and how many causes there were to choose from."""

    hypotheses: tuple[Hypothesis, ...] = field(repr=False)
    choice: int
    untried: tuple[str, ...] = ()
    "causes with which nothing could be fitted"

    @cached_property
    def scores(self) -> np.ndarray:
        """Logarithm of evidence times prior of each hypothesis; what a cause adds counts by its share of gain."""
        plain = np.array([row.log_evidence for row in self.hypotheses])
        evidence = plain.copy()
        places = {(frozenset(row.names), row.discrepancy): at for at, row in enumerate(self.hypotheses)}
        for (names, discrepancy), at in sorted(places.items(), key=lambda place: -len(place[0][0])):
            for name, share in self.hypotheses[at].gain_shares.items():
                without = places.get((names - {name}, discrepancy), at)
                gain = share * (plain[at] - plain[without])
                evidence[without] = max(evidence[without], evidence[at] - gain)
        priors = [log_prior(len(row.causes), self.choice, row.discrepancy) for row in self.hypotheses]
        return np.asarray(evidence + priors)

    @cached_property
    def weights(self) -> np.ndarray:
        """Probability of each hypothesis."""
        return np.asarray(np.exp(self.scores - logsumexp(self.scores)))

    def probability(self, holds: Callable[[Hypothesis], bool]) -> float:
        """Return the probability of all hypotheses of which something holds."""
        rows = zip(self.weights, self.hypotheses, strict=True)
        return float(sum(weight for weight, hypothesis in rows if holds(hypothesis)))

    def totals(self, keys: Callable[[Hypothesis], Set[Key]], weights: np.ndarray | None = None) -> dict[Key, float]:
        """Return the probability of each key, of all hypotheses that have it, the largest first."""
        totals: dict[Key, float] = {}
        for weight, hypothesis in zip(self.weights if weights is None else weights, self.hypotheses, strict=True):
            for key in keys(hypothesis):
                totals[key] = totals.get(key, 0.0) + float(weight)
        return dict(sorted(totals.items(), key=lambda pair: -pair[1]))

    def inclusion(self, name: str) -> float:
        """Return the probability that a cause acts."""
        return self.probability(lambda hypothesis: name in hypothesis.names)

    @property
    def included(self) -> dict[str, float]:
        """The probability of each cause, the largest first."""
        return self.totals(lambda hypothesis: set(hypothesis.names))

    @property
    def families(self) -> dict[str, float]:
        """The probability that any cause of a family acts, the largest first; a cause of none is one by itself."""
        return self.totals(lambda hypothesis: {cause.family or cause.name for cause in hypothesis.causes})

    @property
    def sets(self) -> dict[frozenset[str], float]:
        """The probability of each set of causes, whatever it leaves, the largest first."""
        return self.totals(lambda hypothesis: {frozenset(hypothesis.names)})

    def leaves_more(self, names: Iterable[str]) -> float:
        """Return the probability that a set of causes leaves more than noise, given that it acts."""
        return self._probability_given(names, lambda hypothesis: hypothesis.leaves_more)

    def has_discrepancy(self, names: Iterable[str]) -> float:
        """Return the probability that a set of causes leaves anything besides noise, given that it acts."""
        return self._probability_given(names, lambda hypothesis: hypothesis.discrepancy is not Discrepancy.NONE)

    def _probability_given(self, names: Iterable[str], holds: Callable[[Hypothesis], bool]) -> float:
        """Return the probability that something holds, given that a set of causes acts."""
        wanted = frozenset(names)
        among = self.probability(lambda hypothesis: frozenset(hypothesis.names) == wanted)
        both = self.probability(lambda hypothesis: frozenset(hypothesis.names) == wanted and holds(hypothesis))
        return both / among if among else math.nan

    def best(self, names: Sequence[str] | None = None) -> Hypothesis:
        """Return the most probable hypothesis, of all or of a set of causes."""
        rows = zip(self.scores, self.hypotheses, strict=True)
        wanted = None if names is None else frozenset(names)
        among = [row for row in rows if wanted is None or frozenset(row[1].names) == wanted]
        return max(among, key=lambda row: row[0])[1]

    def moments(self, of: Hypothesis, name: str) -> tuple[float, float]:
        """Return mean and SD of a number's u over all hypotheses that contain another one; of the base over its own."""
        rows = [
            (weight, *hypothesis.moments(name))
            for weight, hypothesis in zip(self.weights, self.hypotheses, strict=True)
            if hypothesis.is_fitted and (set(of.names) <= set(hypothesis.names) if of.names else not hypothesis.names)
        ]
        weights, means, sds = np.array(rows).T
        weights = weights / weights.sum() if weights.sum() > 0 else np.full(len(weights), 1.0 / len(weights))
        mean = float(weights @ means)
        return mean, math.sqrt(float(weights @ (sds**2 + (means - mean) ** 2)))

    def noise_taken(self, names: Sequence[str]) -> dict[str, float]:
        """Return, for each channel, how many times the declared noise a set takes for noise, discrepancy left out."""
        return self.best(names).noise_taken

    def as_dict(self) -> dict[str, Any]:
        """Return plain values: the probability of each cause, and of each set with what it leaves."""
        return {
            "tried": self.choice,
            "families": {name: probability for name, probability in self.families.items() if probability > LEAST},
            "inclusion": {name: probability for name, probability in self.included.items() if probability > LEAST},
            "sets": [
                {"causes": sorted(names), "probability": probability, "leaves_more": self.leaves_more(names)}
                for names, probability in self.sets.items()
                if probability > LEAST
            ],
        }
