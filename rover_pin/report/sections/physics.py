"""What was added: its meaning, how much it does, its equation, and its numbers with their sources."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.names import meaning_of, title_of
from rover_pin.estimation.wording import shown
from rover_pin.quantity import quantities
from rover_pin.report.practical import practical
from rover_pin.report.section import Row, Section, Table
from rover_pin.report.sections.numbers import interval
from rover_pin.report.words import Manner, capital


def _nothing_more(effect: Any) -> str:
    return ""


@dataclass(frozen=True, eq=False)
class Physics(Section):
    """Each added effect; `further` says more of how much one does, where a kind of data can."""

    verdict: Verdict
    manner: Manner
    further: Callable[[Any], str] = _nothing_more
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
        own = [name for name, record in records.items() if type(record) is kind]
        owner = next((name for name in own if records[name] == effect), own[0])
        said = [practical(fitted, owner, self.manner), self.further(effect)]
        paragraphs = [part for part in (inspect.getdoc(kind) or "").split("\n\n") if part.strip()]
        return {
            "title": capital(title_of(kind)),
            "name": owner,
            "meaning": capital(meaning_of(kind)) + ".",
            "does": [line for line in said if line],
            "equation": paragraphs[0] if paragraphs else "",
            "more": paragraphs[1:],
            "numbers": self._numbers(effect, owner),
        }

    def _numbers(self, effect: Any, owner: str) -> Table:
        assert self.verdict.after is not None
        fitted = {one.name: one for one in self.verdict.after.numbers}
        rows = []
        for name, about in quantities(effect).items():
            usual = float(getattr(type(effect)(), name))
            own = fitted.get(f"{owner}.{name}")
            value = interval(own) if own else f"{shown(float(getattr(effect, name)), about.unit)}, held"
            bounds = f"{shown(about.low, about.unit)} to {shown(about.high, about.unit)}"
            rows.append(Row((f"{name} ({about.symbol})" if about.symbol not in ("", name) else name, value,
                             shown(usual, about.unit), bounds, about.source)))  # fmt: skip
        return Table(("parameter", "fitted, 95 %", "default", "allowed", "source of the default"), tuple(rows))
