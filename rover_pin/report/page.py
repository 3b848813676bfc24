"""Writer of a report: one HTML page that needs no other file, and its figures as PNG files next to the page."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from rover_pin.base.encode import printable_lines
from rover_pin.base.files.whole_file import replace_file
from rover_pin.report.svg import png, svg


class Picture(NamedTuple):
    """One or several figures (panels) that belong together, with a text that states their content."""

    panels: tuple[Figure, ...]
    alt: str
    """content of the panels in words, for a screen reader"""
    caption: str = ""


class Section(NamedTuple):
    """One section of a page: its title, a template, the values that fill the template, and pictures."""

    title: str
    template: str
    "path of the Jinja template in rover_pin/report"
    content: Mapping[str, Any]
    """names of the template's variables -> their values"""
    pictures: Mapping[str, Picture] = {}
    """name of a picture -> the picture; each picture also becomes a file NAME.png"""

    @property
    def html_id(self) -> str:
        """The HTML id of the section, for the links of the table of contents."""
        return "".join(letter if letter.isalnum() else "-" for letter in self.title.lower()).strip("-")


Sections = Sequence[Section | Callable[[], Section | None] | None]
"""Type of the sections of a page, in their order. None means that the page has no such section. A function returns the
section, or None, when it is called; this is for a section that another process is still making."""


class TableRow(NamedTuple):
    """One row of a table: the texts of its cells, and its look, which is CHOSEN, AWAY or an empty text."""

    cells: tuple[str, ...]
    look: str = ""


CHOSEN, AWAY = "chosen", "away"
"""Looks of a table row. CHOSEN marks an added effect, and AWAY marks a row that needs the reader's attention."""


def before_and_after(added: bool) -> tuple[str, ...]:
    """Return the headings of the columns for the base model and for the model with added effects.

    They are "before" and "after", or only "base model" if no effect was added.
    """
    return ("before", "after") if added else ("base model",)


class ReportTable(NamedTuple):
    """A table of texts: the headings of its columns, its rows, and a caption. The first cell of a row is the row's
    name.
    """

    heads: tuple[str, ...]
    rows: tuple[TableRow, ...]
    caption: str = ""


class Head(NamedTuple):
    """The texts at the top of a page: name of the data, amount of data, and title."""

    name: str
    "name of the data set"
    kicker: str
    """line above the headline that states the amount of data in a few words"""
    title: str


def write_page(head: Head, sections: Sections, out: Path) -> list[Path]:
    """Write report.html and a PNG file of each panel into the folder `out`.

    Returns
    -------
    list of Path
        The path of the page, then the paths of the PNG files in the order of the sections.
    """
    rendered_sections: list[tuple[Section, Markup]] = []
    files: list[Path] = []
    # The last sections are rendered first, because other processes may still be making the first sections.
    for entry in reversed(sections):
        section = entry if entry is None or isinstance(entry, Section) else entry()
        if section is None:
            continue
        # SVG first: it fixes the layout of a figure, so that the PNG file looks like the page.
        inline = {}
        for name, picture in section.pictures.items():
            panels = [
                Markup(svg(panel, f"{name}{index}", f"{picture.alt} (panel {index + 1})" if index else picture.alt))
                for index, panel in enumerate(picture.panels)
            ]
            inline[name] = {"panels": panels, "caption": picture.caption}
        rendered_sections.insert(0, (section, render(section.template, {**section.content, "pictures": inline})))
        # The PNG file of a picture is NAME.png; several panels have the files NAME-1.png, NAME-2.png and so on.
        pngs = []
        for name, picture in section.pictures.items():
            for number, panel in enumerate(picture.panels, 1):
                file = f"{name}-{number}.png" if len(picture.panels) > 1 else f"{name}.png"
                pngs.append(replace_file(out / file, png(panel)))
        files = pngs + files
    return [
        replace_file(out / "report.html", render("page.html", {"head": head, "sections": rendered_sections})),
        *files,
    ]


def mark_code(text: str) -> Markup:
    """Return a paragraph of a docstring as HTML, with the texts between backticks marked as code."""
    # Every second part was between backticks in the text.
    parts = [escape(part) for part in text.split("`")]
    return Markup("").join(Markup(f"<code>{part}</code>") if at % 2 else part for at, part in enumerate(parts))


@lru_cache(maxsize=1)
def _pages() -> jinja2.Environment:
    """Return the Jinja environment that finds templates in rover_pin/report and escapes every value for HTML."""
    loader = jinja2.PackageLoader("rover_pin.report", "")
    # Names in data may hold HTML; autoescape and _shown keep them plain text.
    pages = jinja2.Environment(loader=loader, autoescape=True, finalize=_shown, trim_blocks=True, lstrip_blocks=True)
    pages.filters["marked"] = mark_code
    return pages


def _shown(value: Any) -> Any:
    """Return a template's value with control characters escaped. Jinja escapes the special characters of HTML
    afterwards.
    """
    return printable_lines(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def render(template: str, content: Mapping[str, Any]) -> Markup:
    """Return a page or a section as HTML, made from a template in rover_pin/report and the values in `content`.

    All values are escaped, so that no value is read as HTML.
    """
    return Markup(_pages().get_template(template).render(**content))
