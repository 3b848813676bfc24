"""What was added: its meaning, how much it does, its equation, and its numbers with their sources."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import meaning_of, title_of
from rover_pin.estimation.wording import format_value
from rover_pin.report.practical import practical
from rover_pin.report.section import Row, Section, Table
from rover_pin.report.sections.numbers import interval
from rover_pin.report.words import Labels, capital


def _nothing_more(effect: Any) -> str:
    return ""


@dataclass(frozen=True, eq=False)
class Physics(Section):
    """Each added effect; `describe_size` says more of how much one does, where a kind of data can."""

    verdict: Verdict
    labels: Labels
    describe_size: Callable[[Any], str] = _nothing_more
    title: ClassVar[str] = "What was added, and how much it does"
    template: ClassVar[str] = "sections/physics.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return the effects; None where none was added."""
        if not self.verdict.effects or self.verdict.after is None:
            return None
        return {"effects": [self._effect(effect) for effect in self.verdict.effects]}

    def _effect(self, effect: Any) -> dict[str, Any]:
        assert self.verdict.after is not None
        kind, fitted = type(effect), self.verdict.after.fit
        records = fitted.task.experiment.records(fitted.model)
        owners = [name for name, record in records.items() if type(record) is kind]
        owner = next((name for name in owners if records[name] == effect), owners[0])
        sentences = [practical(fitted, owner, self.labels), self.describe_size(effect)]
        paragraphs = [part for part in (inspect.getdoc(kind) or "").split("\n\n") if part.strip()]
        return {
            "title": capital(title_of(kind)),
            "name": owner,
            "meaning": capital(meaning_of(kind)) + ".",
            "does": [line for line in sentences if line],
            "equation": paragraphs[0] if paragraphs else "",
            "more": paragraphs[1:],
            "numbers": self._numbers(effect, owner),
        }

    def _numbers(self, effect: Any, owner: str) -> Table:
        assert self.verdict.after is not None
        fitted = {number.name: number for number in self.verdict.after.numbers}
        rows = []
        for name, quantity in quantities(effect).items():
            default = float(getattr(type(effect)(), name))
            fitted_number = fitted.get(f"{owner}.{name}")
            value = (
                interval(fitted_number)
                if fitted_number
                else f"{format_value(float(getattr(effect, name)), quantity.unit)}, held"
            )
            bounds = f"{format_value(quantity.low, quantity.unit)} to {format_value(quantity.high, quantity.unit)}"
            rows.append(Row((f"{name} ({quantity.symbol})" if quantity.symbol not in ("", name) else name, value,
                             format_value(default, quantity.unit), bounds, quantity.source)))  # fmt: skip
        return Table(("parameter", "fitted, 95 %", "default", "allowed", "source of the default"), tuple(rows))
