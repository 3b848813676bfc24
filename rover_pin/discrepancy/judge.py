"""The rules by which the loop answers: what stands, what speaks against a lone name, and what that leaves of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from rover_pin.discrepancy.answer import TAKEN_TOGETHER, TAKES_MOST, Answer
from rover_pin.discrepancy.candidate import Candidate, is_effect
from rover_pin.discrepancy.cross_validation import without_each
from rover_pin.discrepancy.draft import Draft, Drafted, scored, tried
from rover_pin.discrepancy.held_out import ChannelScore, errors_anew, errors_of_others, held_out, lost_folds
from rover_pin.discrepancy.left import Left, described, held_out_share
from rover_pin.discrepancy.refit import Progress
from rover_pin.discrepancy.search import Search, again, calibrated, search
from rover_pin.discrepancy.sentence import sentence
from rover_pin.discrepancy.verdict import Side, Verdict
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit, fit
from rover_pin.estimation.numbers import AT_BOUND, implausible, intervals, settled
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.wording import Outcome

LEADERS = 4
"""Leading candidates of every round among which a fold chooses again, where a fit is exact."""
FEWEST = 3
"""Folds from which those that choose otherwise speak against a name: of two each has half of the data."""
LEVELS_EACH = 3
"""Folds for each number of several effects that hold together: on nine levels two laws with six imitated a third."""
WORSE_BY = 0.05
"""Share by which a channel that was not fitted must be predicted worse, beyond its scatter, to speak against a name."""


@dataclass(frozen=True, eq=False)
class Question:
    """What the loop is asked: which of the candidates the model lacks, its uncertain numbers free."""

    kind: str
    name: str
    experiment: Experiment
    model: Any
    numbers: tuple[Parameter, ...]
    candidates: Callable[[Fit], Sequence[Candidate]]
    "what may be missing of the calibrated model"
    draft: Callable[[Fit], Drafted | None] | None = None
    "what a fit leaves as a drafted effect, where that can be described"


def concluded(question: Question, progress: Progress, seed: int = 0) -> Verdict:
    """Return what a model lacks, as a graded answer.

    Raises
    ------
    OptimisationError
        The base model cannot be fitted at all.
    """
    progress("calibrating the base model")
    base = calibrated(question.experiment, question.model, question.numbers, seed)
    candidates = question.candidates(base)
    found = search(base, candidates, progress)
    progress("choosing again without each fold")
    anew = chosen_anew(found.base, _leading(found, candidates))
    drafts = cache(lambda here: drafted(question, here, progress))
    left, draft = described(found, question.draft is not None, drafts)
    progress("intervals, and errors on what was left out")
    verdict = judged((question.kind, question.name), found, {name: one.names for name, one in anew.items()}, left, seed)
    if verdict.answer is Answer.LIKE and left.unlisted and verdict.search is not None:
        draft = drafts(verdict.search.last)
    others = errors_of_others(found) if verdict.answer is Answer.SET else {}
    return with_draft(replace(verdict, errors_anew=errors_anew(found.base, anew), others=others), draft, seed)


def with_draft(verdict: Verdict, draft: Draft | None, seed: int) -> Verdict:
    """Return a verdict with the draft of what its model leaves, beside whose errors the draft's stand."""
    if draft is None or verdict.after is None or verdict.answer not in (Answer.NONE_FITS, Answer.LIKE):
        return verdict
    return replace(verdict, draft=scored(draft, verdict.after.fit, seed))


def drafted(question: Question, here: Fit, progress: Progress) -> Draft | None:
    """Return the draft of what a fit leaves as it was tried; None where nothing describes that."""
    made = question.draft(here) if question.draft is not None else None
    return None if made is None else tried(made, here, progress)


def _leading(found: Search, tried: Sequence[Candidate]) -> Sequence[Candidate]:
    """Return the candidates among which a fold chooses.

    Where a fit is exact those that lead on all data, as freed, and as large as they were fitted there.
    """
    if not found.base.task.experiment.is_exact:
        return tried
    refits = [one for each in found.rounds for one in each.refits[:LEADERS] if one.net > -one.fee / 2]
    leaders = {one.name: as_fitted(one, each.fit) for each in refits for one in (*each.instead, each.candidate)}
    return list(leaders.values())


def as_fitted(one: Candidate, fitted: Fit) -> Candidate:
    """Return a candidate that starts at what it was fitted to, its doubted shapes at what is assumed of them."""
    if one.effect is None:
        return one
    record = fitted.task.experiment.records(fitted.model)[one.owner]
    assumed = {name: getattr(one.effect, name) for name in (each.rpartition(".")[2] for each in one.doubted)}
    return replace(one, effect=record.replace(**assumed))


def chosen_anew(base: Fit, tried: Sequence[Candidate]) -> dict[str, Search]:
    """Return the whole search on all folds but one, by the name of the fold left out."""
    chosen = {}
    for at, name in enumerate(base.task.experiment.folds):
        good = base.task.noise.good.copy()
        good[at] = False
        task = replace(base.task, noise=replace(base.task.noise, good=good))
        without = again(fit(task, base.model, base.parameters, base.u, base.slopes))
        chosen[name] = search(without, tried, lambda said: None)
    return chosen


def chosen_without(found: Search) -> dict[str, str]:
    """Return what is chosen of the refitted candidates without each fold, to first order: nothing is predicted anew.

    Every round is decided again, by the gain on the other folds beyond the threshold, as long as it decides as on all.
    """
    folds = found.base.task.experiment.folds
    chosen: dict[str, list[str]] = {name: [] for name in folds}
    going, here = set(folds), found.base
    for each in found.rounds:
        was = without_each(here)
        nets = {one.name: was - without_each(one.fit) - one.fee for one in each.refits if one.net > -one.fee / 2}
        for at, name in enumerate(folds):
            best = max(nets, key=lambda one: nets[one][at], default="")
            if name in going and best and nets[best][at] > 0:
                chosen[name].append(best)
            if not each.alike or best != each.alike[0].name:
                going.discard(name)
        here = each.alike[0].fit if each.alike else here
    return {name: " + ".join(names) for name, names in chosen.items()}


def borne_by_folds(found: Search) -> Search:
    """Return the search up to the last effect that, with those before it, half of the folds would choose as well.

    Where folds are told to first order: a second law that mends what the form of the first leaves gains on a few only.
    """
    while len(found.found) > 1:
        chosen = chosen_without(found)
        if 2 * _agreeing(found, chosen) >= len(chosen):
            break
        found = replace(found, rounds=found.rounds[: len(found.found) - 1])
    return found


def side_of(fitted: Fit) -> Side:
    """Return a model with its numbers and their intervals, in the noise widened to what the model leaves."""
    wide, numbers = intervals(settled(fitted))
    return Side(wide.model, numbers, replace(wide, task=fitted.task).misfit, wide)


def judged(of: tuple[str, str], found: Search, chosen: dict[str, str], left: Left, seed: int) -> Verdict:
    """Return the verdict of kind and name `of` on what a search found and left."""
    (kind, name), (answer, found) = of, graded(found, left, chosen)
    last = found.base if answer in (Answer.INADEQUATE, Answer.NONE_FITS) else found.last
    before = side_of(found.base)
    after = before if last is found.base else side_of(last)
    added = found.added if last is not found.base else ()
    errors = held_out(before.fit, after.fit, found.base.task.noise, seed)
    share = held_out_share(found.base, last) if added else 0.0
    against = tuple(vetoes(found, chosen, errors.channels, left.patterned)) if added else ()
    if answer is Answer.NAMED and against:
        answer = Answer.LIKE
    records = after.fit.task.experiment.records(after.model)
    return Verdict(
        kind,
        answer,
        name,
        sentence(answer, found, share, (left.said, against)),
        after.model,
        tuple(records[one.owner] for one in added if is_effect(records[one.owner])),
        tuple(one.name for one in added),
        found.alike,
        share,
        before,
        after,
        errors.channels,
        errors.runs,
        chosen,
        against,
        lost_folds(errors.channels, found.base.task.experiment.no_value),
        search=found,
    )


def first_of(found: Search) -> Search:
    """Return the search as it stood after its first round, where that found something."""
    return replace(found, rounds=found.rounds[:1]) if found.rounds[0].alike else found


def vetoes(found: Search, chosen: dict[str, str], scores: Sequence[ChannelScore], patterned: bool) -> list[str]:
    """Return what keeps a lone name from standing, one sentence each."""
    last = found.last
    said = []
    for one, u in zip(last.parameters, last.u, strict=True):
        usual = not one.prior and abs(u - 1.0) <= AT_BOUND  # at its default a law is as published, not strained
        if min(u - one.bounds[0], one.bounds[1] - u) <= AT_BOUND and not usual:
            said.append(f"{one.name} lies at its bound")
    said += [f"{one} from what is declared of it" for one in implausible(last)]
    same = _agreeing(found, chosen)
    if len(chosen) >= FEWEST and 2 * same <= len(chosen):
        said.append(f"{found.names} is chosen in {same} of {len(chosen)} folds only")
    worse = [one for one in scores if one.worded.outcome is Outcome.WORSE and one.change > WORSE_BY]
    said += [f"{one.name} is predicted worse where it was not fitted" for one in worse]
    lost = [one for one in scores if math.isnan(one.after)]
    said += [f"{one.name} is not predicted where it was not fitted" for one in lost]
    return [*said, "a smooth curve describes what it leaves, beyond chance"] if patterned else said


def graded(found: Search, left: Left, chosen: dict[str, str]) -> tuple[Answer, Search]:
    """Return what may be said of what was found and left, and chosen without each fold, and the search it is said of.

    What is missing is like all that was found where that holds together, else like the first.
    """
    if left.outdone:
        return Answer.NONE_FITS, found
    if not found.found or not left.unlisted:
        return answer_of(found, left, False), found
    if hold_together(found, chosen):
        return answer_of(found, left, True), found
    first = first_of(found)
    alone = held_out_share(found.base, first.last) >= TAKES_MOST
    return answer_of(found, left, alone), first if alone else found


def hold_together(found: Search, chosen: dict[str, str]) -> bool:
    """Return whether effects of few numbers take nearly all that is missed where not fitted, and most folds agree."""
    own = sum(len(one.names) for one in found.added)
    told = 2 * _agreeing(found, chosen) > len(chosen) and LEVELS_EACH * own <= len(found.base.task.experiment.folds)
    return len(found.added) > 1 and told and held_out_share(found.base, found.last) >= TAKEN_TOGETHER


def _agreeing(found: Search, chosen: dict[str, str]) -> int:
    """Return how many folds choose what was found, in any order."""
    names = {one.name for one in found.added}
    return sum(set(name.split(" + ")) == names for name in chosen.values())


def answer_of(found: Search, left: Left, takes_most: bool) -> Answer:
    """Return what may be said: a name stands where its law holds, or is like what is missing where it takes most."""
    unlisted = Answer.NONE_FITS if left.described else Answer.INADEQUATE
    if not found.found:
        if left.unlisted:
            return unlisted
        return Answer.INADEQUATE if implausible(found.base) else Answer.NONE_NEEDED
    if left.unlisted:
        return Answer.LIKE if takes_most else unlisted
    return Answer.SET if len(found.alike) > 1 else Answer.NAMED
