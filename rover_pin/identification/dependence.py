"""What a fit's numbers hang on: each number that was held is moved to the ends of its range, and the fit done again."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, OptimisationError
from rover_pin.base.jobs.time_left import telling
from rover_pin.base.quantity import quantities
from rover_pin.contact import Wheel
from rover_pin.estimation.descent import descend
from rover_pin.estimation.problem import Prior, Problem
from rover_pin.identification.identifiability import REMEDY
from rover_pin.identification.identify import build
from rover_pin.identification.one_sand import sets_of
from rover_pin.identification.result import (
    Assumed,
    Change,
    Estimate,
    Held,
    Identification,
    Verdict,
    describe_dependence,
    with_unit,
)
from rover_pin.measurements.channel import Evidence

SAME = 1e-9
"""Change of a prediction, in SDs, below which a number does not enter it."""


def with_held(
    identification: Identification,
    data: Evidence | Sequence[Evidence],
    fixed: Sequence[Held],
    priors: Mapping[str, Prior] | None = None,
) -> Identification:
    """Return a fit with what its numbers do when one that was held moves within its range.

    Each held number is set to both ends of its range and the free ones are fitted again from where they were. A number
    that was found and then leaves its 95 % interval, by one held number or by several together (their distances, each
    over that to the interval's end, summed as squares), depends on what was assumed of these.

    Parameters
    ----------
    identification : Identification
        Of these `data` with these `priors`.
    fixed : sequence of Held
        As `held_numbers` gives them.
    """
    names = tuple(estimate.name for estimate in identification.estimates)
    fit = build(data, identification.soil, names, priors or {}).widened(identification.misfit)
    u = descend(fit, fit.space.start())[0]
    refits = [
        [_refit(sets_of(data), fit, change, u) for change in fixed_number.ends]
        for fixed_number in telling(fixed, len(fixed), "held numbers moved")
    ]
    rows = tuple(_assumed(fit, fixed_number, ends) for fixed_number, ends in zip(fixed, refits, strict=True))
    estimates = tuple(
        _evaluate_dependence(fit, estimate, u[at], rows) for at, estimate in enumerate(identification.estimates)
    )
    return dataclasses.replace(identification, estimates=estimates, fixed=rows)


def _refit(sets: Sequence[Evidence], fit: Problem, change: Change, u: np.ndarray) -> np.ndarray | None:
    """Return u fitted again, NaN where nothing fits, None where no prediction changes."""
    if not callable(change) and not change:
        return None
    try:
        changed = _again(fit, sets_of(change())) if callable(change) else _changed(sets, fit, change)
        changed_residuals, residuals = changed.evaluate(u)[0], fit.evaluate(u)[0]
        if changed_residuals.shape == residuals.shape and np.allclose(
            changed_residuals, residuals, rtol=0.0, atol=SAME
        ):
            return None
        return descend(changed, u)[0]
    except (ValueError, np.linalg.LinAlgError, OptimisationError, DataError):
        return np.full(len(u), np.nan)


def _again(fit: Problem, sets: Sequence[Evidence], base: np.ndarray | None = None) -> Problem:
    space = fit.space if base is None else dataclasses.replace(fit.space, base=base)
    return Problem(sets, space, fit.priors, fit.widen)


def _changed(sets: Sequence[Evidence], fit: Problem, change: Mapping[str, float]) -> Problem:
    """Return the problem with other numbers of the soil, and of the wheel of all sets."""
    dimensions: dict[str, Any] = {name: value for name, value in change.items() if name in quantities(Wheel)}
    if dimensions:
        sets = [dataclasses.replace(data, wheel=data.wheel.replace(**dimensions)) for data in sets]  # type: ignore[type-var]
    base = fit.space.base.copy()
    for name, value in change.items():
        base[fit.space.all_names.index(name)] = value
    return _again(fit, sets, base)


def _assumed(fit: Problem, fixed: Held, ends: Sequence[np.ndarray | None]) -> Assumed:
    if all(u is None for u in ends):
        return Assumed(fixed, {})
    start = fit.space.start()
    low, high = (fit.space.values(start if u is None else u) for u in ends)
    return Assumed(fixed, {name: (float(low[at]), float(high[at])) for at, name in enumerate(fit.space.names)})


def _evaluate_dependence(fit: Problem, estimate: Estimate, u: float, rows: Sequence[Assumed]) -> Estimate:
    """Return an estimate that was found with the verdict that what it depends on leaves it."""
    if estimate.verdict is not Verdict.FOUND:
        return estimate
    distances = {
        row.fixed.name: _distance(fit, estimate, u, row.refitted[estimate.name]) for row in rows if row.refitted
    }
    blamed = _blamed(distances)
    if not blamed:
        return estimate
    measured = tuple(row.fixed.name for row in rows if row.fixed.measured and row.fixed.name in blamed)
    dependent = estimate._replace(verdict=Verdict.DEPENDS, depends_on=tuple(blamed), measured=measured)
    return dependent._replace(reason=_reason(dependent, rows, distances[blamed[0]] > 1.0))


def _distance(fit: Problem, estimate: Estimate, u: float, ends: tuple[float, float]) -> float:
    """Return how far the farther end lies from the estimate, over the interval's end on that side, in u."""
    coordinate = next(axis.coordinate for axis in fit.space.axes if axis.name == estimate.name)
    low, high = u - coordinate.u(estimate.low), coordinate.u(estimate.high) - u
    shifts = [coordinate.u(end) - u if math.isfinite(end) else math.inf for end in ends]
    return max(shift / high if shift > 0 else -shift / low for shift in shifts)


def _blamed(distances: Mapping[str, float]) -> list[str]:
    """Return what moves a number out of its interval: each that does alone, else the fewest that do together."""
    order = sorted(distances, key=lambda name: -distances[name])
    alone = [name for name in order if distances[name] > 1.0]
    if alone:
        return alone
    for count in range(2, len(order) + 1):
        if math.hypot(*(distances[name] for name in order[:count])) > 1.0:
            return order[:count]
    return []


def _reason(estimate: Estimate, rows: Sequence[Assumed], alone: bool) -> str:
    """Return the verdict's sentence: what it depends on, where each moves it, and what would tell the first."""
    blamed = estimate.depends_on
    refitted_ranges = {
        row.fixed.name: with_unit(row.refitted[estimate.name], estimate.unit) for row in rows if row.refitted
    }
    dependence = describe_dependence(
        {name: f"{name} (it becomes {refitted_ranges[name]})" for name in blamed}, estimate.measured
    )
    remedy = REMEDY.get(blamed[0].partition(" ")[0], "measure it, and declare it with its sd")
    if blamed[0] in estimate.measured:
        remedy = f"it was measured, but not closely enough; {remedy}"
    return f"depends on {dependence}{'' if alone else ' together'}: {remedy}"
