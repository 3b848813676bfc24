"""The verdict in one sentence that a reader can repeat and act on: what was wrong by how much, is now, and why."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import Outcome
from rover_pin.report.words import Manner, brief, capital, cause, human, kinds_of, listing, pair

WORTH = 0.01
"""Relative change of an error below which it is not worth a word."""
FEW = 4
"""Channels up to which each is named; of more, the two that changed most."""


def headline(verdict: Verdict, manner: Manner) -> str:
    """Return the verdict in one sentence with numbers and units, and what else of these data is to be known first."""
    said = capital(human(SENTENCES[verdict.answer](verdict, manner), kinds_of(verdict)))
    return f"{said} {manner.besides}" if manner.besides else said


def by_outcome(scores: Sequence[ChannelScore], *outcomes: Outcome) -> list[ChannelScore]:
    """Return the channels with one of these outcomes, those that changed most for their noise first.

    A change that is beyond the scatter and below `WORTH` is in the tables alone.
    """
    found = [one for one in scores if one.worded.outcome in outcomes and abs(one.change) >= WORTH]
    return sorted(found, key=lambda one: -one.times(abs(one.before - one.after)))


def worst(scores: Sequence[ChannelScore]) -> list[ChannelScore]:
    """Return the channels by how many times its noise each is missed, the most first."""
    return sorted(scores, key=lambda one: (not one.worded.lost, -one.times(one.before)))


def _changed(verdict: Verdict, manner: Manner, link: str, why: str) -> str:
    """Return what is better, why (`link` is "because" or "as if"), and of what nothing may be claimed."""
    better, worse = (by_outcome(verdict.scores, one) for one in (Outcome.BETTER, Outcome.WORSE))
    if not better:
        return f"no channel is predicted better {manner.unseen} beyond its scatter, though it looks as if {why}"
    few = len(verdict.scores) <= FEW
    (one, (was, now)), *more = _pairs(better if few else better[:2])
    said = f"{_name(one, manner)} was wrong by {was} and is now wrong by {now}"
    also = [f"{_name(one, manner)}: {was} to {now}" for one, (was, now) in more]
    said += f" ({'; '.join(also)})" if also else ""
    rest = [f"{_name(one, manner)} got worse, from {was} to {now}" for one, (was, now) in _pairs(worse if few else [])]
    unclaimed = [_name(one, manner) for one in verdict.scores if one not in (*better, *worse)]
    if not few:
        rest.append(f"of {len(verdict.scores)} channels {len(better)} are better and {len(worse)} worse")
    elif unclaimed:
        rest.append(f"{listing(unclaimed)}: no claim")
    return "; ".join([f"{said} {manner.unseen}, {link} {why}", *rest])


def _name(one: ChannelScore, manner: Manner) -> str:
    return manner.channel(one.name)


def _pairs(scores: Sequence[ChannelScore]) -> list[tuple[ChannelScore, tuple[str, str]]]:
    return [(one, pair(one.before, one.after, one.unit)) for one in scores]


def _named(verdict: Verdict, manner: Manner) -> str:
    kinds = kinds_of(verdict)
    return _changed(verdict, manner, "because", listing(cause(name, kinds) for name in verdict.named)) + "."


def _set(verdict: Verdict, manner: Manner) -> str:
    kinds = kinds_of(verdict)
    either = listing((cause(name, kinds) for name in (verdict.alike or verdict.named)[:3]), "or")
    return _changed(verdict, manner, "because", f"either {either}, which these data cannot tell") + "."


def _like(verdict: Verdict, manner: Manner) -> str:
    kinds = kinds_of(verdict)
    return _changed(verdict, manner, "as if", listing(cause(name, kinds) for name in verdict.named)) + (
        "; something like it is missing, but the name does not stand alone."
    )


def _off(verdict: Verdict, manner: Manner) -> str:
    """Return by how much the model misses what it misses most."""
    said = []
    for one in worst(verdict.scores)[:2]:
        off = f"wrong by {brief(one.before, one.unit)}, {one.times(one.before):.2g} times its noise"
        said.append(f"{_name(one, manner)} is {'not predicted everywhere' if one.lost else off}")
    return listing(said)


def _none_needed(verdict: Verdict, manner: Manner) -> str:
    tried = verdict.search.count if verdict.search else 0
    off = f": at worst {_off(verdict, manner)} {manner.unseen}" if verdict.scores else ""
    return f"nothing needs to be added{off}, and none of the {tried} candidates gains more than chance."


def _unexplained(verdict: Verdict, manner: Manner) -> str:
    tried = verdict.search.count if verdict.search else 0
    off = f"{_off(verdict, manner)} {manner.unseen}, and " if verdict.scores else ""
    return f"{off}none of the {tried} candidates explains it: do not use the fitted numbers as constants."


def _cannot_tell(verdict: Verdict, manner: Manner) -> str:
    return f"these data cannot tell what the model lacks: {verdict.sentence}"


SENTENCES: dict[Answer, Callable[[Verdict, Manner], str]] = {
    Answer.NAMED: _named,
    Answer.SET: _set,
    Answer.LIKE: _like,
    Answer.NONE_NEEDED: _none_needed,
    Answer.NONE_FITS: _unexplained,
    Answer.INADEQUATE: _unexplained,
    Answer.CANNOT_TELL: _cannot_tell,
}
