"""Why to believe a verdict, why to doubt it, and what to drive or measure next: one sentence each."""

from __future__ import annotations

from collections.abc import Iterator

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import Outcome, share
from rover_pin.report.headline import by_outcome, worst
from rover_pin.report.words import Manner, capital, human, kinds_of, listing, two_digits

MOST = 4
"""Reasons on the first screen; all of them stand further below."""
LOUD = 1.5
"""Times its noise from which a channel that is left over is a reason to doubt."""
MORE = 1.25
"""Times what it was from which a left-out fold's chi2 is a reason to doubt."""


WRITE_IT = (
    "look at what is left, write it as an effect of your own (rover-pin new-effect), and close the loop again with "
    "--effects"
)
NEXT = {
    Answer.NAMED: "no rival is left to tell it from: drive where it matters most, and see whether it predicts that",
    Answer.NONE_NEEDED: "drive where more is asked of the model: steeper, faster, with more slip",
    Answer.CANNOT_TELL: "measure what the sentence above asks for",
    Answer.NONE_FITS: WRITE_IT,
    Answer.INADEQUATE: WRITE_IT,
    Answer.LIKE: "measure where its law and the data part most: see where the error lives",
    Answer.SET: "no run of the menu tells these apart",
}
"""What to do next where no run was found that would tell more."""


def believe(verdict: Verdict, manner: Manner) -> list[str]:
    """Return what speaks for a verdict."""
    lines = (*_added(verdict, manner), *_nothing_added(verdict, manner))
    return _said(verdict, (*lines[:1], *manner.evidence, *lines[1:]))


def doubt(verdict: Verdict, manner: Manner) -> list[str]:
    """Return what speaks against it, the weightiest first."""
    return _said(verdict, _doubts(verdict, manner))


def next_run(verdict: Verdict) -> list[str]:
    """Return what to drive or measure next."""
    if verdict.experiments:
        return _said(verdict, (one.said for one in verdict.experiments))
    return [capital(NEXT[verdict.answer]) + "."]


def _said(verdict: Verdict, lines: Iterator[str] | tuple[str, ...]) -> list[str]:
    kinds = kinds_of(verdict)
    return [capital(human(line, kinds)).rstrip(".") + "." for line in dict.fromkeys(lines)]


def _added(verdict: Verdict, manner: Manner) -> Iterator[str]:
    if not verdict.named or verdict.before is None or verdict.after is None or verdict.search is None:
        return
    better, worse = (by_outcome(verdict.scores, one) for one in (Outcome.BETTER, Outcome.WORSE))
    if better:
        one = better[0]
        change = f"{manner.channel(one.name)} by {share(one.change)} [{share(one.low)}, {share(one.high)}]"
        yield (
            f"{manner.unseen} {len(better)} of {len(verdict.scores)} channels are predicted better beyond their "
            f"scatter, {len(worse)} worse: {change}"
        )
    if verdict.share > 0:
        yield f"it takes {verdict.share:.0%} of what the base model misses beyond the noise {manner.unseen}"
    yield from _chosen(verdict, manner, True)
    for each in verdict.search.rounds:
        if each.alike:
            yield (
                f"{each.alike[0].name} gains {each.alike[0].gain:.0f} in chi2; the luckiest of {verdict.search.count} "
                f"candidates gains {two_digits(each.alike[0].fee)} by chance"
            )
    before, after = two_digits(verdict.before.misfit), two_digits(verdict.after.misfit)
    yield f"chi2 for each number measured falls from {before} to {after}; 1 is the noise"


def _nothing_added(verdict: Verdict, manner: Manner) -> Iterator[str]:
    if verdict.named or verdict.before is None or verdict.search is None:
        return
    yield f"chi2 for each number measured is {two_digits(verdict.before.misfit)}, where 1 is the noise"
    yield f"{verdict.search.count} candidates were tried, each with all uncertain numbers free"
    if verdict.answer is not Answer.NONE_NEEDED and verdict.search.alike:
        yield f"the nearest, {verdict.search.alike[0]}, does not take what is left"


def _chosen(verdict: Verdict, manner: Manner, same: bool) -> Iterator[str]:
    """Yield that most folds choose the same again, or, if not `same`, that they do not."""
    names = set(verdict.named)
    folds = [set(name.split(" + ")) for name in verdict.chosen.values()]
    agree = sum(fold == names for fold in folds)
    if folds and (2 * agree > len(folds)) is same:
        yield f"it is chosen anew in {agree} of {len(folds)} cases when one of the {manner.folds} is left out"


def _doubts(verdict: Verdict, manner: Manner) -> Iterator[str]:
    yield from verdict.vetoes
    for one in by_outcome(verdict.scores, Outcome.WORSE):
        yield f"{manner.channel(one.name)} is predicted worse by {share(one.change)} {manner.unseen}"
    if verdict.named and not any("folds" in veto for veto in verdict.vetoes):
        yield from _chosen(verdict, manner, False)
    if len(verdict.alike) > 1:
        yield f"{listing(verdict.alike[1:4], 'or')} cannot be told from it by these data"
    left = max(verdict.runs, key=lambda one: one.after / max(one.before, 1e-9), default=None)
    if verdict.named and left is not None and left.after > MORE * left.before:
        yield (
            f"{manner.fold(left.run)} is predicted worse with it by the others (chi2 for each number "
            f"{two_digits(left.before)} -> {two_digits(left.after)}): what it tells they do not"
        )
    loud = [one for one in worst(verdict.scores) if one.after > LOUD * one.floor]
    if loud and (verdict.named or verdict.answer is Answer.NONE_NEEDED):
        one, still = loud[0], "still " if verdict.named else ""
        times = two_digits(one.times(one.after))
        yield f"{manner.channel(one.name)} is {still}missed by {times} times its noise"
    yield from (one for one in verdict.cautions if one.partition(":")[0] not in verdict.vetoes)
    for finding in verdict.findings:
        yield f"the data check says: {finding}"
    tried = verdict.search.count if verdict.search else 0
    if verdict.named:
        yield f"only the {tried} candidates of the list were tried: something outside of it may do the same"
    elif verdict.answer is Answer.NONE_NEEDED:
        yield "an effect too small to show in these data may act; 'what could not be told' has the sizes that would"
