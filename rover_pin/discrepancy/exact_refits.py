"""Candidates refitted where a fit is exact and cheap: from several starts, shapes freed, every fold by whole refits."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.cross_validation import fall_of, losses_of
from rover_pin.discrepancy.refit import Fee, Progress, Refit, best_of_each, joined
from rover_pin.discrepancy.screen import SMALL, STILL, Scored, entry_fee
from rover_pin.estimation.fit import Fit, best_of
from rover_pin.estimation.parameter import Parameter

LEAST = 5
"""Candidates that are refitted in the first round, at least."""
SHARE_REFITTED = 0.25
"""Share of its threshold that a candidate must promise to be refitted at all, where fits are exact and cheap."""
MOST_FREE = 0.5
"""Free numbers without a prior for each compared block, at most."""
SHIFT = 1.0
"""Prior SDs by which a shape is moved to see whether the data show it."""
PAIRED = 6
"""Leading candidates from which pairs are made."""

Tried = tuple[tuple[Candidate, ...], Candidate, Fit]
"""What stands in place of the best before, if anything, the candidate, and the fit with both."""


def exactly_refitted(
    base: Fit, scored: Sequence[Scored], fee: Fee, progress: Progress, pairs: Sequence[Tried] | None = None
) -> list[Tried]:
    """Return the plausible candidates refitted, all that promise something, after pairs that are given.

    `pairs` are those of the round before; in the first round there are none, and a few candidates are refitted at least
    to be shown.
    """
    told, least = [row for row in scored if row.told], LEAST if pairs is None else 0
    chosen = [
        row.candidate for at, row in enumerate(told) if at < least or row.gain > SHARE_REFITTED * fee(row.candidate)
    ]
    tried = list(pairs or ())
    for candidate in chosen:
        progress(f"refitting with {candidate.name}")
        tried += [((), one, fitted) for one, fitted in variants(base, candidate)]
    return tried


def paired(base: Fit, singles: Sequence[Refit], best: Refit | None, progress: Progress) -> list[Tried]:
    """Return pairs of the leading single candidates: two effects together may look most like a third.

    `best` is the single that was added; a pair with it is that one's second step.
    """
    tried: list[Tried] = []
    for one, other in itertools.combinations(singles[:PAIRED], 2):
        first, second = (other, one) if other is best else (one, other)
        progress(f"refitting with {first.name} + {second.name}")
        for fitted in _pair(base, first, second):
            tried.append((() if first is best else (first.candidate,), second.candidate, fitted))
    return tried


def _pair(base: Fit, one: Refit, other: Refit) -> list[Fit]:
    """Return the refit with what was free in either single; with sizes only where that is more than the data bear."""
    for first, second in ((one.candidate, other.candidate), (one.candidate.bare, other.candidate.bare)):
        model = first.on(base.model)
        numbers, here = joined(base, first, model)
        model = second.on(model)
        numbers = (*numbers, *second.parameters)
        here = np.concatenate([here, [each.u(_value(base, model, each)) for each in second.parameters]])
        if bearable(base, numbers):
            starts = [here, *(_of(numbers, each.fit) for each in (one, other))]
            fitted = best_of(base.task, model, numbers, starts if is_whole(base) else starts[:2])
            return [] if fitted is None else [fitted]
    return []


def _value(base: Fit, model: Any, one: Parameter) -> float:
    return base.task.experiment.value(model, one.name)


def variants(base: Fit, candidate: Candidate) -> list[tuple[Candidate, Fit]]:
    """Return a candidate refitted, and with its law's shapes freed where the data can bear that and show them."""
    if not candidate.shapes:
        return _refitted(base, candidate, [])
    plain = as_published(base, candidate)
    loose = told_shapes(plain[0][1], candidate).loose if plain else candidate.loose
    return plain + (_refitted(base, loose, plain) if loose.freed else [])


def as_published(base: Fit, candidate: Candidate) -> list[tuple[Candidate, Fit]]:
    """Return a candidate refitted with its law's shapes held; nothing where the data cannot bear it."""
    return _refitted(base, candidate.bare, [])


def _refitted(base: Fit, one: Candidate, before: Sequence[tuple[Candidate, Fit]]) -> list[tuple[Candidate, Fit]]:
    """Return a candidate with its refit, started also from fits before it; nothing where there is none."""
    model = one.on(base.model)
    numbers, here = joined(base, one, model)
    if not bearable(base, numbers):
        return []
    starts = _starts(numbers, here, len(base.u)) if is_whole(base) else [here]
    fitted = best_of(base.task, model, numbers, [*starts, *(_of(numbers, each) for _, each in before)])
    return [] if fitted is None else [(one, fitted)]


def told_shapes(fitted: Fit, candidate: Candidate) -> Candidate:
    """Return a candidate fitted as published with the shapes that move the data: a fade to rest moves no steady run.

    Freed, such a number would leave the range in which the law means anything, and imitate something else.
    """
    experiment, model, kept = fitted.task.experiment, fitted.model, []
    for name in candidate.shapes:
        one = candidate.shape(name)
        here = one.u(experiment.value(model, name))
        shifted = one.value(here + (SHIFT if one.bounds[1] >= here + SHIFT else -SHIFT))
        (moved,) = experiment.predict([experiment.with_values(model, {name: shifted})])
        if not np.linalg.norm(fitted.task.noise.white(moved - fitted.predicted)) <= STILL:  # nor where it loses a run
            kept.append(name)
    return dataclasses.replace(candidate, shapes=tuple(kept))


def bearable(base: Fit, numbers: Sequence[Parameter]) -> bool:
    """Return whether there are enough data for so many free numbers."""
    return sum(not one.prior for one in numbers) <= MOST_FREE * base.task.noise.count


def _starts(numbers: Sequence[Parameter], here: np.ndarray, own: int) -> list[np.ndarray]:
    """Return the base's values with the candidate's sizes small, at their default, and, if they may, below neutral."""
    sizes = np.array([at >= own and not one.log for at, one in enumerate(numbers)])
    either = any(one.bounds[0] < 0 for one, own_size in zip(numbers, sizes, strict=True) if own_size and not one.prior)
    return [np.where(sizes, share * here, here) for share in (SMALL, 1.0, *((-SMALL,) if either else ()))]


def is_whole(base: Fit) -> bool:
    """Return whether no fold is left out; else candidates start from what they are on all data."""
    return bool(base.task.noise.good.any(axis=(1, 2)).all())


def _of(numbers: Sequence[Parameter], fitted: Fit) -> np.ndarray:
    """Return where a fit ended; sizes that it does not have are small, shapes as published."""
    known = dict(zip([one.name for one in fitted.parameters], fitted.u, strict=True))
    return np.array([known.get(one.name, 0.0 if one.prior or one.log else SMALL) for one in numbers])


def judged(base: Fit, tried: Sequence[Tried], fee: Fee, paid: float = 0.0) -> tuple[Refit, ...]:
    """Return exact refits against a base, the best first; those that gain enough also on every fold left out.

    `paid` is what they pay beside their own thresholds, in units of the noise. Where a fold is already left out, only
    the best is asked for: the rest is tried on folds only until one holds.
    """
    if not tried:
        return ()
    unit = max(base.task.noise.inflation, min(fitted.misfit for _, _, fitted in tried))
    rows = [
        Refit(one, fitted, base.chi2 - fitted.chi2, _owed((instead, one, fitted), fee, unit, paid), 0.0, unit, instead)
        for instead, one, fitted in tried
    ]
    ranked = best_of_each(rows)
    paying = [one for one in ranked if one.net > 0]
    without = losses_of(base) if paying else np.zeros(0)
    kept: list[Refit] = []
    for one in paying:
        if is_whole(base) or not any(each.accepted for each in kept):
            kept.append(dataclasses.replace(one, held_out=fall_of(without, losses_of(one.fit))))
    return (*kept, *ranked[len(kept) :])


def _owed(tried: Tried, fee: Fee, unit: float, paid: float) -> float:
    """Return what chance alone gains with it, the freed shapes of what stands in place of the best before included."""
    instead, one, _ = tried
    return fee(one, inflation=unit) + unit * (paid + entry_fee(1) * sum(len(other.freed) for other in instead))
