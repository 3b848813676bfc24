"""The answer that evidence gives as a sentence for a reader, probabilities first."""

from __future__ import annotations

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.beliefs import Beliefs
from rover_pin.discrepancy.reading import Reading
from rover_pin.estimation.fit import Fit

MAX_SETS = 4
"""Sets that a sentence lists."""


def sentence(reading: Reading, beliefs: Beliefs, share: float, base: Fit) -> str:
    """Return the answer as a sentence."""
    kept = " and ".join(reading.kept)
    chance = beliefs.probability(lambda hypothesis: set(reading.kept) <= set(hypothesis.names))
    takes = f"takes {share:.0%} of what the base model misses beyond the noise where it was not fitted"
    listed = " or ".join(
        f"{' + '.join(names) or 'nothing'} ({beliefs.sets[frozenset(names)]:.2f})" for names in reading.sets[:MAX_SETS]
    )
    none, left = beliefs.sets.get(frozenset(), 0.0), beliefs.left(reading.kept)
    return {
        Answer.NAMED: f"{kept} is missing with probability {chance:.2f}; it {takes}.",
        Answer.LIKE: f"something like {kept} is missing (probability {chance:.2f}): it {takes}, but with probability "
        f"{left:.2f} its law leaves more than noise.",
        Answer.SET: f"the data leave {listed}; the first {takes}.",
        Answer.NONE_NEEDED: f"nothing is missing with probability {none:.2f}; the base model leaves noise.",
        Answer.NONE_FITS: f"no cause of the list is missing with probability {none:.2f}, but the base model leaves "
        f"more than noise (reduced chi-square {base.misfit:.3g}): something acts that is not on the list.",
        Answer.CANNOT_TELL: f"the data cannot tell: {listed}.",
    }[reading.answer]
