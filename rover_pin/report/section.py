"""What a page is made of: sections, each a class with a title, a template and what it shows, or nothing at all."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from matplotlib.figure import Figure


class Picture(NamedTuple):
    """One or several panels that are read together, and what they show in words."""

    panels: tuple[Figure, ...]
    alt: str
    "the result, for who does not see it"
    caption: str = ""


class Section(ABC):
    """One section of a report; abstract or final. A section without content is not in the page, nor in its contents."""

    title: ClassVar[str]
    template: ClassVar[str]
    "name of its file in this room"

    @property
    def html_id(self) -> str:
        """Where the contents point."""
        return "".join(letter if letter.isalnum() else "-" for letter in self.title.lower()).strip("-")

    @abstractmethod
    def content(self) -> Mapping[str, Any] | None:
        """Return what the template shows, or None where there is nothing to say."""

    def pictures(self) -> Mapping[str, Picture]:
        """Return the section's pictures by name; each becomes NAME.png too."""
        return {}


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
