"""The answer of the loop, decided from the probabilities of all hypotheses, the causes that are kept, and its words.

`conclude` says besides where numbers left what is declared of them, `rivals` where another model predicts better.
"""

from collections.abc import Sequence
from typing import NamedTuple

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import DECLARED
from rover_pin.estimation.profile import MOST, SURE
from rover_pin.estimation.wording import MAX_NAMED, WORTH
from rover_pin.inference.beliefs import Beliefs

BEYOND = 3.0
"""Times a channel's declared noise from which what is left is no noise, whatever shares it. Why: an SD of five repeats
is three times too small once in 50 sets."""


class Decision(NamedTuple):
    """An answer, the causes that the model keeps, and the sets that the data leave, most probable first."""

    answer: Answer
    retained: tuple[str, ...] = ()
    sets: tuple[tuple[str, ...], ...] = ()
    "what holds SURE of the probability, without what only adds to a set before it"
    otherwise: tuple[str, ...] = ()
    "the numbers that are not as declared, where nothing else is missing"


def decide(beliefs: Beliefs) -> Decision:
    """Return the answer: the most probable set is named where nearly all that is probable contains it.

    Nothing is missing, or nothing of the list, where that is more likely than not. Where a family of causes is, its
    leading set is kept, alone or among others, of which nothing may be one; where neither is, the data cannot tell
    what is missing. Where only what is declared of a number is otherwise, the base model as declared does not describe
    the data. A set whose laws more likely than not leave more than noise is like what is missing.
    """
    none = beliefs.sets.get(frozenset(), 0.0)
    otherwise = beliefs.probability(lambda hypothesis: {cause.family for cause in hypothesis.causes} == {DECLARED})
    if none + otherwise > MOST:
        if beliefs.families.get(DECLARED, 0.0) > SURE:
            return Decision(Answer.INADEQUATE, otherwise=_leading(beliefs)[0])
        leaves = beliefs.leaves_more(()) > MOST or _is_beyond(beliefs)
        return Decision(Answer.NONE_FITS if leaves else Answer.NONE_NEEDED)
    sets = tuple(sorted(_leading(beliefs), key=lambda names: not names))
    if max((p for family, p in beliefs.families.items() if family != DECLARED), default=0.0) <= MOST:
        return Decision(Answer.CANNOT_TELL, (), sets)
    retained = sets[0]
    contained = beliefs.probability(lambda hypothesis: set(retained) <= set(hypothesis.names))
    if contained <= SURE:
        return Decision(Answer.SET, retained, sets)
    return Decision(Answer.LIKE if beliefs.leaves_more(retained) > MOST else Answer.NAMED, retained, sets[:1])


def _is_beyond(beliefs: Beliefs) -> bool:
    """Return whether the base model leaves a channel with more than its declared noise can be.

    Noise that is learnt has what the ground does besides, of which there is no declaration to be beyond.
    """
    base = beliefs.best(())
    return base.experiment.noise() is not None and max(base.noise_taken.values()) > BEYOND


def _leading(beliefs: Beliefs) -> tuple[tuple[str, ...], ...]:
    """Return the sets that hold SURE of the probability, without those that only add to one before them."""
    total = 0.0
    leading: list[tuple[str, ...]] = []
    for names, probability in beliefs.sets.items():
        if total > SURE:
            break
        total += probability
        if not any(set(before) < set(names) for before in leading if before):
            leading.append(beliefs.best(tuple(names)).names)
    return tuple(leading)


def sentence(decision: Decision, beliefs: Beliefs, share: float, misfit: float) -> str:
    """Return the answer as a sentence; `misfit` is the base's reduced chi-square by the declared noise."""
    retained = " and ".join(decision.retained)
    probability = beliefs.probability(lambda hypothesis: set(decision.retained) <= set(hypothesis.names))
    takes = f"takes {share:.0%} of what the base model misses beyond the noise where it was not fitted"
    listed = " or ".join(
        f"{' + '.join(names) or 'nothing'} ({probability:.2f})"
        for names, probability in likeliest(decision.sets, beliefs)
    )
    none, unexplained = beliefs.sets.get(frozenset(), 0.0), beliefs.leaves_more(decision.retained)
    more = beliefs.probability(lambda hypothesis: hypothesis.leaves_more)
    besides = f" Whichever acts, more than noise is left with probability {more:.2f}." if more > MOST else ""
    words = {
        Answer.NAMED: f"{retained} is missing with probability {probability:.2f}; it {takes}.",
        Answer.LIKE: f"something like {retained} is missing (probability {probability:.2f}): it {takes}, but its law "
        f"leaves more than noise with probability {unexplained:.2f}.",
        Answer.SET: f"{_families(beliefs)}the data leave {listed}; the first {takes}.{besides}",
        Answer.NONE_NEEDED: f"nothing is missing with probability {none:.2f}; {_misfit_of_base(beliefs)}.",
        Answer.NONE_FITS: f"no cause of the list is missing with probability {none:.2f}, but the base model leaves "
        f"more than noise (reduced chi-square {misfit:.3g}): something acts that is not on the list.",
        Answer.INADEQUATE: "the base model meets the data only with numbers far from what is declared of them"
        + (f": {', '.join(decision.otherwise)}." if decision.otherwise else "."),
        Answer.CANNOT_TELL: f"something is missing with probability {1.0 - none:.2f}: {listed}.{besides}",
    }[decision.answer]
    return words + _besides(decision, beliefs)


def _misfit_of_base(beliefs: Beliefs) -> str:
    acts = beliefs.has_discrepancy(())
    if acts <= SURE:
        return "the base model leaves noise"
    return f"something on no list acts with probability {acts:.2f}, and is smaller than what is taken for noise"


def _besides(decision: Decision, beliefs: Beliefs) -> str:
    """Return the channels in which more is taken for noise than noise can be, in words; empty where none."""
    channels = beyond_noise(decision.retained, beliefs).items()
    beyond = [f"{times:.1f} times {usual_noise(beliefs)} in {name}" for name, times in channels]
    return f" Something acts besides: what is taken for noise is {', '.join(beyond)}." if beyond else ""


def beyond_noise(names: Sequence[str], beliefs: Beliefs) -> dict[str, float]:
    """Return the channels in which more is taken for noise, where these causes act, than BEYOND times what it is."""
    return {name: times for name, times in beliefs.noise_taken(names).items() if times > BEYOND}


def usual_noise(beliefs: Beliefs) -> str:
    """Return, in words, the noise of a channel to which what is left of it is compared."""
    return "its declared noise" if beliefs.best(()).experiment.noise() is not None else "what its samples scatter"


def likeliest(sets: Sequence[tuple[str, ...]], beliefs: Beliefs) -> list[tuple[tuple[str, ...], float]]:
    """Return the sets that a sentence lists, with their shares: the first, and the most probable that are worth it."""
    rows = shares(sets, beliefs)
    most = sorted(rows, key=lambda row: -row[1])[:MAX_NAMED]
    return [row for row in rows if row == rows[0] or (row in most and row[1] >= WORTH)]


def shares(sets: Sequence[tuple[str, ...]], beliefs: Beliefs) -> list[tuple[tuple[str, ...], float]]:
    """Return sets with the probability of each, of all that contain it and none before it."""
    listed, remaining = [], beliefs.sets
    for names in sets:
        wanted = frozenset(names)
        containing = [found_set for found_set in remaining if (found_set >= wanted if wanted else not found_set)]
        listed.append((names, sum(remaining[found_set] for found_set in containing)))
        remaining = {found_set: p for found_set, p in remaining.items() if found_set not in containing}
    return listed


def _families(beliefs: Beliefs) -> str:
    """Return the families of which one cause is more likely than not to act, in words."""
    sure = [f"{name} ({probability:.2f})" for name, probability in beliefs.families.items() if probability > MOST]
    return f"missing with these probabilities: {', '.join(sure)}; " if sure else ""
