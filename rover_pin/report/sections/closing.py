"""What stands at the end of every report: warnings, the data check, and how to repeat it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.report.reasons import opposing_reasons
from rover_pin.report.section import Section
from rover_pin.report.words import Labels, full, kinds_of, listing


@dataclass(frozen=True, eq=False)
class Warnings(Section):
    """All that a reader should be wary of."""

    verdict: Verdict
    labels: Labels
    title: ClassVar[str] = "Warnings"
    template: ClassVar[str] = "sections/listed.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return every reason to doubt."""
        lines = opposing_reasons(self.verdict, self.labels)
        return {"lines": lines} if lines else None


@dataclass(frozen=True, eq=False)
class DataCheck(Section):
    """What the check of the data found, and where they come from."""

    verdict: Verdict
    source: str = ""
    title: ClassVar[str] = "The data check"
    template: ClassVar[str] = "sections/listed.html"

    def content(self) -> Mapping[str, Any]:
        """Return the findings."""
        lines = [str(finding) for finding in self.verdict.findings] or ["Nothing to report."]
        return {"lines": lines, "note": f"Source: {self.source}" if self.source else ""}


@dataclass(frozen=True, eq=False)
class Repeat(Section):
    """The command, the seed and the versions that give the same answer; `model_file` says whether there is one."""

    verdict: Verdict
    labels: Labels
    model_file: bool = True
    title: ClassVar[str] = "To repeat it"
    template: ClassVar[str] = "sections/repeat.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return what the loop noted of itself."""
        noted = self.verdict.provenance
        if not noted:
            return None
        kinds = kinds_of(self.verdict)
        added = listing(full(name, kinds, self.labels) for name in self.verdict.named)
        return {
            "command": noted["command"],
            "seconds": noted["seconds"],
            "seed": noted["seed"],
            "versions": noted["versions"],
            "model": (f"the model with {added}" if added else self.verdict.model_description)
            if self.model_file
            else "",
        }
