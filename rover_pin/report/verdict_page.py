"""A verdict on any data as a page: the sections that all have, in their order, and between them those of a kind."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import MAX_NAMED
from rover_pin.report.headline import headline, improvement
from rover_pin.report.page import Head, Picture, Section, Sections, write_page
from rover_pin.report.reasons import next_run, opposing_reasons, supporting_reasons
from rover_pin.report.sections.closing import data_check_section, repeat_section, warnings_section
from rover_pin.report.sections.held_out import held_out_section
from rover_pin.report.sections.numbers import numbers_section
from rover_pin.report.sections.physics import physics_section
from rover_pin.report.sections.sensitivity import sensitivity_section
from rover_pin.report.sections.which_cause import which_cause_section
from rover_pin.report.words import Labels, capital, human, kinds_of


def write_verdict(
    verdict: Verdict,
    labels: Labels,
    out: Path,
    name: str,
    kicker: str,
    picture: tuple[str, Picture | None],
    beside_first: Sections = (),
    where_wrong: Section | None = None,
    beside_numbers: Section | None = None,
    describe_size: Callable[[Any], str] = lambda effect: "",
    source: str = "",
    model_file: bool = True,
) -> list[Path]:
    """Write report.html and its figures, and return their paths; `picture` is the first one with its file's name."""
    sections = [
        first_screen(verdict, labels, picture[1], picture[0]),
        *beside_first,
        held_out_section(verdict, labels),
        where_wrong,
        physics_section(verdict, labels, describe_size),
        which_cause_section(verdict, labels),
        numbers_section(verdict),
        beside_numbers,
        sensitivity_section(verdict, labels),
        warnings_section(verdict, labels),
        data_check_section(verdict, source),
        repeat_section(verdict, labels, model_file),
    ]
    return write_page(Head(name, kicker, headline(verdict, labels)), sections, out)


def first_screen(verdict: Verdict, labels: Labels, picture: Picture | None = None, file: str = "first") -> Section:
    """Return the first screen of any verdict; of more reasons than fit it says how many stand further below.

    `picture` shows what was measured, before and after; `file` is the name of its file.
    """
    why, but = supporting_reasons(verdict, labels), opposing_reasons(verdict, labels)
    content = {
        "file": file,
        "sentence": headline(verdict, labels),
        "improvement": improvement(verdict, labels),
        "answer": capital(verdict.answer.value),
        "said": capital(human(verdict.sentence, kinds_of(verdict))),
        "added": bool(verdict.named),
        "believe": why[:MAX_NAMED],
        "doubt": but[:MAX_NAMED],
        "more": max(len(but) - MAX_NAMED, 0),
        "next": next_run(verdict),
    }
    return Section("Verdict", "first_screen.html", content, {file: picture} if picture is not None else {})


def first_lines(verdict: Verdict, labels: Labels) -> str:
    """Return the first screen as text, for a terminal."""
    parts = {
        "believe it because": supporting_reasons(verdict, labels)[:MAX_NAMED],
        "doubt it because": opposing_reasons(verdict, labels)[:MAX_NAMED],
        "next": next_run(verdict),
    }
    lines = [line for line in (headline(verdict, labels), improvement(verdict, labels)) if line]
    for head, reasons in parts.items():
        lines += [f"{head}:", *(f"  - {line}" for line in reasons)] if reasons else []
    return "\n".join(lines)
