"""The verdict in one sentence that a reader can repeat and act on: what was wrong by how much, is now, and why."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import Outcome
from rover_pin.report.words import Labels, brief, capital, cause, human, kinds_of, listing, pair

WORTH = 0.01
"""Relative change of an error below which it is not worth a word."""
MAX_NAMED_CHANNELS = 4
"""Channels up to which each is named; of more, the two that changed most."""
NOTHING = "of chance, nothing being missing"
"""Why a model without causes may be right all the same."""


def headline(verdict: Verdict, labels: Labels) -> str:
    """Return the verdict in one sentence with numbers and units, and what else of these data is to be known first."""
    sentence = capital(human(SENTENCES[verdict.answer](verdict, labels), kinds_of(verdict)))
    return f"{sentence} {labels.besides}" if labels.besides else sentence


def by_outcome(scores: Sequence[ChannelScore], *outcomes: Outcome) -> list[ChannelScore]:
    """Return the channels with one of these outcomes, those that changed most for their noise first.

    A change that is beyond the scatter and below `WORTH` is in the tables alone.
    """
    changed = [score for score in scores if score.worded.outcome in outcomes and abs(score.change) >= WORTH]
    return sorted(changed, key=lambda score: -score.times(abs(score.before - score.after)))


def worst(scores: Sequence[ChannelScore]) -> list[ChannelScore]:
    """Return the channels by how many times its noise each is missed, the most first."""
    return sorted(scores, key=lambda score: (not score.worded.lost, -score.times(score.before)))


def _changed(verdict: Verdict, labels: Labels, link: str, why: str) -> str:
    """Return what is better, why (`link` is "because" or "as if"), and of what nothing may be claimed."""
    better, worse = (by_outcome(verdict.scores, outcome) for outcome in (Outcome.BETTER, Outcome.WORSE))
    if not better:
        return f"no channel is predicted better {labels.unseen} beyond its scatter, though it looks as if {why}"
    few_channels = len(verdict.scores) <= MAX_NAMED_CHANNELS
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
    return "; ".join([f"{sentence} {labels.unseen}, {link} {why}", *remarks])


def _name(score: ChannelScore, labels: Labels) -> str:
    return labels.channel(score.name)


def _pairs(scores: Sequence[ChannelScore]) -> list[tuple[ChannelScore, tuple[str, str]]]:
    return [(score, pair(score.before, score.after, score.unit)) for score in scores]


def _causes(verdict: Verdict, names: Sequence[str], labels: Labels) -> list[str]:
    kinds = kinds_of(verdict)
    return [cause(name, kinds, labels.placed) for name in names]


def _named(verdict: Verdict, labels: Labels) -> str:
    return _changed(verdict, labels, "because", listing(_causes(verdict, verdict.named, labels))) + "."


def _set(verdict: Verdict, labels: Labels) -> str:
    sets = [names.split(" + ") for names in (verdict.indistinguishable or verdict.named)[:3]]
    whys = [NOTHING if names == ["nothing"] else listing(_causes(verdict, names, labels)) for names in sets]
    return _changed(verdict, labels, "because", f"either {listing(whys, 'or')}, which these data cannot tell") + "."


def _like(verdict: Verdict, labels: Labels) -> str:
    return _changed(verdict, labels, "as if", listing(_causes(verdict, verdict.named, labels))) + (
        "; something like it is missing, but the name does not stand alone."
    )


def _off(verdict: Verdict, labels: Labels) -> str:
    """Return by how much the model misses what it misses most."""
    clauses = []
    for score in worst(verdict.scores)[:2]:
        off = f"wrong by {brief(score.before, score.unit)}, {score.times(score.before):.2g} times its noise"
        clauses.append(f"{_name(score, labels)} is {'not predicted everywhere' if score.lost else off}")
    return listing(clauses)


def _none_needed(verdict: Verdict, labels: Labels) -> str:
    off = f": at worst {_off(verdict, labels)} {labels.unseen}" if verdict.scores else ""
    none = verdict.beliefs.sets.get(frozenset(), 0.0) if verdict.beliefs is not None else math.nan
    return f"nothing needs to be added{off}; none of the {verdict.tried} candidates acts, with probability {none:.2f}."


def _unexplained(verdict: Verdict, labels: Labels) -> str:
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
    Answer.NAMED: _named,
    Answer.SET: _set,
    Answer.LIKE: _like,
    Answer.NONE_NEEDED: _none_needed,
    Answer.NONE_FITS: _unexplained,
    Answer.INADEQUATE: _inadequate,
    Answer.CANNOT_TELL: _cannot_tell,
}
