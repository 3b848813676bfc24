"""Decide the answer of the search for missing effects from the probabilities of all hypotheses, and write the answer as
a sentence.

Two further rules are in other files: `conclude` rejects a base model whose fitted parameters are far from their
declared values, and `rivals` rejects a model if a plain curve predicts the data better.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.candidate import DECLARED
from rover_pin.estimation.profile import CONFIDENCE, MAJORITY
from rover_pin.estimation.wording import MAX_LISTED, MAX_NAMED, MIN_MENTIONED
from rover_pin.inference.beliefs import Beliefs

MAX_NOISE_RATIO = 3.0
"""Maximum ratio of a channel's residual to its declared noise. A larger residual counts as unexplained even if it looks
like noise. The residual of a drive log without declared noise is compared with the scatter of its samples.

The answer is then "none of these" instead of "no effect needed". Noise that was estimated from five repeats is too
small by this factor only once in 50 cases."""


class Decision(NamedTuple):
    """The answer of the search for missing effects, the causes that are added to the model, and the sets of causes that
    remain possible.
    """

    answer: Answer
    retained: tuple[str, ...] = ()
    """names of the causes that are added to the base model (called the kept causes)"""
    sets: tuple[tuple[str, ...], ...] = ()
    """most probable sets of causes, whose probabilities together exceed CONFIDENCE; without sets that contain a more
    probable set and add causes to it"""
    otherwise: tuple[str, ...] = ()
    """names of the parameters whose declared values are wrong, if no effect is missing"""
    reasons: tuple[str, ...] = ()
    """sentences that state where held-out data contradict the evidence, if they do (see `confirm`)"""
    basis: str = ""
    """words for the origin of the probabilities that the answer states, if they do not follow from the evidence"""
    doubts: tuple[str, ...] = ()
    """clauses that state why the evidence is not to be trusted: a residual that is not noise, or a fit that did not
    reach its minimum"""


def decide(beliefs: Beliefs) -> Decision:
    """Return the answer that follows from the probabilities of the hypotheses.

    1. If the hypotheses "nothing is missing" and "only a declared number is wrong" together have a probability above
    0.5, no effect is added. The answer is INADEQUATE if the probability of a wrong number exceeds CONFIDENCE. Otherwise
    it is NONE_FITS if the base model more likely than not leaves a discrepancy, and NONE_NEEDED if not.

    2. If no family of causes has a probability above 0.5, the answer is CANNOT_TELL.

    3. Otherwise the most probable set of causes is kept. The answer is SET if the hypotheses that contain this set do
    not together exceed CONFIDENCE. If they do, the answer is LIKE if the set more likely than not leaves a discrepancy,
    and NAMED if not.
    """
    # Rule 1: nothing is missing, or only a declared number is wrong.
    none = beliefs.sets.get(frozenset(), 0.0)
    otherwise = beliefs.probability(lambda hypothesis: {cause.family for cause in hypothesis.causes} == {DECLARED})
    if none + otherwise > MAJORITY:
        if beliefs.families.get(DECLARED, 0.0) > CONFIDENCE:
            return Decision(Answer.INADEQUATE, otherwise=_leading(beliefs)[0])
        # The residual may also exceed the noise without any structure. Learnt noise was estimated from the residual, so
        # it is compared with the scatter of the samples, which no model error enlarges.
        leaves = beliefs.leaves_more(()) > MAJORITY or bool(beyond_noise((), beliefs))
        return Decision(Answer.NONE_FITS if leaves else Answer.NONE_NEEDED)
    # The empty set (nothing is missing) goes last, because rule 3 keeps the first set. Rule 2: no family stands out.
    sets = tuple(sorted(_leading(beliefs), key=lambda names: not names))
    if max((p for family, p in beliefs.families.items() if family != DECLARED), default=0.0) <= MAJORITY:
        return Decision(Answer.CANNOT_TELL, (), sets)
    retained = sets[0]
    # Rule 3: a larger set that contains the kept one also speaks for the kept causes.
    contained = beliefs.probability(lambda hypothesis: set(retained) <= set(hypothesis.names))
    if contained <= CONFIDENCE:
        return Decision(Answer.SET, retained, sets)
    return Decision(Answer.LIKE if beliefs.leaves_more(retained) > MAJORITY else Answer.NAMED, retained, sets[:1])


def _leading(beliefs: Beliefs) -> tuple[tuple[str, ...], ...]:
    """Return the most probable sets of causes, as few as together exceed CONFIDENCE.

    A set that contains a more probable set and only adds causes to it is not returned.
    """
    total = 0.0
    leading: list[tuple[str, ...]] = []
    for names, probability in beliefs.sets.items():
        if total > CONFIDENCE:
            break
        total += probability
        # A larger set adds nothing to the answer if a part of it is already among the possible sets.
        if not any(set(before) < set(names) for before in leading if before):
            leading.append(beliefs.best(tuple(names)).names)
    return tuple(leading)


def sentence(decision: Decision, beliefs: Beliefs, share: float, misfit: float) -> str:
    """Return the answer as a sentence with probabilities, for the first lines of a report.

    Parameters
    ----------
    decision : Decision
        Answer, kept causes and possible sets of causes.
    beliefs : Beliefs
        Probabilities of the hypotheses.
    share : float
        Fraction of the base model's held-out error (above the noise) that the kept causes remove.
    misfit : float
        Reduced chi-square of the base model with the declared noise.
    """
    # Parts of sentences that several answers use.
    retained = " and ".join(decision.retained)
    probability = beliefs.probability(lambda hypothesis: set(decision.retained) <= set(hypothesis.names))
    removes = f"removes {share:.0%} of the base model's held-out error (above the noise)"
    listed = " or ".join(
        f"{' + '.join(names) or 'nothing'} ({probability:.2f})"
        for names, probability in likeliest(decision.sets, beliefs)
    )
    none, unexplained = beliefs.sets.get(frozenset(), 0.0), beliefs.leaves_more(decision.retained)
    basis = f" {decision.basis}" if decision.basis else ""

    # Families of causes are stated if one cause of the family acts more likely than not, even where the data do not
    # determine which one.
    families = [f"{name} ({p:.2f})" for name, p in beliefs.families.items() if p > MAJORITY]
    missing = f"missing with these probabilities: {', '.join(families)}; " if families else ""
    more = beliefs.probability(lambda hypothesis: hypothesis.leaves_more)
    discrepancy = (
        f" Whichever cause acts, a discrepancy larger than the noise remains with probability {more:.2f}."
        if more > MAJORITY
        else ""
    )
    unlisted = beliefs.has_discrepancy(())
    # "Nothing is missing" would contradict a discrepancy that certainly acts, however small it is.
    base = (
        f"no effect of the list is missing with probability {none:.2f}; a discrepancy that none of them explains acts "
        f"with probability {unlisted:.2f}, but it is smaller than the noise"
        if unlisted > CONFIDENCE
        else f"nothing is missing with probability {none:.2f}; the residual of the base model is noise"
    )
    # A law that leaves a discrepancy is only similar to the true one; held-out data can show the same (the reasons).
    leaves = (
        f", but its law leaves a discrepancy larger than the noise with probability {unexplained:.2f}"
        if unexplained > MAJORITY
        else ""
    )
    # Channels in which the residual is too large to be noise, whatever the answer is.
    beyond = beyond_noise_text(beyond_noise(decision.retained, beliefs), usual_noise(beliefs))
    exceeds = f"is {beyond}" if beyond else f"exceeds the noise (reduced chi-square {misfit:.3g})"
    none_fits = (
        "the causes that the data support predict held-out data worse than the base model"
        if decision.reasons
        else f"no effect of the list is missing with probability {none:.2f}, but the residual of the base model "
        f"{exceeds}"
    )
    words = {
        Answer.NAMED: f"{retained} is missing with probability {probability:.2f}{basis}; it {removes}.",
        Answer.LIKE: f"something like {retained} is missing (probability {probability:.2f}{basis}): "
        f"{retained} {removes}{leaves}.",
        Answer.SET: f"{missing}the data leave open whether it is {listed}; the first {removes}.{discrepancy}",
        Answer.NONE_NEEDED: f"{base}.",
        Answer.NONE_FITS: f"something acts that is not on the list: {none_fits}.",
        Answer.INADEQUATE: "the base model fits the data only with numbers far from their declared values"
        + (f": {', '.join(decision.otherwise)}." if decision.otherwise else "."),
        Answer.CANNOT_TELL: f"something is missing with probability {1.0 - none:.2f}: {listed}.{discrepancy}",
    }[decision.answer]
    is_said = decision.answer is Answer.NONE_FITS and not decision.reasons
    also = f"Something else acts as well: the residual is {beyond}." if beyond and not is_said else ""
    return " ".join(filter(None, (words, also, *decision.reasons)))


def beyond_noise_text(
    ratios: Mapping[str, float], noise: str, channel: Callable[[str], str] = lambda name: name
) -> str:
    """Return the channels of `beyond_noise` as text, the largest ratio first: "6.0 times the scatter of its samples in
    wheel_rate_mr"; empty if there is no such channel.

    `ratios` is the result of `beyond_noise`, `noise` the result of `usual_noise`, and `channel` returns the words for
    the name of a channel.
    """
    largest_first = sorted(ratios.items(), key=lambda row: -row[1])
    parts = [f"{ratio:.1f} times {noise} in {channel(name)}" for name, ratio in largest_first[:MAX_LISTED]]
    others = len(largest_first) - len(parts)
    return ", ".join(parts) + (f", and more than {MAX_NOISE_RATIO:g} times in {others} more" if others else "")


def beyond_noise(names: Sequence[str], beliefs: Beliefs) -> dict[str, float]:
    """Return the channels whose residual is too large to be noise, as a mapping from the channel's name to the ratio of
    its residual to its noise.

    The residual belongs to the base model with the causes `names`. Only channels with a ratio above MAX_NOISE_RATIO are
    returned.
    """
    return {name: ratio for name, ratio in beliefs.noise_taken(names).items() if ratio > MAX_NOISE_RATIO}


def usual_noise(beliefs: Beliefs) -> str:
    """Return the words for the noise that a residual is compared with: "its declared noise" if the experiment declares
    its noise, otherwise "the scatter of its samples".
    """
    return "its declared noise" if beliefs.best(()).experiment.noise() is not None else "the scatter of its samples"


def likeliest(sets: Sequence[tuple[str, ...]], beliefs: Beliefs) -> list[tuple[tuple[str, ...], float]]:
    """Return the sets of causes that the sentence of the answer lists, each with its probability.

    The first set of `sets` is always listed. Of the MAX_NAMED most probable sets, every set with a probability of at
    least MIN_MENTIONED is also listed.
    """
    rows = shares(sets, beliefs)
    # The order of the list is kept: the first set is the kept one, although another may be more probable.
    most_probable = sorted(rows, key=lambda row: -row[1])[:MAX_NAMED]
    return [row for row in rows if row == rows[0] or (row in most_probable and row[1] >= MIN_MENTIONED)]


def shares(sets: Sequence[tuple[str, ...]], beliefs: Beliefs) -> list[tuple[tuple[str, ...], float]]:
    """Divide the probability among the listed sets of causes, and return each set with its part.

    The part of a set is the total probability of all hypotheses that contain this set but no earlier set of the list,
    so that the parts sum to 1 at most. For the empty set, only the hypotheses without causes count, because every
    hypothesis contains the empty set.
    """
    listed, remaining = [], beliefs.sets
    for names in sets:
        wanted = frozenset(names)
        # Hypotheses that were counted for an earlier set are removed, so that none is counted twice.
        containing = [causes for causes in remaining if (causes >= wanted if wanted else not causes)]
        listed.append((names, sum(remaining[causes] for causes in containing)))
        remaining = {causes: p for causes, p in remaining.items() if causes not in containing}
    return listed
