"""The fitted numbers, before and after, with what was known of them beforehand, and how fast chi2 rises along them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation import wording
from rover_pin.estimation.numbers import DRIFTED, Number
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.wording import shown
from rover_pin.report.profiles import profiles_figure
from rover_pin.report.section import AWAY, CHOSEN, Picture, Row, Section, Table


@dataclass(frozen=True, eq=False)
class Numbers(Section):
    """The fitted numbers; those that sit away from what was known beforehand stand first."""

    verdict: Verdict
    title: ClassVar[str] = "Fitted numbers"
    template: ClassVar[str] = "sections/numbers.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return the table, and what speaks to it from elsewhere."""
        if self.verdict.after is None or not self.verdict.after.numbers:
            return None
        return {"numbers": number_table(self.verdict)}

    def pictures(self) -> Mapping[str, Picture]:
        """Return the profiles."""
        profiles = self.verdict.profiles
        if not profiles or self.verdict.after is None:
            return {}
        ends = {one.name: (one.low, one.high) for one in self.verdict.after.numbers}
        panels = profiles_figure(profiles, [ends[one.name] for one in profiles])
        alt = f"Rise of chi2 along {', '.join(one.name for one in profiles)}, all others refitted."
        caption = (
            "Rise of chi2 along each number, all others refitted; dashed: the 95 % limit, shaded: the 95 % interval."
        )
        return {"profiles": Picture(panels, alt, caption)}


def number_table(verdict: Verdict) -> Table:
    """Return the fitted numbers: those away from what was known beforehand first, then those of what was added."""
    assert verdict.before is not None
    assert verdict.after is not None
    added, before = bool(verdict.named), {one.name: one for one in verdict.before.numbers}
    known = {one.name: one for one in (*verdict.after.fit.parameters, *verdict.before.fit.parameters)}
    heads = ("number", *(("before", "after") if added else ("fitted",)), "beforehand", "SD from it", "note")
    ranked = sorted(
        verdict.after.numbers, key=lambda one: (not abs(one.drift) > DRIFTED, one.name in before, -_far(one))
    )
    return Table(heads, tuple(_row(one, before, known[one.name], added) for one in ranked))


def _row(one: Number, before: Mapping[str, Number], parameter: Parameter, added: bool) -> Row:
    was = before.get(one.name)
    sides = ((interval(was) if was else "not in the model",) if added else ()) + (interval(one),)
    notes = [one.away] if abs(one.drift) > DRIFTED else []
    notes += [one.note] if one.note else []
    if was is not None and math.isfinite(was.drift) and not math.isfinite(one.drift):
        notes.append(f"freed: before, {was.away}")
    drift = f"{one.drift:+.2f}" if math.isfinite(one.drift) else ""
    look = AWAY if notes else CHOSEN if was is None else ""
    return Row((one.name, *sides, beforehand(parameter, one), drift, "; ".join(notes)), look)


def _far(one: Number) -> float:
    return abs(one.drift) if math.isfinite(one.drift) else math.inf


def interval(one: Number) -> str:
    """Return a value with its 95 % interval."""
    return wording.interval(one.value, one.low, one.high, one.unit)


def beforehand(parameter: Parameter, one: Number) -> str:
    """Return what was known of a number before it was fitted: its value and SD, and who says so."""
    if not parameter.prior:
        return "nothing: sought"
    spread = f"{parameter.scale:.0%}" if parameter.log else shown(parameter.scale, one.unit)
    source = parameter.source or ("declared" if parameter.declared else "assumed")
    return f"{shown(parameter.origin, one.unit)} \u00b1 {spread}, {source}"
