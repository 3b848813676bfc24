"""The fitted numbers, before and after, with what was known of them beforehand, and which go together."""

import math
from collections.abc import Mapping

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import CLEAR
from rover_pin.estimation.wording import format_value
from rover_pin.report.page import AWAY, CHOSEN, Row, Section, Table


def numbers_section(verdict: Verdict) -> Section | None:
    """Return the fitted numbers; those that sit away from what was known beforehand stand first."""
    if verdict.after is None or not verdict.after.numbers:
        return None
    return Section("Fitted numbers", "sections/numbers.html", {"numbers": number_table(verdict)})


def number_table(verdict: Verdict) -> Table:
    """Return the fitted numbers: those away from what was known beforehand first, then those of what was added."""
    assert verdict.before is not None
    assert verdict.after is not None
    added, before = bool(verdict.named), {number.name: number for number in verdict.before.numbers}
    parameters = {
        parameter.name: parameter for parameter in (*verdict.after.fit.parameters, *verdict.before.fit.parameters)
    }
    heads = (
        "number", *(("before", "after") if added else ("fitted",)), "beforehand", "SD from it", "goes most with", "note"
    )  # fmt: skip
    partners = most_correlated(verdict.after.fit)
    ranked = sorted(
        verdict.after.numbers, key=lambda number: (not abs(number.drift) > CLEAR, number.name in before, -_far(number))
    )
    rows = (_row(row, before, parameters[row.name], partners.get(row.name, ""), added) for row in ranked)
    return Table(heads, tuple(rows))


def most_correlated(fitted: Fit) -> dict[str, str]:
    """Return, for each number of a fit, the other one with which it is correlated most, and by how much."""
    names, covariance = [parameter.name for parameter in fitted.parameters], fitted.covariance
    sd = np.sqrt(np.diag(covariance))
    correlations = covariance / np.outer(sd, sd) - np.eye(len(names))
    rows = zip(names, correlations, strict=True) if len(names) > 1 else ()
    most = {name: (row, int(np.argmax(np.abs(row)))) for name, row in rows}
    return {name: f"{names[at]} {row[at]:+.2f}" for name, (row, at) in most.items()}


def _row(number: Number, before: Mapping[str, Number], parameter: Parameter, partner: str, added: bool) -> Row:
    was = before.get(number.name)
    sides = ((was.interval if was else "not in the model",) if added else ()) + (number.interval,)
    notes = [number.away] if abs(number.drift) > CLEAR else []
    notes += [number.note] if number.note else []
    if was is not None and math.isfinite(was.drift) and not math.isfinite(number.drift):
        notes.append(f"released: before, {was.away}")
    drift = f"{number.drift:+.2f}" if math.isfinite(number.drift) else ""
    look = AWAY if notes else CHOSEN if was is None else ""
    return Row((number.name, *sides, beforehand(parameter, number), drift, partner, "; ".join(notes)), look)


def _far(number: Number) -> float:
    return abs(number.drift) if math.isfinite(number.drift) else math.inf


def beforehand(parameter: Parameter, number: Number) -> str:
    """Return what was known of a number before it was fitted: its value and SD, and who says so."""
    if not parameter.prior:
        return "nothing: sought"
    spread = f"{parameter.scale:.0%}" if parameter.log else format_value(parameter.scale, number.unit)
    source = parameter.source or ("declared" if parameter.declared else "assumed")
    return f"{format_value(parameter.origin, number.unit)} \u00b1 {spread}, {source}"
