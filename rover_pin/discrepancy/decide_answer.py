"""The rules by which the loop answers: what stands, what speaks against a lone name, and what that leaves of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from rover_pin.discrepancy.answer import TAKEN_TOGETHER, TAKES_MOST, Answer
from rover_pin.discrepancy.calibration import again, calibrated
from rover_pin.discrepancy.candidate import Candidate, is_effect
from rover_pin.discrepancy.cross_validation import fall_of, held_out_losses, without_each
from rover_pin.discrepancy.draft import Draft, Drafted, scored
from rover_pin.discrepancy.held_out import ChannelScore, errors_anew, errors_of_others, held_out, lost_folds
from rover_pin.discrepancy.refit import Progress
from rover_pin.discrepancy.search import Search, search
from rover_pin.discrepancy.sentence import sentence
from rover_pin.discrepancy.verdict import Side, Verdict
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit, fit
from rover_pin.estimation.noise import Noise
from rover_pin.estimation.numbers import AT_BOUND, implausible, intervals, is_adequate
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.wording import Outcome

FEWEST = 3
"""Folds from which those that choose otherwise speak against a name: of two each has half of the data."""
LEVELS_EACH = 3
"""Folds for each number of several effects that hold together: on nine levels two laws with six imitated a third."""
WORSE_BY = 0.05
"""Share by which a channel that was not fitted must be predicted worse, beyond its scatter, to speak against a name."""
ENOUGH = 0.9
"""Share of chi2 beyond the noise from which a law holds though more than the noise is left: real laws never hold to
the last digit."""
MIN_MISFIT_PROBABILITY = 0.01
"""What is left with less than this probability, beside too small a share, keeps a law from holding."""


class ResidualAssessment(NamedTuple):
    """What the last model of a search leaves."""

    unlisted: bool
    "whether it is more than the noise, and more than the form of a law that holds may leave"
    description: str = ""
    "how it acts, in words, where that can be described"
    described: bool = False
    "whether it can be described, and drafted as an effect that holds up when it is tried"


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
    draft: Callable[[Fit], Drafted | None] = lambda fitted: None
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
    search_result = search(base, candidates, progress)
    progress("choosing again without each fold")
    anew = chosen_anew(search_result.base, candidates)
    progress("intervals, and errors on what was left out")
    verdict = make_verdict(
        (question.kind, question.name),
        search_result,
        {name: fold_search.names for name, fold_search in anew.items()},
        assess_residual(search_result),
        seed,
    )
    others = errors_of_others(search_result) if verdict.answer is Answer.SET else {}
    return replace(verdict, errors_anew=errors_anew(search_result.base, anew), others=others)


def with_draft(verdict: Verdict, draft: Draft | None, seed: int) -> Verdict:
    """Return a verdict with the draft of what its model leaves, beside whose errors the draft's stand."""
    if draft is None or verdict.after is None or verdict.answer not in (Answer.NONE_FITS, Answer.LIKE):
        return verdict
    return replace(verdict, draft=scored(draft, verdict.after.fit, seed))


def chosen_anew(base: Fit, tried: Sequence[Candidate]) -> dict[str, Search]:
    """Return the whole search on all folds but one, by the name of the fold left out."""
    chosen = {}
    for at, name in enumerate(base.task.experiment.folds):
        good = base.task.noise.good.copy()
        good[at] = False
        task = replace(base.task, noise=replace(base.task.noise, good=good))
        without = again(fit(task, base.model, base.parameters, base.u, base.slopes))
        chosen[name] = search(without, tried, lambda message: None)
    return chosen


def chosen_without(search_result: Search) -> dict[str, str]:
    """Return what is chosen of the refitted candidates without each fold, to first order: nothing is predicted anew.

    Every round is decided again, by the gain on the other folds beyond the threshold, as long as it decides as on all.
    """
    folds = search_result.base.task.experiment.folds
    chosen: dict[str, list[str]] = {name: [] for name in folds}
    going, current_fit = set(folds), search_result.base
    for search_round in search_result.rounds:
        was = without_each(current_fit)
        nets = {
            refit.name: was - without_each(refit.fit) - refit.threshold
            for refit in search_round.refits
            if refit.net > -refit.threshold / 2
        }
        for at, name in enumerate(folds):
            best = max(nets, key=lambda candidate_name: nets[candidate_name][at], default="")
            if name in going and best and nets[best][at] > 0:
                chosen[name].append(best)
            if not search_round.indistinguishable or best != search_round.indistinguishable[0].name:
                going.discard(name)
        current_fit = search_round.indistinguishable[0].fit if search_round.indistinguishable else current_fit
    return {name: " + ".join(names) for name, names in chosen.items()}


def keep_supported_effects(search_result: Search) -> Search:
    """Return the search up to the last effect that, with those before it, half of the folds would choose as well.

    Where folds are predicted to first order: a second law that mends what the first's form leaves gains on a few only.
    """
    while len(search_result.best_refits) > 1:
        chosen = chosen_without(search_result)
        if 2 * _agreeing(search_result, chosen) >= len(chosen):
            break
        search_result = replace(search_result, rounds=search_result.rounds[: len(search_result.best_refits) - 1])
    return search_result


def side_of(fitted: Fit) -> Side:
    """Return a model with its numbers and their intervals."""
    best, numbers = intervals(fitted)
    return Side(best.model, numbers, best.misfit, best)


def make_verdict(
    of: tuple[str, str], search_result: Search, chosen: dict[str, str], assessment: ResidualAssessment, seed: int
) -> Verdict:
    """Return the verdict of kind and name `of` on what a search found and left."""
    (kind, name), (answer, search_result) = of, graded(search_result, assessment, chosen)
    last = search_result.base if answer in (Answer.INADEQUATE, Answer.NONE_FITS) else search_result.last
    before = side_of(search_result.base)
    after = before if last is search_result.base else side_of(last)
    added = search_result.added if last is not search_result.base else ()
    errors = held_out(before.fit, after.fit, search_result.base.task.noise, seed)
    share = held_out_share(search_result.base, last) if added else 0.0
    against = tuple(vetoes(search_result, chosen, errors.channels)) if added else ()
    if answer is Answer.NAMED and against:
        answer = Answer.LIKE
    records = after.fit.task.experiment.records(after.model)
    return Verdict(
        kind,
        answer,
        name,
        sentence(answer, search_result, share, (assessment.description, against)),
        after.model,
        tuple(records[candidate.owner] for candidate in added if is_effect(records[candidate.owner])),
        tuple(candidate.name for candidate in added),
        search_result.indistinguishable,
        share,
        before,
        after,
        errors.channels,
        errors.runs,
        chosen,
        against,
        lost_folds(errors.channels, search_result.base.task.experiment.no_value),
        search=search_result,
    )


def first_of(search_result: Search) -> Search:
    """Return the search as it stood after its first round, where that found something."""
    return (
        replace(search_result, rounds=search_result.rounds[:1])
        if search_result.rounds[0].indistinguishable
        else search_result
    )


def vetoes(search_result: Search, chosen: dict[str, str], scores: Sequence[ChannelScore]) -> list[str]:
    """Return what keeps a lone name from standing, one sentence each."""
    last = search_result.last
    sentences = []
    for parameter, u in zip(last.parameters, last.u, strict=True):
        nominal = not parameter.prior and abs(u - 1.0) <= AT_BOUND  # at its default a law is as published, not strained
        if min(u - parameter.bounds[0], parameter.bounds[1] - u) <= AT_BOUND and not nominal:
            sentences.append(f"{parameter.name} lies at its bound")
    sentences += [f"{deviation} from what is declared of it" for deviation in implausible(last)]
    agreeing_folds = _agreeing(search_result, chosen)
    if len(chosen) >= FEWEST and 2 * agreeing_folds <= len(chosen):
        sentences.append(f"{search_result.names} is chosen in {agreeing_folds} of {len(chosen)} folds only")
    worse = [score for score in scores if score.worded.outcome is Outcome.WORSE and score.change > WORSE_BY]
    sentences += [f"{score.name} is predicted worse where it was not fitted" for score in worse]
    lost = [score for score in scores if math.isnan(score.after)]
    sentences += [f"{score.name} is not predicted where it was not fitted" for score in lost]
    return sentences


def graded(search_result: Search, assessment: ResidualAssessment, chosen: dict[str, str]) -> tuple[Answer, Search]:
    """Return what may be said of what was found and left, and chosen without each fold, and the search it is said of.

    What is missing is like all that was found where that holds together, else like the first.
    """
    if not search_result.best_refits or not assessment.unlisted:
        return answer_of(search_result, assessment, False), search_result
    if hold_together(search_result, chosen):
        return answer_of(search_result, assessment, True), search_result
    first = first_of(search_result)
    alone = held_out_share(search_result.base, first.last) >= TAKES_MOST
    return answer_of(search_result, assessment, alone), first if alone else search_result


def hold_together(search_result: Search, chosen: dict[str, str]) -> bool:
    """Return whether effects of few numbers take nearly all that is missed where not fitted, and most folds agree."""
    number_count = sum(len(candidate.names) for candidate in search_result.added)
    is_supported = 2 * _agreeing(search_result, chosen) > len(chosen) and LEVELS_EACH * number_count <= len(
        search_result.base.task.experiment.folds
    )
    return (
        len(search_result.added) > 1
        and is_supported
        and held_out_share(search_result.base, search_result.last) >= TAKEN_TOGETHER
    )


def _agreeing(search_result: Search, chosen: dict[str, str]) -> int:
    """Return how many folds choose what was found, in any order."""
    names = {candidate.name for candidate in search_result.added}
    return sum(set(name.split(" + ")) == names for name in chosen.values())


def answer_of(search_result: Search, assessment: ResidualAssessment, takes_most: bool) -> Answer:
    """Return what may be said: a name stands where its law holds, or is like what is missing where it takes most."""
    unlisted = Answer.NONE_FITS if assessment.described else Answer.INADEQUATE
    if not search_result.best_refits:
        if assessment.unlisted:
            return unlisted
        return Answer.INADEQUATE if implausible(search_result.base) else Answer.NONE_NEEDED
    if assessment.unlisted:
        return Answer.LIKE if takes_most else unlisted
    return Answer.SET if len(search_result.indistinguishable) > 1 else Answer.NAMED


def assess_residual(search_result: Search) -> ResidualAssessment:
    """Return what is left by the stated noise."""
    return ResidualAssessment(
        not (holds(search_result) if search_result.best_refits else is_adequate(search_result.base))
    )


def holds(search_result: Search) -> bool:
    """Return whether a law holds by the declared noise: it leaves that, or takes nearly all that was missed."""
    return is_adequate(search_result.last, MIN_MISFIT_PROBABILITY) or share_taken(search_result) >= ENOUGH


def share_taken(search_result: Search) -> float:
    """Return the share of the base's chi2 beyond the noise that what was found takes."""
    excess = search_result.base.chi2 - search_result.base.freedom
    taken = search_result.base.chi2 - search_result.last.chi2
    return float(np.clip(taken / excess, 0.0, 1.0)) if excess > 0 else float(taken > 0)


def held_out_share(base: Fit, last: Fit) -> float:
    """Return the share of the held-out losses beyond the noise that what was added takes; 0 where it loses a fold."""
    fall, excess = _fall_and_room(base.task.noise, base, last)
    return float(np.clip(np.nan_to_num(fall / excess), 0.0, 1.0)) if excess > 0 else float(fall > 0)


def _fall_and_room(noise: Noise, before: Fit, after: Fit) -> tuple[float, float]:
    """Return `fall_of` the held-out losses, and those before beyond the noise, on the folds that both predict."""
    was, now = (held_out_losses(fitted) for fitted in (before, after))
    both = np.isfinite(was + now)
    return fall_of(was, now), float(was[both].sum() - noise.good[both].sum())
