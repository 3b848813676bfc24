"""Candidates refitted where a fit is exact and cheap: from several starts, shapes freed, every fold by whole refits."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.cross_validation import fall_of, losses_of
from rover_pin.discrepancy.refit import Progress, Refit, Threshold, best_of_each, joined
from rover_pin.discrepancy.screen import SMALL, STILL, Scored, null_threshold
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
"""What replaces the best before, if anything, the candidate, and the fit with both."""


def exactly_refitted(
    base: Fit, scored: Sequence[Scored], threshold: Threshold, progress: Progress, pairs: Sequence[Tried] | None = None
) -> list[Tried]:
    """Return the plausible candidates refitted, all that promise something, after pairs that are given.

    `pairs` are those of the round before; in the first round there are none, and a few candidates are refitted at least
    to be shown.
    """
    identifiable, least = [row for row in scored if row.is_identifiable], LEAST if pairs is None else 0
    chosen = [
        row.candidate
        for at, row in enumerate(identifiable)
        if at < least or row.gain > SHARE_REFITTED * threshold(row.candidate)
    ]
    tried = list(pairs or ())
    for candidate in chosen:
        progress(f"refitting with {candidate.name}")
        tried += [((), variant, fitted) for variant, fitted in variants(base, candidate)]
    return tried


def paired(base: Fit, singles: Sequence[Refit], best: Refit | None, progress: Progress) -> list[Tried]:
    """Return pairs of the leading single candidates: two effects together may look most like a third.

    `best` is the single that was added; a pair with it is that one's second step.
    """
    tried: list[Tried] = []
    for first_single, second_single in itertools.combinations(singles[:PAIRED], 2):
        first, second = (second_single, first_single) if second_single is best else (first_single, second_single)
        progress(f"refitting with {first.name} + {second.name}")
        for fitted in _pair(base, first, second):
            tried.append((() if first is best else (first.candidate,), second.candidate, fitted))
    return tried


def _pair(base: Fit, first_single: Refit, second_single: Refit) -> list[Fit]:
    """Return the refit with what was free in either single; with sizes only where that is more than the data bear."""
    for first, second in (
        (first_single.candidate, second_single.candidate),
        (first_single.candidate.bare, second_single.candidate.bare),
    ):
        model = first.on(base.model)
        numbers, u_start = joined(base, first, model)
        model = second.on(model)
        numbers = (*numbers, *second.parameters)
        u_start = np.concatenate(
            [u_start, [parameter.u(_value(base, model, parameter)) for parameter in second.parameters]]
        )
        if bearable(base, numbers):
            starts = [u_start, *(_of(numbers, single.fit) for single in (first_single, second_single))]
            fitted = best_of(base.task, model, numbers, starts if is_whole(base) else starts[:2])
            return [] if fitted is None else [fitted]
    return []


def _value(base: Fit, model: Any, parameter: Parameter) -> float:
    return base.task.experiment.value(model, parameter.name)


def variants(base: Fit, candidate: Candidate) -> list[tuple[Candidate, Fit]]:
    """Return a candidate refitted, and with its law's shapes freed where the data can bear that and show them."""
    if not candidate.shapes:
        return _refitted(base, candidate, [])
    plain = as_published(base, candidate)
    loose = with_visible_shapes(plain[0][1], candidate).loose if plain else candidate.loose
    return plain + (_refitted(base, loose, plain) if loose.free_shapes else [])


def as_published(base: Fit, candidate: Candidate) -> list[tuple[Candidate, Fit]]:
    """Return a candidate refitted with its law's shapes held; nothing where the data cannot bear it."""
    return _refitted(base, candidate.bare, [])


def _refitted(base: Fit, candidate: Candidate, before: Sequence[tuple[Candidate, Fit]]) -> list[tuple[Candidate, Fit]]:
    """Return a candidate with its refit, started also from fits before it; nothing where there is none."""
    model = candidate.on(base.model)
    numbers, u_start = joined(base, candidate, model)
    if not bearable(base, numbers):
        return []
    starts = _starts(numbers, u_start, len(base.u)) if is_whole(base) else [u_start]
    fitted = best_of(base.task, model, numbers, [*starts, *(_of(numbers, earlier_fit) for _, earlier_fit in before)])
    return [] if fitted is None else [(candidate, fitted)]


def with_visible_shapes(fitted: Fit, candidate: Candidate) -> Candidate:
    """Return a candidate fitted as published with the shapes that move the data: a fade to rest moves no steady run.

    Freed, such a number would leave the range in which the law means anything, and imitate something else.
    """
    experiment, model, visible_shapes = fitted.task.experiment, fitted.model, []
    for name in candidate.shapes:
        parameter = candidate.shape(name)
        u = parameter.u(experiment.value(model, name))
        shifted = parameter.value(u + (SHIFT if parameter.bounds[1] >= u + SHIFT else -SHIFT))
        (outputs,) = experiment.predict([experiment.with_values(model, {name: shifted})])
        if not np.linalg.norm(fitted.task.noise.white(outputs - fitted.predicted)) <= STILL:  # nor where it loses a run
            visible_shapes.append(name)
    return dataclasses.replace(candidate, shapes=tuple(visible_shapes))


def bearable(base: Fit, numbers: Sequence[Parameter]) -> bool:
    """Return whether there are enough data for these free numbers."""
    return sum(not parameter.prior for parameter in numbers) <= MOST_FREE * base.task.noise.count


def _starts(numbers: Sequence[Parameter], u_start: np.ndarray, base_count: int) -> list[np.ndarray]:
    """Return the base's values with the candidate's sizes small, at their default, and, if they may, below neutral."""
    is_amplitude = np.array([at >= base_count and not parameter.log for at, parameter in enumerate(numbers)])
    either = any(
        parameter.bounds[0] < 0
        for parameter, own_size in zip(numbers, is_amplitude, strict=True)
        if own_size and not parameter.prior
    )
    return [np.where(is_amplitude, share * u_start, u_start) for share in (SMALL, 1.0, *((-SMALL,) if either else ()))]


def is_whole(base: Fit) -> bool:
    """Return whether no fold is left out; else candidates start from what they are on all data."""
    return bool(base.task.noise.good.any(axis=(1, 2)).all())


def _of(numbers: Sequence[Parameter], fitted: Fit) -> np.ndarray:
    """Return where a fit ended; sizes that it does not have are small, shapes as published."""
    u_by_name = dict(zip([parameter.name for parameter in fitted.parameters], fitted.u, strict=True))
    return np.array(
        [u_by_name.get(parameter.name, 0.0 if parameter.prior or parameter.log else SMALL) for parameter in numbers]
    )


def rank_refits(base: Fit, tried: Sequence[Tried], threshold: Threshold, paid: float = 0.0) -> tuple[Refit, ...]:
    """Return exact refits against a base, the best first; those that gain enough also on every fold left out.

    `paid` is what they pay beside their own thresholds, in units of the noise. Where a fold is already left out, only
    the best is asked for: the rest is tried on folds only until one holds.
    """
    if not tried:
        return ()
    unit = max(base.task.noise.inflation, min(fitted.misfit for _, _, fitted in tried))
    rows = [
        Refit(
            candidate,
            fitted,
            base.chi2 - fitted.chi2,
            _owed((instead, candidate, fitted), threshold, unit, paid),
            0.0,
            unit,
            instead,
        )
        for instead, candidate, fitted in tried
    ]
    ranked = best_of_each(rows)
    paying = [refit for refit in ranked if refit.net > 0]
    without = losses_of(base) if paying else np.zeros(0)
    validated: list[Refit] = []
    for refit in paying:
        if is_whole(base) or not any(validated_refit.accepted for validated_refit in validated):
            validated.append(dataclasses.replace(refit, held_out=fall_of(without, losses_of(refit.fit))))
    return (*validated, *ranked[len(validated) :])


def _owed(tried: Tried, threshold: Threshold, unit: float, paid: float) -> float:
    """Return what chance alone gains with it, the free shapes of what replaces the best before included."""
    instead, candidate, _ = tried
    return threshold(candidate, inflation=unit) + unit * (
        paid + null_threshold(1) * sum(len(predecessor.free_shapes) for predecessor in instead)
    )
