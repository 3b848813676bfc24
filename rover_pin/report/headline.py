"""Sentences at the top of a report: the verdict, the change of the errors, reasons for and against, and the next run.

A `Verdict` is the result of the search for missing effects. All functions take a verdict and the `Labels`, which are
the words for its kind of data. They return complete sentences with the titles of effects ("slip-sinkage") instead of
their class names (SlipSinkage).
"""

import math
from collections.abc import Iterable, Iterator, Sequence

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.decision import beyond_noise_text, usual_noise
from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.rivals import is_better
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.profile import CONFIDENCE, MAJORITY
from rover_pin.estimation.wording import FLOOR_RATIO, MAX_LISTED, MAX_NAMED, MAX_NOISE_RATIO, Outcome, share
from rover_pin.report.cause_sets import (
    CauseSet,
    best_held_out,
    by_outcome,
    cause_sets,
    far_from_declared,
    in_order_of_interest,
    in_words,
    sizes_of,
    worst,
)
from rover_pin.report.words import Labels, brief, capital, cause, human, kinds_of, listing, pair, two_digits

MAX_HEADLINE_WORDS = 25
"""Maximum number of words in a headline. A longer sentence is replaced by a shorter one that names fewer causes,
because a headline must be understood at first reading."""

NOTHING_MISSING = "nothing is missing"
"""Clause of a headline for the alternative that no cause acts, so that the base model is right."""
UNUSABLE = "do not use the fitted numbers as constants"
"""Warning about the fitted numbers of a model that does not describe the data."""
MAX_NEGLIGIBLE_PROBABILITY = 1.0 - CONFIDENCE
"""Largest probability at which a cause that was not added is ignored. A more probable cause is named as a reason to
doubt the verdict. The value is the probability of error that a certain answer may have (see `CONFIDENCE`)."""
WRITE_AN_EFFECT = (
    "look at the remaining residual, write an effect that could cause it (rover-pin new-effect), and close the loop "
    "again with --effects"
)
NEXT_STEP = {
    Answer.NAMED: (
        "no other cause remains: drive where the effect matters most, and check that the model predicts that drive"
    ),
    Answer.NONE_NEEDED: "test the model harder: drive on steeper ground, faster, or with more slip",
    Answer.CANNOT_TELL: "take the measurement that the section 'The answer in full' names",
    Answer.NONE_FITS: WRITE_AN_EFFECT,
    Answer.INADEQUATE: (
        f"measure these numbers separately and declare the results; if they are as declared, {WRITE_AN_EFFECT}"
    ),
    Answer.LIKE: (
        "measure where the law of the effect and the data differ most, which the section on the residual shows"
    ),
    Answer.SET: "no candidate run distinguishes the remaining causes",
}
"""Kind of answer -> advice on the next step, for a verdict without a run that would resolve more of the uncertainty."""


def headline(verdict: Verdict, labels: Labels) -> str:
    """Return the verdict in one sentence of at most MAX_HEADLINE_WORDS words, with names of causes but without numbers.

    If several sets of causes remain possible, the sentence names the set that predicts held-out data best and the most
    probable set. It names the other sets only if there is room for them.
    """
    answer = verdict.answer
    if verdict.rival:
        # A curve without physics predicts some channel better than the model.
        errors = {score.name: score for score in verdict.scores}
        better = [
            baseline
            for baseline in verdict.baselines
            if baseline.channel in errors
            and is_better(baseline.error, errors[baseline.channel].floor, errors[baseline.channel].after)
        ]
        channels = listing(dict.fromkeys(labels.channel(baseline.channel) for baseline in better)) or "held-out data"
        curves = listing(dict.fromkeys(baseline.curve for baseline in better), "or") or "curve without physics"
        sentence = f"a {curves} predicts {channels} better than the model."
        if len(sentence.split()) > MAX_HEADLINE_WORDS:
            sentence = "curves without physics predict held-out data better than the model."
    elif verdict.named:
        sentences = [one.rstrip(".") + _contradictions(verdict) for one in _cause_sentences(verdict, labels)]
        sentence = next((one for one in sentences if len(one.split()) <= MAX_HEADLINE_WORDS), sentences[-1])
    elif answer is Answer.NONE_NEEDED:
        sentence = "no effect needs to be added to the model."
    elif answer is Answer.NONE_FITS:
        worst_channels = listing(labels.channel(score.name) for score in worst(verdict.scores)[:2])
        where = f" in {worst_channels}" if worst_channels else ""
        start = "something acts that is not on the list: no candidate explains the errors"
        sentences = [f"{start}{more}{_contradictions(verdict)}" for more in (where, "")]
        sentence = next((one for one in sentences if len(one.split()) <= MAX_HEADLINE_WORDS), sentences[-1])
    elif answer is Answer.INADEQUATE:
        numbers = listing(labels.placed(number.name) for number in far_from_declared(verdict))
        sentence = "the base model fits the data only with numbers far from their declared values"
        named = f"{sentence}: {numbers}"
        sentence = f"{named if numbers and len(named.split()) <= MAX_HEADLINE_WORDS else sentence}."
    else:
        sentence = "these data do not show which effect the model lacks."
    return capital(sentence)


def _contradictions(verdict: Verdict) -> str:
    """Return the end of a headline, which states up to two contradictions. Without a contradiction it is a full stop.

    The first contradiction is a residual that is too large to be noise, so that something else acts as well. The second
    one is that held-out data contradict the evidence.
    """
    beyond = "; something else acts as well" if verdict.beyond_noise and verdict.named else ""
    return beyond + ("; held-out data contradict the evidence." if verdict.overturned else ".")


def _cause_sentences(verdict: Verdict, labels: Labels) -> Iterator[str]:
    """Yield the possible headlines of a verdict that adds causes to the model. The most detailed headline is first, the
    shortest is last.
    """
    start = "the model's error comes from"
    added = in_words(verdict.named, verdict, labels)
    if verdict.answer is Answer.LIKE:
        yield f"{start} {added} or from an effect with a similar influence."
    sets = in_order_of_interest(verdict)
    if len(sets) == 1:
        yield f"{start} {added}."
        yield f"{start} {len(verdict.named)} causes that act together."
        return
    names = [in_words(row.names, verdict, labels) for row in sets if row.names]
    nothing = "" if len(names) == len(sets) else ", or nothing is missing"
    best, most_probable = best_held_out(verdict), cause_sets(verdict)[0]
    likely = in_words(most_probable.names, verdict, labels)
    likely_clause = f"{likely} is most probable" if likely else "most probably nothing is missing"
    if best is not None and best.names != most_probable.names:
        # The two sets that a reader must know are named in any case; the others follow if there is room.
        first = in_words(best.names, verdict, labels) or "the base model"
        sentence = f"{first} predicts held-out data best, and {likely_clause}"
        if others := [name for name in names if name not in (first, likely)]:
            one = len(others) == 1
            yield f"{sentence}; {listing(others)} {'is' if one else 'are'} also possible."
            yield f"{sentence}; {len(others)} more {'cause is' if one else 'causes are'} possible."
        yield f"{sentence}."
        yield "the cause that predicts held-out data best is not the most probable cause; the table lists both."
        return
    also = " and predicts held-out data best" if best is not None and likely else ""
    yield f"{start} {listing(names, 'or')}{nothing}; {likely_clause}{also}."
    yield f"{start} {listing(names, 'or')}{nothing}; {likely_clause}."
    if likely:
        yield f"{likely} is the most probable of {len(sets)} possible causes{also}."
    yield f"the model's error has {len(sets)} possible causes, which the table lists."


def full_answer(verdict: Verdict, labels: Labels) -> str:
    """Return the verdict in one sentence with the meaning of each possible cause, its size with unit and 95 % interval,
    and its probability.
    """
    # The alternatives in words, joined by "or", each with its probability.
    answer = verdict.answer
    alternatives = "; or ".join(
        (_describe_causes(row, verdict, labels) or NOTHING_MISSING)
        + (f", with probability {row.probability:.2f}" if math.isfinite(row.probability) else "")
        for row in in_order_of_interest(verdict)
    )
    # Each answer has its own form of sentence, which claims no more than the answer.
    if answer is Answer.NAMED:
        sentence = f"{alternatives}."
    elif answer is Answer.SET:
        sentence = f"either {alternatives}; these data cannot distinguish between these causes."
    elif answer is Answer.LIKE:
        causes = _describe_causes(in_order_of_interest(verdict)[0], verdict, labels)
        sentence = f"the data look as if {causes}; another effect with a similar influence may act instead."
    elif answer is Answer.NONE_NEEDED:
        none = verdict.beliefs.sets.get(frozenset(), 0.0) if verdict.beliefs is not None else math.nan
        sentence = f"no effect needs to be added: none of the {verdict.tried} candidates acts, with probability "
        sentence += f"{none:.2f}."
    elif answer is Answer.NONE_FITS:
        rival = f"{verdict.rival}; " if verdict.rival else ""
        errors = f"{_largest_errors(verdict, labels)} {labels.unseen}, and " if verdict.scores else ""
        sentence = (
            f"{rival}something acts that is not on the list: {errors}none of the {verdict.tried} candidates explains "
            f"these errors; {UNUSABLE}."
        )
    elif answer is Answer.INADEQUATE:
        sentence = f"{verdict.sentence.rstrip('.')}: {UNUSABLE}."
    else:
        sentence = f"these data do not show which effect the model lacks: {verdict.sentence}"
    # The sentence of the verdict, which two answers quote, already states what follows here.
    more: list[str] = []
    if answer not in (Answer.INADEQUATE, Answer.CANNOT_TELL):
        # A residual that is too large to be noise shows that something acts in addition to the named causes.
        if verdict.beyond_noise and verdict.named and verdict.beliefs:
            ratios = beyond_noise_text(verdict.beyond_noise, usual_noise(verdict.beliefs), labels.channel)
            more.append(f"Something else acts as well: the residual is {ratios}.")
        more += map(labels.placed, verdict.overturned)
    return capital(human(" ".join(filter(None, (sentence, *more))), kinds_of(verdict)))


def _describe_causes(row: CauseSet, verdict: Verdict, labels: Labels) -> str:
    """Return one clause for each cause of a set, joined by "; and ". If the set was fitted, a clause states the fitted
    numbers.
    """
    kinds = kinds_of(verdict)
    return "; and ".join(
        cause(name, kinds, labels.placed) + (f": {sizes}" if (sizes := sizes_of(row, name)) else "")
        for name in row.names
    )


def improvement(verdict: Verdict, labels: Labels) -> str:
    """Return the sentence on the change of the held-out errors.

    If no effect is needed, the sentence states the largest errors of the model instead. It may be empty.
    """
    if not verdict.named:
        if verdict.answer is not Answer.NONE_NEEDED or not verdict.scores:
            return ""
        return capital(f"the largest errors of the model: {_largest_errors(verdict, labels)} {labels.unseen}.")
    better, worse = (by_outcome(verdict.scores, outcome) for outcome in (Outcome.BETTER, Outcome.WORSE))
    if not better:
        return capital(f"no channel is predicted better {labels.unseen} beyond its scatter.")

    def with_errors(scores: Sequence[ChannelScore]) -> list[tuple[str, str, str]]:
        return [(labels.channel(score.name), *pair(score.before, score.after, score.unit)) for score in scores]

    # With few channels every channel is accounted for: better, worse, or no claim. Otherwise the sentence names the two
    # channels that improved most, and counts the other channels.
    few_channels = len(verdict.scores) <= MAX_NAMED
    (name, was, now), *more = with_errors(better if few_channels else better[:2])
    sentence = f"{name} was wrong by {was} and is now wrong by {now}"
    also = [f"{name}: {was} to {now}" for name, was, now in more]
    sentence += f" ({'; '.join(also)})" if also else ""
    remarks = [
        f"the error of {name} rose from {was} to {now}" for name, was, now in with_errors(worse if few_channels else [])
    ]
    unclaimed = [labels.channel(score.name) for score in verdict.scores if score not in (*better, *worse)]
    if not few_channels:
        remarks.append(f"{len(better)} of {len(verdict.scores)} channels are better and {len(worse)} worse")
    elif unclaimed:
        remarks.append(f"no claim is made for {listing(unclaimed)}, whose change is within the scatter")
    return capital("; ".join([f"{sentence} {labels.unseen}", *remarks]) + ".")


def _largest_errors(verdict: Verdict, labels: Labels) -> str:
    """Return a clause on the two channels whose held-out errors are the largest multiples of their noise."""
    clauses = []
    for score in worst(verdict.scores)[:2]:
        error = f"wrong by {brief(score.before, score.unit)}, {score.times(score.before):.2g} times its noise"
        clauses.append(f"{labels.channel(score.name)} is {'not predicted everywhere' if score.lost else error}")
    return listing(clauses)


def supporting_reasons(verdict: Verdict, labels: Labels) -> list[str]:
    """Return the reasons to believe a verdict, one sentence for each. The first reason is the change of the held-out
    errors.
    """
    lines: list[str] = []
    if verdict.named and verdict.before is not None and verdict.after is not None:
        better, worse = (by_outcome(verdict.scores, outcome) for outcome in (Outcome.BETTER, Outcome.WORSE))
        if better:
            score = better[0]
            change = f"{share(score.change)} [{share(score.low)}, {share(score.high)}]"
            lines.append(
                f"{len(better)} of {len(verdict.scores)} channels are predicted better {labels.unseen}, and "
                f"{len(worse)} worse, by more than their scatter; the error of {labels.channel(score.name)} changes "
                f"most, by {change}"
            )
        # Only a majority of repeated selections supports the choice.
        agree, folds = verdict.agreeing_folds, len(verdict.chosen)
        if folds and 2 * agree > folds:
            lines.append(_repeated_choices(verdict, labels))
        if verdict.share > 0:
            removed = f"{verdict.share:.0%} of the base model's error above the noise {labels.unseen}"
            lines.append(f"the added effects remove {removed}")
        before, after = two_digits(verdict.before.misfit), two_digits(verdict.after.misfit)
        lines.append(f"chi2 per measured value falls from {before} to {after}, where 1 is the noise")
    elif not verdict.named and verdict.before is not None:
        lines += [
            f"chi2 per measured value is {two_digits(verdict.before.misfit)}, where 1 is the noise",
            f"{verdict.tried} candidates were weighed, alone and together, with all uncertain numbers free",
        ]
    return _as_sentences(verdict, map(labels.placed, (*lines[:1], *labels.evidence, *lines[1:])))


def opposing_reasons(verdict: Verdict, labels: Labels) -> list[str]:
    """Return the reasons to doubt a verdict, one sentence for each, the strongest reason first."""
    # The order is from the strongest doubt to the weakest.
    doubts = list(verdict.vetoes)
    for score in by_outcome(verdict.scores, Outcome.WORSE):
        doubts.append(f"{labels.channel(score.name)} is predicted worse by {share(score.change)} {labels.unseen}")
    if verdict.named:
        if verdict.chosen and 2 * verdict.agreeing_folds <= len(verdict.chosen):
            doubts.append(_repeated_choices(verdict, labels))
        sets = cause_sets(verdict)
        others = [in_words(row.names, verdict, labels) for row in sets if row.names and row.names != verdict.named]
        if others:
            added = in_words(verdict.named, verdict, labels)
            doubts.append(f"{listing(others, 'or')} cannot be distinguished from {added} by these data")
        # Without probabilities, nothing is known about a further discrepancy.
        more = verdict.beliefs.probability(lambda hypothesis: hypothesis.leaves_more) if verdict.beliefs else 0.0
        if more > MAJORITY:
            doubts.append(
                f"whichever cause acts, a discrepancy larger than the noise remains with probability {more:.2f}"
            )
    # A part of the data that the others predict worse with the added effects contradicts these effects.
    worst_run = max(verdict.runs, key=lambda run_score: run_score.after / max(run_score.before, 1e-9), default=None)
    if verdict.named and worst_run is not None and worst_run.after > FLOOR_RATIO * worst_run.before:
        doubts.append(
            f"{labels.fold(worst_run.run)} is predicted worse with the added effects by a fit to the other data "
            f"(chi2 per measured value {two_digits(worst_run.before)} -> {two_digits(worst_run.after)})"
        )
    # Even with the added effects, an error far above the noise means that something else is missing.
    noisy = [score for score in worst(verdict.scores) if score.after > MAX_NOISE_RATIO * score.floor]
    if noisy and (verdict.named or verdict.answer is Answer.NONE_NEEDED):
        score, still = noisy[0], "still " if verdict.named else ""
        times = two_digits(score.times(score.after))
        doubts.append(f"the held-out error of {labels.channel(score.name)} is {still}{times} times its noise")
    doubts += [equivalent.sentence for equivalent in verdict.equivalents[:MAX_LISTED]]
    doubts += [caution for caution in verdict.cautions if caution.partition(":")[0] not in verdict.vetoes]
    for finding in verdict.findings:
        doubts.append(f"finding of the data check: {finding}")
    if verdict.named:
        doubts.append(
            f"only the {verdict.tried} listed candidates were weighed; an unlisted effect may have the same influence"
        )
    elif verdict.answer is Answer.NONE_NEEDED:
        # The first entry is the most probable cause.
        name, probability = next(iter(verdict.beliefs.included.items()), ("", 0.0)) if verdict.beliefs else ("", 0.0)
        if probability > MAX_NEGLIGIBLE_PROBABILITY:
            doubts.append(f"{name} may act nevertheless, with probability {probability:.2f}")
        doubts.append(
            "an effect that is too small for these data may act; the section 'Detection limits' gives the smallest "
            "detectable sizes"
        )
    return _as_sentences(verdict, map(labels.placed, doubts))


def next_run(verdict: Verdict) -> list[str]:
    """Return the drives or measurements that a user should make next, one sentence for each.

    These are the runs that are expected to resolve most of the uncertainty. If no such run was found, there is one
    sentence of advice, which depends on the kind of answer.
    """
    if verdict.experiments:
        return _as_sentences(verdict, (experiment.sentence for experiment in verdict.experiments))
    return [capital(WRITE_AN_EFFECT if verdict.rival else NEXT_STEP[verdict.answer]) + "."]


def _as_sentences(verdict: Verdict, lines: Iterable[str]) -> list[str]:
    """Return clauses as complete sentences. A clause that occurs twice is returned once.

    Titles of effects ("digging") replace their class names (DiggingMemory).
    """
    kinds = kinds_of(verdict)
    return [capital(human(line, kinds)).rstrip(".") + "." for line in dict.fromkeys(lines)]


def _repeated_choices(verdict: Verdict, labels: Labels) -> str:
    """Return the clause with the number of repeated selections of effects that agree with the verdict.

    Each repeated selection leaves out one fold of the data, which is a run or a slip level.
    """
    agree, folds = verdict.agreeing_folds, len(verdict.chosen)
    return (
        f"the selection of effects was repeated {folds} times, each time without one of the {labels.folds}, and "
        f"{agree} of the {folds} selections agree with the verdict"
    )
