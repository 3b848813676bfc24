"""What a blind test reads from a verdict: the sets that were answered, and how probable each cause was said to be."""

from __future__ import annotations

from collections.abc import Sequence

from rover_pin.discrepancy.decision import beyond_noise
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.profile import MAJORITY

CLEAR = 3.0
"""Nats from which what was hidden is detectable: odds of 20 to 1."""
LISTED = 0.01
"""Probability from which a cause that is not there is kept too."""


def plain(name: str) -> str:
    """Return a cause's name without where on the way it begins."""
    return name.partition("@")[0]


def alike_of(verdict: Verdict) -> tuple[tuple[str, ...], ...]:
    """Return every set of causes that the data leave."""
    return tuple(tuple(map(plain, one.split(" + "))) for one in verdict.indistinguishable)


def acts_besides(verdict: Verdict) -> bool:
    """Return whether the verdict says that more than noise is left, or a channel with more than noise can be."""
    assert verdict.beliefs is not None
    more = verdict.beliefs.probability(lambda hypothesis: hypothesis.leaves_more)
    return more > MAJORITY or bool(beyond_noise(verdict.named, verdict.beliefs))


def inclusion_of(verdict: Verdict, true: Sequence[str]) -> dict[str, float]:
    """Return the probability of each cause that may act, and of the true ones."""
    assert verdict.beliefs is not None
    said = {plain(name): chance for name, chance in verdict.beliefs.included.items()}
    return {
        name: chance for name, chance in (dict.fromkeys(true, 0.0) | said).items() if chance > LISTED or name in true
    }
