"""Confirm the answer of the evidence on held-out data, and change the answer where the two disagree.

The evidence compares the causes by the probability of all data. Held-out data show whether the same causes are chosen
and predict better if a fold (group of samples left out together, such as a run) is not used. A name needs both.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from scipy.stats import t as student

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.decision import Decision, decide
from rover_pin.discrepancy.held_out_errors import ChannelScore, HeldOut, taken_share
from rover_pin.discrepancy.rivals import is_better
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.least_squares import Task
from rover_pin.estimation.profile import CONFIDENCE, MAJORITY, MAX_CHI_SQUARE
from rover_pin.estimation.wording import Outcome, share
from rover_pin.inference.beliefs import (
    Beliefs,
    Hypothesis,
    across_folds,
    chosen_without,
    excluding,
    held_out_gain,
    toward_prior,
)


class Confirmation(NamedTuple):
    """The answer after the comparison with held-out data, and the probabilities from which it follows."""

    decision: Decision
    beliefs: Beliefs
    """probabilities of the hypotheses from which the answer follows: the probabilities from the evidence, or their
    averages over the folds, or the probabilities of the sets of causes that held-out data do not contradict"""


def confirmed(beliefs: Beliefs, held_out_of: Callable[[Hypothesis], HeldOut]) -> Confirmation:
    """Return the answer that the evidence and the held-out data give together.

    1. If the answer names causes, but more than half of the folds drop them (another set is most probable without the
    fold), or one fold drops them and the reduced chi2 exceeds MAX_CHI_SQUARE, the answer follows from the probabilities
    that are averaged over the folds. If nothing is most probable on average, it is SET: these causes or nothing. An
    answer LIKE changes only if more than half of the folds drop the causes; otherwise only the stated probability is
    replaced by the average.

    2. The kept causes fail if they lower the log predictive density of the held-out folds by more than its scatter, or
    if a channel is worse on held-out data while no held-out error is removed in total. The answer then follows from the
    remaining sets: LIKE instead of NAMED, because the evidence speaks for another set, and NONE_FITS if no cause
    remains.

    3. If a channel is worse, but held-out error is removed in total, the answer is LIKE instead of NAMED.

    4. If the reduced chi2 with the kept causes exceeds MAX_CHI_SQUARE, or if their fit did not reach its minimum, the
    evidence cannot be certain of them. The answer is LIKE instead of NAMED, and the probabilities are averaged over the
    folds and the prior (`toward_prior`), unless the average over the folds is already below F / (F + 1) for F folds.

    Parameters
    ----------
    beliefs : Beliefs
        Probabilities of all hypotheses given all data.
    held_out_of : function
        Takes the hypothesis of a set of causes and returns its held-out errors, compared with those of the base model.
    """
    evidence = decision = decide(beliefs)
    deciding, reasons, basis, is_averaged = beliefs, list[str](), "", False
    # Rule 1: a name must not depend on a few folds. `dropping` has the choice of each fold that drops the causes: the
    # set that is most probable without this fold, if it does not contain all of them.
    stands_alone, choices = decision.answer in (Answer.NAMED, Answer.LIKE), chosen_without(beliefs)
    dropping = [chosen for chosen in choices if stands_alone and not set(decision.retained) <= chosen]
    most_drop = len(dropping) > MAJORITY * len(choices)
    is_far = bool(dropping) and declared_fit(beliefs.best(decision.retained)).misfit > MAX_CHI_SQUARE
    if most_drop or is_far:
        sets = [" + ".join(sorted(chosen)) or "nothing" for chosen in dropping]
        others = [f"{names} in {sets.count(names)}" for names in dict.fromkeys(sets)]
        reasons.append(
            f"With all data, {' + '.join(decision.retained)} is most probable, but another set is most probable "
            f"without {len(sets)} of the {len(choices)} folds, each left out alone ({', '.join(others)}); the stated "
            "probabilities are averages over the folds."
        )
        deciding, basis, is_averaged = across_folds(beliefs), "on average over the folds", True
        # LIKE already states that the law leaves a discrepancy; a few folds change its probability only.
        if most_drop or decision.answer is Answer.NAMED:
            decision = decide(deciding)
        if decision.answer in (Answer.NONE_NEEDED, Answer.NONE_FITS):
            decision = Decision(Answer.SET, evidence.retained, (evidence.retained, ()))
    # Rules 2 and 3: the kept causes must predict. The set that fails is left out, and the next one is tested.
    while decision.retained and (kept := deciding.best(decision.retained)).is_fitted:
        scores = held_out_of(kept).channels
        worse, removed = worse_channels(scores), taken_share(scores)
        # The loss is the decrease of the log predictive density of the held-out folds [nats]. It is 0 if the decrease
        # does not exceed its scatter between folds (Student's t test, two-sided at 95 %).
        gain, loss = held_out_gain(beliefs, kept.names), 0.0
        if len(choices) > 1:
            reach = student.ppf(0.5 + 0.5 * CONFIDENCE, len(choices) - 1) * gain.scatter
            loss = -gain.total if gain.total + reach < 0.0 else 0.0
        if not loss and not worse:
            break
        reason = _reason_of_errors(beliefs, kept.names, loss, worse, removed)
        if not loss and removed > 0:
            reasons += [reason] if decision.answer is Answer.NAMED else []
            decision = decision._replace(answer=_weaker(decision.answer))
            break
        reasons.append(reason)
        deciding, basis = excluding(deciding, kept.names), "among the causes that held-out data do not contradict"
        decision = decide(deciding)
        decision = decision._replace(answer=_weaker(decision.answer))
    # No cause remains: something acts if the evidence is certain of it, and otherwise the question stays open.
    is_open = beliefs.sets.get(frozenset(), 0.0) > 1.0 - CONFIDENCE
    if reasons and decision.answer is Answer.NONE_FITS and is_open:
        decision, deciding, basis = Decision(Answer.CANNOT_TELL, sets=evidence.sets), beliefs, ""
        is_averaged = False
    # Rule 4: without a description of the data, or without the minimum, no probability is near 0 or 1.
    doubts = doubts_of(deciding, decision.retained)
    if doubts:
        averaged = deciding if is_averaged else across_folds(deciding)
        # Folds that disagree already give an average that is not near 0 or 1.
        if not is_averaged or max(averaged.sets.values()) > len(choices) / (len(choices) + 1):
            deciding = toward_prior(averaged, len(choices))
            basis = "on average over the folds and the prior"
        answer = Answer.LIKE if decision.answer is Answer.NAMED else decision.answer
        decision = decision._replace(answer=answer, doubts=doubts)
    return Confirmation(decision._replace(reasons=tuple(reasons), basis=basis), deciding)


def doubts_of(beliefs: Beliefs, names: Sequence[str]) -> tuple[str, ...]:
    """Return clauses that state why the evidence for the causes `names` is not to be trusted; empty if it is.

    The residual with these causes may be too large to be noise, or their fit may have ended before its minimum.
    """
    model = f"the model with {' + '.join(names)}" if names else "the base model"
    misfit, doubts = declared_fit(beliefs.best(names)).misfit, []
    if misfit > MAX_CHI_SQUARE:
        doubts.append(
            f"the reduced chi-square of {model} is {misfit:.3g}, so that its residual is not noise and the evidence "
            "overstates each probability"
        )
    fall = beliefs.end.falls.get(frozenset(names), 0.0) if beliefs.end is not None else 0.0
    if fall:
        doubts.append(f"the fit of {model} did not reach its minimum: chi2 can still decrease by about {fall:.2g}")
    return tuple(doubts)


def declared_fit(hypothesis: Hypothesis) -> Fit:
    """Return the fit of a hypothesis with the declared noise, in which its reduced chi2 is stated.

    The fit itself may have used a larger noise. If no noise is declared, the fit is returned unchanged.
    """
    noise = hypothesis.experiment.noise()
    return hypothesis.fit if noise is None else replace(hypothesis.fit, task=Task(hypothesis.experiment, noise))


def worse_channels(scores: Sequence[ChannelScore]) -> list[ChannelScore]:
    """Return the channels that the kept causes predict worse than the base model on held-out data, the worst first.

    The base model is a rival of the kept model: its error must be visibly smaller (`rivals.is_better`), and smaller by
    more than the scatter between folds or stretches of runs. Many channels are compared, so that the interval of the
    change holds for all of them together. If a fold of a channel is no longer predicted at all, this channel counts as
    worse, too.
    """
    lost = [score for score in scores if math.isnan(score.after) and not math.isnan(score.before)]
    grown = [
        score
        for score in scores
        if score.worded.outcome is Outcome.WORSE
        and score.joint_low > 0
        and is_better(score.before, score.floor, score.after)
    ]
    return [*lost, *sorted(grown, key=lambda score: -score.change)]


def _weaker(answer: Answer) -> Answer:
    """Return the answer that remains of an answer of the evidence if held-out data contradict the evidence."""
    return {Answer.NAMED: Answer.LIKE, Answer.NONE_NEEDED: Answer.NONE_FITS}.get(answer, answer)


def _reason_of_errors(
    beliefs: Beliefs, names: Sequence[str], loss: float, worse: Sequence[ChannelScore], removed: float
) -> str:
    """Return the sentence that states why held-out data contradict the causes `names`.

    `loss` is the decrease of the log predictive density of held-out data [nats], `worse` are the channels that are
    predicted worse, and `removed` is the fraction of the held-out error that the causes remove.
    """
    probability = beliefs.probability(lambda hypothesis: set(names) <= set(hypothesis.names))
    facts = []
    if loss:
        facts.append(f"lowers the log probability of the held-out data by {loss:.2g}")
    if worse:
        change = "it is not predicted any more" if math.isnan(worse[0].after) else share(worse[0].change)
        more = f", and of {len(worse) - 1} more" if len(worse) > 1 else ""
        facts.append(f"makes the held-out error of {worse[0].name} larger ({change}){more}")
    return (
        f"With all data, {' + '.join(names)} has the probability {probability:.2f}, but it {' and '.join(facts)}; "
        f"in total it removes {removed:.0%} of the held-out error."
    )
