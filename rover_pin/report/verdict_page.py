"""The page of a verdict (the result of the search for missing effects): its sections in their order."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.report.cause_sets import cause_table
from rover_pin.report.headline import full_answer, headline, improvement, next_run, opposing_reasons, supporting_reasons
from rover_pin.report.page import Head, Picture, Section, Sections, write_page
from rover_pin.report.sections.causes import causes_section, sensitivity_section
from rover_pin.report.sections.held_out import held_out_section
from rover_pin.report.sections.numbers import numbers_section
from rover_pin.report.sections.physics import physics_section
from rover_pin.report.words import Labels, capital, full, human, kinds_of, listing

MAX_REASONS = 3
"""Maximum number of reasons to believe, and of reasons to doubt, on the first screen, so that a laptop shows all of it.
The section "Warnings" lists all reasons to doubt."""
LISTED = "sections/listed.html"
"""Template of a section that consists of a list of sentences."""


@dataclass(frozen=True)
class VerdictPage:
    """The parts of a verdict's page that differ between the kinds of data."""

    labels: Labels
    """words that the report uses for the kind of data, such as "runs" or "levels of slip" """
    name: str
    """name of the data set"""
    kicker: str
    """line above the headline that states the amount of data"""
    picture: tuple[str, Picture | None]
    """file name (without .png) of the first picture, and the picture itself (None for no picture)"""
    after_first: Sections = ()
    "sections that follow the first section (headline, reasons and first picture)"
    where_wrong: Section | None = None
    """section that shows how large the residual is, and where it is large"""
    after_numbers: Section | None = None
    "section that follows the fitted numbers"
    describe_size: Callable[[Any], str] = lambda effect: ""
    """function that describes the influence of an effect in one sentence, or returns an empty text"""
    source: str = ""
    "origin of the data"
    model_file: bool = True
    """whether the search for missing effects wrote a single model file, so that a command can simulate a drive"""


def write_verdict(verdict: Verdict, page: VerdictPage, out: Path) -> list[Path]:
    """Write the page of a verdict, report.html, and its figures into the folder `out`, and return the paths of all
    files.
    """
    labels = page.labels
    doubts = opposing_reasons(verdict, labels)
    findings = [str(finding) for finding in verdict.findings] or ["Nothing to report."]
    # From the answer to the details: errors, residual, effect, causes, numbers, limits, data, repetition.
    sections = [
        first_screen(verdict, labels, page.picture[1], page.picture[0]),
        answer_section(verdict, labels),
        *page.after_first,
        held_out_section(verdict, labels),
        page.where_wrong,
        physics_section(verdict, labels, page.describe_size),
        causes_section(verdict, labels),
        numbers_section(verdict),
        page.after_numbers,
        sensitivity_section(verdict, labels),
        Section("Warnings", LISTED, {"lines": doubts}) if doubts else None,
        Section("The data check", LISTED, {"lines": findings, "note": f"Source: {page.source}" if page.source else ""}),
        repeat_section(verdict, labels, page.model_file),
    ]
    return write_page(Head(page.name, page.kicker, headline(verdict, labels)), sections, out)


def repeat_section(verdict: Verdict, labels: Labels, model_file: bool = True) -> Section | None:
    """Return the section with command, seed and versions for a repetition of the search for missing effects; None if
    they are unknown.

    `model_file` is True if the search wrote a single model file; the section then describes this model.
    """
    if not verdict.provenance:
        return None
    content = {name: verdict.provenance[name] for name in ("command", "seconds", "seed", "versions")}
    kinds = kinds_of(verdict)
    added = listing(full(name, kinds, labels) for name in verdict.named)
    content["model"] = (f"the model with {added}" if added else verdict.model_description) if model_file else ""
    return Section("To repeat this run", "sections/repeat.html", content)


def first_screen(verdict: Verdict, labels: Labels, picture: Picture | None = None, file: str = "first") -> Section:
    """Return the first section of a page: headline, table of causes, picture, reasons, and the next measurement.

    Parameters
    ----------
    verdict : Verdict
        The verdict.
    labels : Labels
        Words that the report uses for the kind of data.
    picture : Picture, optional
        Picture of the measured data with the base model and the model with added effects.
    file : str
        Name of the picture's file, without ".png".
    """
    why, but = supporting_reasons(verdict, labels), opposing_reasons(verdict, labels)
    content = {
        "file": file,
        "sentence": headline(verdict, labels),
        "causes": cause_table(verdict, labels),
        "remark": labels.besides,
        "believe": why[:MAX_REASONS],
        "doubt": but[:MAX_REASONS],
        "more": max(len(but) - MAX_REASONS, 0),
        "next": next_run(verdict),
    }
    return Section("Verdict", "first_screen.html", content, {file: picture} if picture is not None else {})


def answer_section(verdict: Verdict, labels: Labels) -> Section:
    """Return the section with the answer in full sentences: meaning, size and probability of each possible cause, and
    the change of the held-out errors.
    """
    content = {
        "answer": capital(verdict.answer.value),
        "explanation": capital(human(verdict.sentence, kinds_of(verdict))),
        "added": bool(verdict.named),
        "sentences": [line for line in (full_answer(verdict, labels), improvement(verdict, labels)) if line],
    }
    return Section("The answer in full", "sections/answer.html", content)


def first_lines(verdict: Verdict, labels: Labels) -> str:
    """Return the content of the page's first section as text for a terminal: headline, causes, reasons, and next
    runs.
    """
    parts = {
        "believe it because": supporting_reasons(verdict, labels)[:MAX_REASONS],
        "doubt it because": opposing_reasons(verdict, labels)[:MAX_REASONS],
        "next": next_run(verdict),
    }
    lines = [headline(verdict, labels)]
    # One line for each row of the table, in which each cell follows the heading of its column.
    if (table := cause_table(verdict, labels)) is not None:
        for row in table.rows:
            name, size, *others = row.cells
            cells = [f"{head} {cell}" for head, cell in zip(table.heads[2:], others, strict=True) if cell]
            lines.append(f"  {name}: {'; '.join(filter(None, [size, *cells]))}")
    lines += [labels.besides] if labels.besides else []
    for head, reasons in parts.items():
        lines += [f"{head}:", *(f"  - {line}" for line in reasons)] if reasons else []
    return "\n".join(lines)
