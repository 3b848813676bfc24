"""A report as one HTML page of sections that needs nothing else, with its figures as PNG files beside it."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from rover_pin.base.files.whole_file import replace_file
from rover_pin.report.svg import png, svg


class Picture(NamedTuple):
    """One or several panels that are read together, and what they show in words."""

    panels: tuple[Figure, ...]
    alt: str
    "the result, for who does not see it"
    caption: str = ""


class Section(NamedTuple):
    """One section of a page: what its template shows, and its pictures by name; each becomes NAME.png too."""

    title: str
    template: str
    "name of its file in this room"
    content: Mapping[str, Any]
    pictures: Mapping[str, Picture] = {}

    @property
    def html_id(self) -> str:
        """Where the contents point."""
        return "".join(letter if letter.isalnum() else "-" for letter in self.title.lower()).strip("-")


Sections = Sequence[Section | Callable[[], Section | None] | None]
"""What a page is made of, in its order. None is left out; what is made by another process is called for last."""


class Row(NamedTuple):
    """One row of a table, and how it looks."""

    cells: tuple[str, ...]
    look: str = ""


CHOSEN, AWAY = "chosen", "away"
"""Looks of a row: what was added, and what the reader should stop at."""


def before_and_after(added: bool) -> tuple[str, ...]:
    """Return the heads of what the models give: both, or the base model alone where nothing was added."""
    return ("before", "after") if added else ("base model",)


class Table(NamedTuple):
    """A table whose first column names its rows."""

    heads: tuple[str, ...]
    rows: tuple[Row, ...]
    caption: str = ""


PAGE = "page.html"


class Head(NamedTuple):
    """What stands above all sections."""

    name: str
    "of the data"
    kicker: str
    "what they are, in a few words"
    title: str


def write_page(head: Head, sections: Sections, out: Path) -> list[Path]:
    """Write report.html and NAME.png of every picture, and return their paths, the page's first."""
    rendered_sections: list[tuple[Section, Markup]] = []
    files: list[Path] = []
    for entry in reversed(sections):  # what another process makes for the first ones is waited for last
        section = entry if entry is None or isinstance(entry, Section) else entry()
        if section is None:
            continue
        inline = {name: _inline(name, picture) for name, picture in section.pictures.items()}
        rendered_sections.insert(0, (section, render(section.template, {**section.content, "pictures": inline})))
        files[:0] = [
            replace_file(out / file, image)
            for name, picture in section.pictures.items()
            for file, image in _files(name, picture)
        ]
    return [replace_file(out / "report.html", render(PAGE, {"head": head, "sections": rendered_sections})), *files]


def _files(name: str, picture: Picture) -> list[tuple[str, bytes]]:
    many = len(picture.panels) > 1
    return [(f"{name}-{at}.png" if many else f"{name}.png", png(panel)) for at, panel in enumerate(picture.panels, 1)]


def _inline(name: str, picture: Picture) -> dict[str, Any]:
    """Return a picture for the page: its panels side by side where there is room; the first says what all show."""
    panels = [
        Markup(svg(panel, f"{name}{at}", picture.alt if not at else f"{picture.alt} (panel {at + 1})"))
        for at, panel in enumerate(picture.panels)
    ]
    return {"panels": panels, "caption": picture.caption}


def mark_code(text: str) -> Markup:
    """Return a docstring's paragraph with what is in backticks as code."""
    parts = [escape(part) for part in text.split("`")]
    return Markup("").join(Markup(f"<code>{part}</code>") if at % 2 else part for at, part in enumerate(parts))


@lru_cache(maxsize=1)
def _pages() -> jinja2.Environment:
    loader = jinja2.PackageLoader("rover_pin.report", "")
    pages = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    pages.filters["marked"] = mark_code
    return pages


def render(template: str, content: Mapping[str, Any]) -> Markup:
    """Return a page, or a part of one, from a template of this room; whatever a name holds is shown as text."""
    return Markup(_pages().get_template(template).render(**content))
