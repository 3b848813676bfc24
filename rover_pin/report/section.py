"""What a page is made of: sections, each with a title, a template and what it shows, or None."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from matplotlib.figure import Figure


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
