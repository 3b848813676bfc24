"""What a busy person reads: one sentence, one picture, why to believe it, why to doubt it, what to drive next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.report.headline import headline
from rover_pin.report.reasons import MAX_REASONS, next_run, opposing_reasons, supporting_reasons
from rover_pin.report.section import Picture, Section
from rover_pin.report.words import Labels, capital, human, kinds_of


@dataclass(frozen=True, eq=False)
class FirstScreen(Section):
    """The first screen of any verdict; `picture` shows what was measured, before and after."""

    verdict: Verdict
    labels: Labels
    picture: Picture | None = None
    file: str = "first"
    "name of the picture's file"
    title: ClassVar[str] = "Verdict"
    template: ClassVar[str] = "first_screen.html"

    def content(self) -> Mapping[str, Any]:
        """Return sentence and reasons; of more reasons than fit, how many stand further below."""
        why, but = supporting_reasons(self.verdict, self.labels), opposing_reasons(self.verdict, self.labels)
        return {
            "file": self.file,
            "sentence": headline(self.verdict, self.labels),
            "answer": capital(self.verdict.answer.value),
            "said": capital(human(self.verdict.sentence, kinds_of(self.verdict))),
            "added": bool(self.verdict.named),
            "believe": why[:MAX_REASONS],
            "doubt": but[:MAX_REASONS],
            "more": max(len(but) - MAX_REASONS, 0),
            "next": next_run(self.verdict),
        }

    def pictures(self) -> Mapping[str, Picture]:
        """Return the one picture."""
        return {self.file: self.picture} if self.picture is not None else {}


def first_lines(verdict: Verdict, labels: Labels) -> str:
    """Return the first screen as text, for a terminal."""
    parts = {
        "believe it because": supporting_reasons(verdict, labels)[:MAX_REASONS],
        "doubt it because": opposing_reasons(verdict, labels)[:MAX_REASONS],
        "next": next_run(verdict),
    }
    lines = [headline(verdict, labels)]
    for head, reasons in parts.items():
        lines += [f"{head}:", *(f"  - {line}" for line in reasons)] if reasons else []
    return "\n".join(lines)
