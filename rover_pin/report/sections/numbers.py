"""The section on the fitted numbers: values without and with the added effects, priors, and strongest correlations."""

import math
from collections.abc import Mapping

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.numbers import Number
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import CLEAR_SDS
from rover_pin.estimation.wording import format_value
from rover_pin.report.page import AWAY, CHOSEN, ReportTable, Section, TableRow


def numbers_section(verdict: Verdict) -> Section | None:
    """Return the section with the table of fitted numbers; None if no number was fitted."""
    if verdict.after is None or not verdict.after.numbers:
        return None
    return Section("Fitted numbers", "sections/numbers.html", {"numbers": number_table(verdict)})


def number_table(verdict: Verdict) -> ReportTable:
    """Return the table of the fitted numbers: their values in the model with added effects, and in the base model.

    Numbers that lie more than 3 SD from their prior value come first, then the numbers of the added effects.
    """
    assert verdict.before is not None
    assert verdict.after is not None
    added, before = bool(verdict.named), {number.name: number for number in verdict.before.numbers}
    parameters = {
        parameter.name: parameter for parameter in (*verdict.after.fit.parameters, *verdict.before.fit.parameters)
    }
    heads = (
        "number",
        *(("before", "after") if added else ("fitted",)),
        "prior",
        "SDs from the prior",
        "prior narrowed",
        "strongest correlation",
        "note",
    )  # fmt: skip
    partners = most_correlated(verdict.after.fit)
    # Surprising numbers come first: far from their priors, then new in the model.
    ranked = sorted(
        verdict.after.numbers,
        key=lambda number: (
            not abs(number.drift) > CLEAR_SDS,
            number.name in before,
            # A number without a prior has no drift, and comes before the numbers with one.
            -(abs(number.drift) if math.isfinite(number.drift) else math.inf),
        ),
    )
    rows = (_row(row, before, parameters[row.name], partners.get(row.name, ""), added) for row in ranked)
    return ReportTable(heads, tuple(rows))


def most_correlated(fitted: Fit) -> dict[str, str]:
    """Return a dict from each fitted number to the number with which it correlates most, and the correlation.

    For example, {"soil.k": "soil.phi -0.97"} states that an error of soil.k is nearly hidden by an error of soil.phi of
    the opposite sign.
    """
    names, covariance = [parameter.name for parameter in fitted.parameters], fitted.covariance
    sd = np.sqrt(np.diag(covariance))
    # The diagonal, which is 1, is subtracted, so that no number is its own partner.
    correlations = covariance / np.outer(sd, sd) - np.eye(len(names))
    rows = zip(names, correlations, strict=True) if len(names) > 1 else ()
    most = {name: (row, int(np.argmax(np.abs(row)))) for name, row in rows}
    return {name: f"{names[at]} {row[at]:+.2f}" for name, (row, at) in most.items()}


def _row(number: Number, before: Mapping[str, Number], parameter: Parameter, partner: str, added: bool) -> TableRow:
    """Return the table row of one fitted number.

    `before` maps names to the numbers of the base model, `partner` states the number's strongest correlation, and
    `added` is whether effects were added.
    """
    was = before.get(number.name)
    sides = ((was.interval if was else "not in the model",) if added else ()) + (number.interval,)
    # Notes draw attention: a value far from its prior, a bound, or a prior that no longer holds.
    notes = [number.away] if abs(number.drift) > CLEAR_SDS else []
    notes += [number.note] if number.note else []
    if was is not None and math.isfinite(was.drift) and not math.isfinite(number.drift):
        notes.append(f"its prior was released: before, {was.away}")
    drift = f"{number.drift:+.2f}" if math.isfinite(number.drift) else ""
    narrowed = f"{number.narrowed:.3g} times" if math.isfinite(number.narrowed) else ""
    look = AWAY if notes else CHOSEN if was is None else ""
    cells = (number.name, *sides, beforehand(parameter, number), drift, narrowed, partner, "; ".join(notes))
    return TableRow(cells, look)


def beforehand(parameter: Parameter, number: Number) -> str:
    """Return the prior of a number as text: value, SD and source. The text is "none" for a number without a prior."""
    if not parameter.prior:
        return "none"
    # On a logarithmic scale the prior SD is relative to the value.
    sd = f"{parameter.scale:.0%}" if parameter.log else format_value(parameter.scale, number.unit)
    source = parameter.source or ("declared" if parameter.declared else "assumed")
    return f"{format_value(parameter.origin, number.unit)} \u00b1 {sd}, {source}"
