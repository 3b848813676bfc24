"""What stands at the end of every report: warnings, the data check, and how to repeat it."""

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.report.page import Section
from rover_pin.report.reasons import opposing_reasons
from rover_pin.report.words import Labels, full, kinds_of, listing

LISTED = "sections/listed.html"


def warnings_section(verdict: Verdict, labels: Labels) -> Section | None:
    """Return all that a reader should be wary of."""
    lines = opposing_reasons(verdict, labels)
    return Section("Warnings", LISTED, {"lines": lines}) if lines else None


def data_check_section(verdict: Verdict, source: str = "") -> Section:
    """Return what the check of the data found, and where they come from."""
    lines = [str(finding) for finding in verdict.findings] or ["Nothing to report."]
    return Section("The data check", LISTED, {"lines": lines, "note": f"Source: {source}" if source else ""})


def repeat_section(verdict: Verdict, labels: Labels, model_file: bool = True) -> Section | None:
    """Return the command, the seed and the versions that give the same answer; `model_file`: whether there is one."""
    if not verdict.provenance:
        return None
    content = {name: verdict.provenance[name] for name in ("command", "seconds", "seed", "versions")}
    kinds = kinds_of(verdict)
    added = listing(full(name, kinds, labels) for name in verdict.named)
    content["model"] = (f"the model with {added}" if added else verdict.model_description) if model_file else ""
    return Section("To repeat it", "sections/repeat.html", content)
