"""What a busy person reads: one sentence, one picture, why to believe it, why to doubt it, what to drive next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.report.headline import headline
from rover_pin.report.reasons import MOST, believe, doubt, next_run
from rover_pin.report.section import Picture, Section
from rover_pin.report.words import Manner, capital, human, kinds_of


@dataclass(frozen=True, eq=False)
class FirstScreen(Section):
    """The first screen of any verdict; `picture` shows what was measured, before and after."""

    verdict: Verdict
    manner: Manner
    picture: Picture | None = None
    file: str = "first"
    "name of the picture's file"
    title: ClassVar[str] = "Verdict"
    template: ClassVar[str] = "first_screen.html"

    def content(self) -> Mapping[str, Any]:
        """Return sentence and reasons; of more reasons than fit, how many stand further below."""
        why, but = believe(self.verdict, self.manner), doubt(self.verdict, self.manner)
        return {
            "file": self.file,
            "sentence": headline(self.verdict, self.manner),
            "answer": capital(self.verdict.answer.value),
            "said": capital(human(self.verdict.sentence, kinds_of(self.verdict))),
            "added": bool(self.verdict.named),
            "believe": why[:MOST],
            "doubt": but[:MOST],
            "more": max(len(but) - MOST, 0),
            "next": next_run(self.verdict),
        }

    def pictures(self) -> Mapping[str, Picture]:
        """Return the one picture."""
        return {self.file: self.picture} if self.picture is not None else {}


def first_lines(verdict: Verdict, manner: Manner) -> str:
    """Return the first screen as text, for a terminal."""
    parts = {
        "believe it because": believe(verdict, manner)[:MOST],
        "doubt it because": doubt(verdict, manner)[:MOST],
        "next": next_run(verdict),
    }
    lines = [headline(verdict, manner)]
    for head, said in parts.items():
        lines += [f"{head}:", *(f"  - {line}" for line in said)] if said else []
    return "\n".join(lines)
