"""Values that a blind test reads from a verdict: the sets in the answer, and the probability of each cause."""

from __future__ import annotations

from collections.abc import Sequence

from rover_pin.discrepancy.decision import beyond_noise
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.profile import MAJORITY

CLEAR = 3.0
"""Evidence [nats] above which a hidden effect is detectable: odds of 20 to 1."""
LISTED = 0.01
"""Probability above which a cause is stored even if it is not a true (hidden) cause."""


def plain(name: str) -> str:
    """Return a cause's name without the position at which it begins."""
    return name.partition("@")[0]


def alike_of(verdict: Verdict) -> tuple[tuple[str, ...], ...]:
    """Return every set of causes that the verdict states as compatible with the data."""
    return tuple(tuple(map(plain, names.split(" + "))) for names in verdict.indistinguishable)


def acts_besides(verdict: Verdict) -> bool:
    """Return whether the verdict reports that the residual, or a channel of it, contains more than noise."""
    assert verdict.beliefs is not None
    more = verdict.beliefs.probability(lambda hypothesis: hypothesis.leaves_more)
    return more > MAJORITY or bool(beyond_noise(verdict.named, verdict.beliefs))


def inclusion_of(verdict: Verdict, true: Sequence[str]) -> dict[str, float]:
    """Return name of a cause -> its probability, for each cause whose probability exceeds LISTED, and for the true
    causes.
    """
    assert verdict.beliefs is not None
    included = {plain(name): probability for name, probability in verdict.beliefs.included.items()}
    # True causes are stored even if their probability is negligible, because the calibration needs them.
    return {
        name: probability
        for name, probability in (dict.fromkeys(true, 0.0) | included).items()
        if probability > LISTED or name in true
    }
