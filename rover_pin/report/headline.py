"""Sentences at the top of a report: the verdict, the change of the errors, reasons for and against, and the next run.

A `Verdict` is the result of the search for missing effects. All functions take a verdict and the `Labels`, which are
the words for its kind of data. They return complete sentences with the titles of effects ("slip-sinkage") instead of
their class names (SlipSinkage).
"""

import math
from collections.abc import Iterable, Iterator, Sequence

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.decision import likeliest
from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.profile import CONFIDENCE
from rover_pin.estimation.wording import FLOOR_RATIO, MAX_NAMED, MAX_NOISE_RATIO, MIN_MENTIONED, Outcome, share
from rover_pin.report.words import (
    Labels,
    brief,
    capital,
    cause,
    human,
    kinds_of,
    listing,
    pair,
    two_digits,
    with_interval,
)

NOTHING_MISSING = "nothing is missing"
"""Clause of a headline for the alternative that no cause acts, so that the base model is right."""
UNUSABLE = "do not use the fitted numbers as constants"
"""Warning about the fitted numbers of a model that does not describe the data."""
MAX_NEGLIGIBLE_PROBABILITY = 1.0 - CONFIDENCE
"""Largest probability of a cause that is not mentioned. If a cause that was not added is more probable, the report
names it as a reason to doubt the verdict."""
WRITE_AN_EFFECT = (
    "look at the remaining residual, write an effect that could cause it (rover-pin new-effect), and close the loop "
    "again with --effects"
)
NEXT_STEP = {
    Answer.NAMED: (
        "no other cause remains: drive where the effect matters most, and check that the model predicts that drive"
    ),
    Answer.NONE_NEEDED: "test the model harder: drive on steeper ground, faster, or with more slip",
    Answer.CANNOT_TELL: "take the measurement that the sentence above names",
    Answer.NONE_FITS: WRITE_AN_EFFECT,
    Answer.INADEQUATE: (
        "measure the numbers named above separately and declare the results; if they are as declared, "
        f"{WRITE_AN_EFFECT}"
    ),
    Answer.LIKE: (
        "measure where the law of the effect and the data differ most, which the section on the residual shows"
    ),
    Answer.SET: "no candidate run distinguishes the remaining causes",
}
"""Kind of answer -> advice on the next step, for a verdict without a run that would resolve more of the uncertainty."""


def headline(verdict: Verdict, labels: Labels) -> str:
    """Return the verdict in one sentence: the missing effect, its size with unit and 95 % interval, and its
    probability.
    """
    # The alternatives in words, joined by "or", each with its probability.
    answer = verdict.answer
    alternatives = "; or ".join(
        (_describe_causes(verdict, names, labels) or NOTHING_MISSING)
        + (f", with probability {p:.2f}" if math.isfinite(p) else "")
        for names, p in choices(verdict)
    )
    # Each answer has its own form of sentence, which claims no more than the answer.
    if answer is Answer.NAMED:
        sentence = f"{alternatives}."
    elif answer is Answer.SET:
        sentence = f"either {alternatives}; these data cannot distinguish between these causes."
    elif answer is Answer.LIKE:
        causes = _describe_causes(verdict, verdict.named, labels)
        sentence = f"the data look as if {causes}; another effect with a similar influence may act instead."
    elif answer is Answer.NONE_NEEDED:
        none = verdict.beliefs.sets.get(frozenset(), 0.0) if verdict.beliefs is not None else math.nan
        sentence = f"no effect needs to be added: none of the {verdict.tried} candidates acts, with probability "
        sentence += f"{none:.2f}."
    elif answer is Answer.NONE_FITS:
        rival = f"{verdict.rival}; " if verdict.rival else ""
        errors = f"{_largest_errors(verdict, labels)} {labels.unseen}, and " if verdict.scores else ""
        sentence = f"{rival}{errors}none of the {verdict.tried} candidates explains these errors: {UNUSABLE}."
    elif answer is Answer.INADEQUATE:
        sentence = f"{verdict.sentence.rstrip('.')}: {UNUSABLE}."
    else:
        sentence = f"these data do not show which effect the model lacks: {verdict.sentence}"
    return capital(human(sentence, kinds_of(verdict)))


def choices(verdict: Verdict) -> list[tuple[tuple[str, ...], float]]:
    """Return the alternatives that the headline lists, each as (names of its causes, probability).

    An alternative is a combination of causes that act together; an empty combination means that nothing is missing. Its
    probability is the sum over all combinations that contain these causes and none of the alternatives before it. The
    probability is NaN if no probabilities were computed.
    """
    # The verdict stores combinations as texts, such as "SlipSinkage + TetherDrag".
    sets = [tuple(names.split(" + ")) if names != "nothing" else () for names in verdict.indistinguishable]
    sets = sets or [verdict.named]
    return likeliest(sets, verdict.beliefs) if verdict.beliefs else [(names, math.nan) for names in sets]


def _describe_causes(verdict: Verdict, names: Sequence[str], labels: Labels) -> str:
    """Return one clause for each of the causes `names`, joined by "; and ".

    If a model with exactly these causes was fitted, the clause of a cause states its fitted numbers.
    """
    # Fits by their combination of causes; not every combination was fitted.
    fitted_sides = {" + ".join(verdict.named): verdict.after, **verdict.others}
    side = fitted_sides.get(" + ".join(names))
    clauses = []
    for name in names:
        owner = name.partition("@")[0]
        numbers = [
            number
            for number in (side.numbers if side else ())
            if number.name == name or number.name.startswith(f"{owner}.")
        ]
        # A single number with a unit is clear without its name: "(slip-sinkage): 1.2 mm [0.9, 1.5]".
        if len(numbers) == 1 and (numbers[0].unit or numbers[0].name == name):
            sizes = with_interval(numbers[0])
        else:
            sizes = listing(f"{number.name.rpartition('.')[2]} = {with_interval(number)}" for number in numbers)
        clauses.append(cause(name, kinds_of(verdict), labels.placed) + (f": {sizes}" if sizes else ""))
    return "; and ".join(clauses)


def improvement(verdict: Verdict, labels: Labels) -> str:
    """Return the sentences below the headline: the change of the held-out errors, and a remark on the data.

    If effects were added, the text states how the errors changed. If no effect is needed, it states the largest errors.
    The text may be empty.
    """
    sentence = ""
    if verdict.named:
        sentence = _change_sentence(verdict, labels)
    elif verdict.answer is Answer.NONE_NEEDED and verdict.scores:
        sentence = f"the largest errors of the model: {_largest_errors(verdict, labels)} {labels.unseen}."
    return " ".join(filter(None, (capital(sentence), labels.besides)))


def _change_sentence(verdict: Verdict, labels: Labels) -> str:
    """Return the sentence on the held-out errors without and with the added effects.

    If there are few channels, the sentence names all of them. Otherwise it names the two channels that improved most,
    and counts the other channels.
    """
    better, worse = (by_outcome(verdict.scores, outcome) for outcome in (Outcome.BETTER, Outcome.WORSE))
    if not better:
        return f"no channel is predicted better {labels.unseen} beyond its scatter."

    def with_errors(scores: Sequence[ChannelScore]) -> list[tuple[str, str, str]]:
        return [(labels.channel(score.name), *pair(score.before, score.after, score.unit)) for score in scores]

    # With few channels every channel is accounted for: better, worse, or no claim.
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
    return "; ".join([f"{sentence} {labels.unseen}", *remarks]) + "."


def _largest_errors(verdict: Verdict, labels: Labels) -> str:
    """Return a clause on the two channels whose held-out errors are the largest multiples of their noise."""
    clauses = []
    for score in worst(verdict.scores)[:2]:
        error = f"wrong by {brief(score.before, score.unit)}, {score.times(score.before):.2g} times its noise"
        clauses.append(f"{labels.channel(score.name)} is {'not predicted everywhere' if score.lost else error}")
    return listing(clauses)


def by_outcome(scores: Sequence[ChannelScore], *outcomes: Outcome) -> list[ChannelScore]:
    """Return the channels whose held-out error changed with one of these outcomes, such as better. The largest change
    is first.

    Changes are compared in units of the channel's noise. A relative change smaller than MIN_MENTIONED is not returned,
    even if it exceeds the scatter; only the tables show it.
    """
    changed = [score for score in scores if score.worded.outcome in outcomes and abs(score.change) >= MIN_MENTIONED]
    return sorted(changed, key=lambda score: -score.times(abs(score.before - score.after)))


def worst(scores: Sequence[ChannelScore]) -> list[ChannelScore]:
    """Return the channels sorted by their held-out error in units of their noise, the largest error first.

    Channels that the model does not predict everywhere come before all others.
    """
    return sorted(scores, key=lambda score: (not score.worded.lost, -score.times(score.before)))


def supporting_reasons(verdict: Verdict, labels: Labels) -> list[str]:
    """Return the reasons to believe a verdict, one sentence for each. The first reason is the change of the held-out
    errors.
    """
    lines = list(_reasons_for_addition(verdict, labels))
    if not verdict.named and verdict.before is not None:
        lines += [
            f"chi2 per measured value is {two_digits(verdict.before.misfit)}, where 1 is the noise",
            f"{verdict.tried} candidates were weighed, alone and together, with all uncertain numbers free",
        ]
    return _as_sentences(verdict, map(labels.placed, (*lines[:1], *labels.evidence, *lines[1:])))


def opposing_reasons(verdict: Verdict, labels: Labels) -> list[str]:
    """Return the reasons to doubt a verdict, one sentence for each, the strongest reason first."""
    return _as_sentences(verdict, map(labels.placed, _doubts(verdict, labels)))


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


def _reasons_for_addition(verdict: Verdict, labels: Labels) -> Iterator[str]:
    """Yield the reasons for the added effects: held-out errors, agreement of repeated selections, and the decrease of
    chi2.
    """
    if not verdict.named or verdict.before is None or verdict.after is None:
        return
    better, worse = (by_outcome(verdict.scores, outcome) for outcome in (Outcome.BETTER, Outcome.WORSE))
    if better:
        score = better[0]
        change = f"{labels.channel(score.name)} by {share(score.change)} [{share(score.low)}, {share(score.high)}]"
        yield (
            f"{labels.unseen} {len(better)} of {len(verdict.scores)} channels are predicted better beyond their "
            f"scatter and {len(worse)} worse; the error changes most for {change}"
        )
    # Only a majority of repeated selections supports the choice.
    agree, folds = verdict.agreeing_folds, len(verdict.chosen)
    if folds and 2 * agree > folds:
        yield _repeated_choices(verdict, labels)
    if verdict.share > 0:
        yield f"the added effects remove {verdict.share:.0%} of the base model's error above the noise {labels.unseen}"
    before, after = two_digits(verdict.before.misfit), two_digits(verdict.after.misfit)
    yield f"chi2 per measured value falls from {before} to {after}, where 1 is the noise"


def _repeated_choices(verdict: Verdict, labels: Labels) -> str:
    """Return the clause with the number of repeated selections of effects that agree with the verdict.

    Each repeated selection leaves out one fold of the data, which is a run or a slip level.
    """
    agree, folds = verdict.agreeing_folds, len(verdict.chosen)
    return f"the selection was repeated {folds} times, each time without one of the {labels.folds}, and {agree} agree"


def _doubts(verdict: Verdict, labels: Labels) -> Iterator[str]:
    """Yield the reasons to doubt a verdict, the strongest reason first."""
    # The order is from the strongest doubt to the weakest.
    yield from verdict.vetoes
    for score in by_outcome(verdict.scores, Outcome.WORSE):
        yield f"{labels.channel(score.name)} is predicted worse by {share(score.change)} {labels.unseen}"
    if verdict.named:
        if verdict.chosen and 2 * verdict.agreeing_folds <= len(verdict.chosen):
            yield _repeated_choices(verdict, labels)
        others = [" + ".join(names) for names, _ in choices(verdict)[1:] if names]
        if others:
            yield f"{listing(others, 'or')} cannot be distinguished from the first cause by these data"
    # A part of the data that the others predict worse with the added effects contradicts these effects.
    worst_run = max(verdict.runs, key=lambda run_score: run_score.after / max(run_score.before, 1e-9), default=None)
    if verdict.named and worst_run is not None and worst_run.after > FLOOR_RATIO * worst_run.before:
        yield (
            f"{labels.fold(worst_run.run)} is predicted worse with the added effects by a fit to the other data "
            f"(chi2 per measured value {two_digits(worst_run.before)} -> {two_digits(worst_run.after)})"
        )
    # Even with the added effects, an error far above the noise means that something else is missing.
    noisy = [score for score in worst(verdict.scores) if score.after > MAX_NOISE_RATIO * score.floor]
    if noisy and (verdict.named or verdict.answer is Answer.NONE_NEEDED):
        score, still = noisy[0], "still " if verdict.named else ""
        times = two_digits(score.times(score.after))
        yield f"the error of {labels.channel(score.name)} is {still}{times} times its noise"
    yield from (caution for caution in verdict.cautions if caution.partition(":")[0] not in verdict.vetoes)
    for finding in verdict.findings:
        yield f"finding of the data check: {finding}"
    if verdict.named:
        yield f"only the {verdict.tried} listed candidates were weighed; an unlisted effect may have the same influence"
    elif verdict.answer is Answer.NONE_NEEDED:
        # The first entry is the most probable cause.
        name, probability = next(iter(verdict.beliefs.included.items()), ("", 0.0)) if verdict.beliefs else ("", 0.0)
        if probability > MAX_NEGLIGIBLE_PROBABILITY:
            yield f"{name} may act nevertheless, with probability {probability:.2f}"
        yield (
            "an effect that is too small for these data may act; the section 'Detection limits' gives the smallest "
            "detectable sizes"
        )
