"""The verdict in a sentence that a reader can repeat: what is missing, how much, how sure; then what it improves."""

import math
from collections.abc import Callable, Sequence

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.decision import likeliest
from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.wording import MAX_NAMED, WORTH, Outcome
from rover_pin.report.words import Labels, brief, capital, cause, human, kinds_of, listing, pair, with_interval

NOTHING = "nothing is missing"
"""Why a model without causes may be right all the same."""


def headline(verdict: Verdict, labels: Labels) -> str:
    """Return the verdict in one sentence: what is missing, its size with unit and interval, how probable that is."""
    return capital(human(SENTENCES[verdict.answer](verdict, labels), kinds_of(verdict)))


def improvement(verdict: Verdict, labels: Labels) -> str:
    """Return what is predicted better by how much, of what nothing may be claimed, and what else is to be known."""
    sentence = ""
    if verdict.named:
        sentence = _change_sentence(verdict, labels)
    elif verdict.answer is Answer.NONE_NEEDED and verdict.scores:
        sentence = f"at worst {_off(verdict, labels)} {labels.unseen}."
    return " ".join(filter(None, (capital(sentence), labels.besides)))


def by_outcome(scores: Sequence[ChannelScore], *outcomes: Outcome) -> list[ChannelScore]:
    """Return the channels with one of these outcomes, those that changed most for their noise first.

    A change that is beyond the scatter and below `WORTH` is in the tables alone.
    """
    changed = [score for score in scores if score.worded.outcome in outcomes and abs(score.change) >= WORTH]
    return sorted(changed, key=lambda score: -score.times(abs(score.before - score.after)))


def worst(scores: Sequence[ChannelScore]) -> list[ChannelScore]:
    """Return the channels by how many times its noise each is missed, the most first."""
    return sorted(scores, key=lambda score: (not score.worded.lost, -score.times(score.before)))


def _change_sentence(verdict: Verdict, labels: Labels) -> str:
    better, worse = (by_outcome(verdict.scores, outcome) for outcome in (Outcome.BETTER, Outcome.WORSE))
    if not better:
        return f"no channel is predicted better {labels.unseen} beyond its scatter."
    few_channels = len(verdict.scores) <= MAX_NAMED
    (score, (was, now)), *more = _pairs(better if few_channels else better[:2])
    sentence = f"{_name(score, labels)} was wrong by {was} and is now wrong by {now}"
    also = [f"{_name(score, labels)}: {was} to {now}" for score, (was, now) in more]
    sentence += f" ({'; '.join(also)})" if also else ""
    remarks = [
        f"{_name(score, labels)} got worse, from {was} to {now}"
        for score, (was, now) in _pairs(worse if few_channels else [])
    ]
    unclaimed = [_name(score, labels) for score in verdict.scores if score not in (*better, *worse)]
    if not few_channels:
        remarks.append(f"of {len(verdict.scores)} channels {len(better)} are better and {len(worse)} worse")
    elif unclaimed:
        remarks.append(f"{listing(unclaimed)}: no claim")
    return "; ".join([f"{sentence} {labels.unseen}", *remarks]) + "."


def _name(score: ChannelScore, labels: Labels) -> str:
    return labels.channel(score.name)


def _pairs(scores: Sequence[ChannelScore]) -> list[tuple[ChannelScore, tuple[str, str]]]:
    return [(score, pair(score.before, score.after, score.unit)) for score in scores]


def _causes(verdict: Verdict, names: Sequence[str], labels: Labels) -> str:
    """Return what acts, each with its size where it was fitted."""
    clauses, alternatives = [], {" + ".join(verdict.named): verdict.after, **verdict.others}
    side = alternatives.get(" + ".join(names))
    for name in names:
        amplitudes = listing(_amplitudes(side.numbers if side else (), name))
        clauses.append(cause(name, kinds_of(verdict), labels.placed) + (f": {amplitudes}" if amplitudes else ""))
    return "; and ".join(clauses)


def _amplitudes(fitted: Sequence[Number], name: str) -> list[str]:
    """Return the fitted numbers of a cause, without a name where it is one that its unit explains."""
    owner = name.partition("@")[0]
    numbers = [number for number in fitted if number.name == name or number.name.startswith(f"{owner}.")]
    if len(numbers) == 1 and (numbers[0].unit or numbers[0].name == name):
        return [with_interval(numbers[0])]
    return [f"{number.name.rpartition('.')[2]} = {with_interval(number)}" for number in numbers]


def _set_sentence(verdict: Verdict, labels: Labels) -> str:
    return f"either {_choice(verdict, labels)}: these data cannot tell."


def _choice(verdict: Verdict, labels: Labels) -> str:
    """Return the sets that are left, each with the probability of all that contain it and none before it."""
    return "; or ".join(
        (_causes(verdict, names, labels) or NOTHING) + (f", with probability {p:.2f}" if math.isfinite(p) else "")
        for names, p in choices(verdict)
    )


def choices(verdict: Verdict) -> list[tuple[tuple[str, ...], float]]:
    """Return the sets of causes that a sentence lists, with their probabilities; NaN where none was weighed."""
    sets = [tuple(names.split(" + ")) if names != "nothing" else () for names in verdict.indistinguishable]
    sets = sets or [verdict.named]
    return likeliest(sets, verdict.beliefs) if verdict.beliefs else [(names, math.nan) for names in sets]


def _like(verdict: Verdict, labels: Labels) -> str:
    return f"it looks as if {_causes(verdict, verdict.named, labels)}; but the name does not stand alone."


def _off(verdict: Verdict, labels: Labels) -> str:
    """Return by how much the model misses what it misses most."""
    clauses = []
    for score in worst(verdict.scores)[:2]:
        off = f"wrong by {brief(score.before, score.unit)}, {score.times(score.before):.2g} times its noise"
        clauses.append(f"{_name(score, labels)} is {'not predicted everywhere' if score.lost else off}")
    return listing(clauses)


def _none_needed(verdict: Verdict, labels: Labels) -> str:
    none = verdict.beliefs.sets.get(frozenset(), 0.0) if verdict.beliefs is not None else math.nan
    return f"nothing needs to be added: none of the {verdict.tried} candidates acts, with probability {none:.2f}."


def _unexplained_sentence(verdict: Verdict, labels: Labels) -> str:
    rival = f"{verdict.rival}; " if verdict.rival else ""
    off = f"{_off(verdict, labels)} {labels.unseen}, and " if verdict.scores else ""
    return (
        f"{rival}{off}none of the {verdict.tried} candidates explains it: do not use the fitted numbers as constants."
    )


def _inadequate(verdict: Verdict, labels: Labels) -> str:
    return f"{verdict.sentence.rstrip('.')}: do not use the fitted numbers as constants."


def _cannot_tell(verdict: Verdict, labels: Labels) -> str:
    return f"these data cannot tell what the model lacks: {verdict.sentence}"


SENTENCES: dict[Answer, Callable[[Verdict, Labels], str]] = {
    Answer.NAMED: lambda verdict, labels: f"{_choice(verdict, labels)}.",
    Answer.SET: _set_sentence,
    Answer.LIKE: _like,
    Answer.NONE_NEEDED: _none_needed,
    Answer.NONE_FITS: _unexplained_sentence,
    Answer.INADEQUATE: _inadequate,
    Answer.CANNOT_TELL: _cannot_tell,
}
