"""A verdict on any data as a page: the sections that all have, in their order, and between them those of a kind."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.report.first_screen import first_screen
from rover_pin.report.headline import headline
from rover_pin.report.page import Head, write_page
from rover_pin.report.section import Picture, Section, Sections
from rover_pin.report.sections.closing import data_check_section, repeat_section, warnings_section
from rover_pin.report.sections.held_out import held_out_section
from rover_pin.report.sections.numbers import numbers_section
from rover_pin.report.sections.physics import nothing_more, physics_section
from rover_pin.report.sections.sensitivity import sensitivity_section
from rover_pin.report.sections.which_cause import which_cause_section
from rover_pin.report.words import Labels


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
    describe_size: Callable[[Any], str] = nothing_more,
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
