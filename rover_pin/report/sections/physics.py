"""What was added: its meaning, how much it does, its equation, and its numbers with their sources."""

import inspect
from collections.abc import Callable
from typing import Any

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.verdict import Side, Verdict
from rover_pin.effects.names import meaning_of, title_of
from rover_pin.estimation.wording import format_value
from rover_pin.report.practical import practical
from rover_pin.report.section import Row, Section, Table
from rover_pin.report.sections.numbers import interval
from rover_pin.report.words import Labels, capital


def _nothing_more(effect: Any) -> str:
    return ""


def physics_section(
    verdict: Verdict, labels: Labels, describe_size: Callable[[Any], str] = _nothing_more
) -> Section | None:
    """Return each added effect, None where there is none.

    `describe_size` says more of how much one does, where a kind of data can.
    """
    if not verdict.effects or verdict.after is None:
        return None
    effects = [_effect(effect, verdict.after, labels, describe_size) for effect in verdict.effects]
    return Section("What was added, and how much it does", "sections/physics.html", {"effects": effects})


def _effect(effect: Any, side: Side, labels: Labels, describe_size: Callable[[Any], str]) -> dict[str, Any]:
    kind, fitted = type(effect), side.fit
    records = fitted.task.experiment.records(fitted.model)
    owners = [name for name, record in records.items() if type(record) is kind]
    owner = next((name for name in owners if records[name] == effect), owners[0])
    sentences = [practical(fitted, owner, labels), describe_size(effect)]
    paragraphs = [part for part in (inspect.getdoc(kind) or "").split("\n\n") if part.strip()]
    return {
        "title": capital(title_of(kind)),
        "name": owner,
        "meaning": capital(meaning_of(kind)) + ".",
        "does": [line for line in sentences if line],
        "equation": paragraphs[0] if paragraphs else "",
        "more": paragraphs[1:],
        "numbers": _numbers(effect, owner, side),
    }


def _numbers(effect: Any, owner: str, side: Side) -> Table:
    fitted = {number.name: number for number in side.numbers}
    rows = []
    for name, quantity in quantities(effect).items():
        default, number = float(getattr(type(effect)(), name)), fitted.get(f"{owner}.{name}")
        held_value = f"{format_value(float(getattr(effect, name)), quantity.unit)}, held"
        bounds = f"{format_value(quantity.low, quantity.unit)} to {format_value(quantity.high, quantity.unit)}"
        rows.append(Row((f"{name} ({quantity.symbol})" if quantity.symbol not in ("", name) else name,
                         interval(number) if number else held_value,
                         format_value(default, quantity.unit), bounds, quantity.source)))  # fmt: skip
    return Table(("parameter", "fitted, 95 %", "default", "allowed", "source of the default"), tuple(rows))
