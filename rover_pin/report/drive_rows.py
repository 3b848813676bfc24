"""The tables of a drive report: before and after, refits, numbers, what is left, and what the data cannot tell."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.discrepancy.held_out import ChannelScore, RunScore, together
from rover_pin.discrepancy.refit import Refit
from rover_pin.discrepancy.search import Search
from rover_pin.discrepancy.verdict import Side, Verdict
from rover_pin.estimation import wording
from rover_pin.estimation.numbers import DRIFTED, Number, numbers
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.wording import Outcome, shown
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.experiments.unlisted.remainder import Remainder
from rover_pin.quantity import quantities
from rover_pin.report.drive_runs import Sides, words_of

CHOSEN, AWAY = "chosen", "away"
"""Looks of a row: what was added, and what the reader should stop at."""
LEFT = 12
"""Channels whose remainder is listed."""


class Row(NamedTuple):
    """One row of a table, and how it looks."""

    cells: tuple[str, ...]
    look: str = ""


def numbers_of(side: Side | None) -> tuple[Number, ...]:
    """Return the numbers of a model; none where the data did not suffice to fit it."""
    return side.numbers if side else ()


def summary_rows(verdict: Verdict, sides: Sides) -> list[Row]:
    """Return what a reader wants first: misfit of runs left out and fitted, and how far free runs stray."""

    def row(what: str, before: str, after: str) -> Row:
        return Row((what, before, after) if sides.added else (what, before))

    rows = [
        row(
            "misfit of runs left out (chi2 a block; 1 is the noise)", *(f"{one:.2f}" for one in together(verdict.runs))
        ),
        row("misfit of the runs that were fitted", *(f"{one.misfit:.2f}" for one in sides)),
    ]
    for one in extra_of(verdict).free:
        driven = f"free run {one.run}, {one.distance:.2f} m driven: RMS distance from the logged place"
        rows.append(row(driven, _mm(one.before), _mm(one.after)))
    if len(extra_of(verdict).free) > 1:
        both = np.array([(one.before, one.after) for one in extra_of(verdict).free])
        rows.append(row("all free runs together", *(_mm(float(each)) for each in np.sqrt(np.nanmean(both**2, axis=0)))))
    return rows


def _mm(distance: float) -> str:
    return f"{1e3 * distance:.1f} mm" if math.isfinite(distance) else "did not drive"


def score_rows(scores: Sequence[ChannelScore], added: bool) -> list[Row]:
    """Return held-out errors by channel, the farthest from its noise first."""
    ranked = sorted(scores, key=lambda one: -one.before / max(one.floor, 1e-300))
    rows = []
    for one in ranked:
        name, floor, before = words_of(one.name), shown(one.floor, one.unit), shown(one.before, one.unit)
        after = (shown(one.after, one.unit), one.worded.text, one.worded.outcome.value) if added else ()
        rows.append(Row((name, floor, before, *after), AWAY if added and one.worded.outcome is Outcome.WORSE else ""))
    return rows


def run_rows(runs: Sequence[RunScore], added: bool) -> list[Row]:
    """Return the held-out misfit of every run."""

    def change(one: RunScore) -> tuple[str, str]:
        return f"{one.after:.2f}", one.worded.text

    return [
        Row((one.run, f"{one.blocks}", f"{one.before:.2f}", *(change(one) if added else ())), AWAY * (one.low > 0))
        for one in runs
    ]


def refit_rows(refits: Sequence[Refit], alike: Sequence[Refit]) -> list[Row]:
    """Return one row a refitted candidate with its own numbers."""
    rows = []
    for one in refits:
        values = "; ".join(f"{each.name.rpartition('.')[2]} = {interval(each)}" for each in own_numbers(one))
        gains = (f"{one.gain:.1f}", f"{one.fee:.1f}", f"{one.net:+.1f}", f"{one.held_out:+.1f}")
        rows.append(Row((one.name, *gains, values, _judged(one)), CHOSEN if one in alike else ""))
    return rows


def _judged(one: Refit) -> str:
    if one.gain < 0:
        return "its refit did not settle"
    if one.net <= 0:
        return "gains no more than chance"
    return "accepted" if one.accepted else "no better on runs left out"


def own_numbers(one: Refit) -> list[Number]:
    """Return the candidate's own fitted numbers."""
    own = (*one.candidate.sizes, *one.candidate.shapes)
    return [each for each in numbers(one.fit) if each.name in own]


def number_rows(verdict: Verdict, sides: Sides) -> list[Row]:
    """Return the fitted numbers: those away from what was declared first, then those of what was added."""
    before = {one.name: one for one in numbers_of(verdict.before)}
    about = {one.name: (one, u) for one, u in zip(sides.after.parameters, sides.after.u, strict=True)}
    known = {one.name: one for one in sides.before.parameters}
    rows = []
    for one in sorted(
        numbers_of(verdict.after),
        key=lambda one: (not abs(one.drift) > DRIFTED, one.name in before, -_far(one)),
    ):
        was = [interval(before[one.name]) if one.name in before else "not in the model"] if sides.added else []
        parameter, u = about[one.name]
        notes = [f"{one.drift:+.1f} SD from what was declared"] if abs(one.drift) > DRIFTED else []
        notes += ["at its bound"] if at_bound(parameter, float(u)) else []
        if one.name in before and not parameter.prior:
            notes += [f"freed: before, {before[one.name].drift:+.1f} SD from what was declared"]
        drift = f"{one.drift:+.2f}" if math.isfinite(one.drift) else ""
        cells = (
            one.name,
            *was,
            interval(one),
            declared(known.get(one.name, parameter), one.unit),
            drift,
            "; ".join(notes),
        )
        rows.append(Row(cells, AWAY if notes else CHOSEN if one.name not in before else ""))
    return rows


def _far(one: Number) -> float:
    return abs(one.drift) if math.isfinite(one.drift) else math.inf


def interval(one: Number) -> str:
    """Return a value with its 95 % interval."""
    return wording.interval(one.value, one.low, one.high, one.unit)


def declared(one: Parameter, unit: str) -> str:
    """Return what was known of a number before the log was: its value and SD."""
    if not one.prior:
        return "nothing: sought"
    spread = f"{one.scale:.0%}" if one.log else shown(one.scale, unit)
    return f"{shown(one.origin, unit)} \u00b1 {spread}"


def at_bound(one: Parameter, u: float) -> bool:
    """Return whether a number lies on one of its bounds."""
    return bool(min(abs(u - end) for end in one.bounds) < 1e-6)


def left_rows(left: Remainder) -> list[Row]:
    """Return what the channels leave, the most first, with what it goes with."""
    ranked = sorted(left.channels, key=lambda one: -one.rms)[:LEFT]
    return [
        Row(
            (
                words_of(one.name),
                f"{one.rms:.2f}",
                f"{one.memory:+.2f}",
                *(f"{value:+.2f}" for value in one.correlations.values()),
                "noise" if one.is_noise else f"{one.worst_run}, {one.worst_time:.1f} s, x = {one.worst_place:.2f} m",
            ),
            "" if one.is_noise else AWAY,
        )
        for one in ranked
    ]


def effect_rows(verdict: Verdict, kind: type) -> list[Row]:
    """Return the parameters of an added effect: fitted or default value, bounds and source."""
    fitted = {one.name: one for one in numbers_of(verdict.after)}
    owners = [name.partition("@")[0] for name in verdict.named if name.startswith(kind.__name__)]
    default, rows = kind(), []
    for name, about in quantities(kind).items():
        own = [fitted[f"{owner}.{name}"] for owner in owners if f"{owner}.{name}" in fitted]
        value = "; ".join(interval(one) for one in own) or f"{shown(float(getattr(default, name)), about.unit)}, held"
        bounds = f"{shown(about.low, about.unit)} to {shown(about.high, about.unit)}"
        usual = shown(float(getattr(default, name)), about.unit)
        rows.append(Row((f"{name} ({about.symbol or name})", value, usual, bounds, about.source)))
    return rows


def kinds_of(verdict: Verdict) -> list[type]:
    """Return the classes of what was added."""
    return list(dict.fromkeys(type(effect) for effect in verdict.effects))


def refits_of(search: Search) -> Iterable[tuple[str, list[Row]]]:
    """Return to what candidates were added, and their refits, one look after the other."""
    for number, look in enumerate(search.rounds):
        if look.refits:
            base = " and ".join(one.name for one in search.found[:number]) or "the base model"
            yield base, refit_rows(look.refits, look.alike)
