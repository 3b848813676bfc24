"""What all reports share: colours, figures as PNG files and inline, and a page that needs nothing else."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jinja2
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rover_pin.columns import replace_file
from rover_pin.discrepancy.answer import Answer
from rover_pin.estimation.wording import shown

BEFORE, AFTER, GREY = "#b3541e", "#1f6f8b", "#8a8a8a"
"""Colours of the model before and after, and of what is neither; the first two differ for the colour-blind too."""
DPI = 130

HEADLINES = {
    Answer.NAMED: "The model lacks {names}",
    Answer.SET: "The model lacks one of {alike}",
    Answer.LIKE: "Something like {names} is missing",
    Answer.INADEQUATE: "The base model does not describe these data",
    Answer.NONE_NEEDED: "No effect needed",
    Answer.NONE_FITS: "None of the known effects fits",
    Answer.CANNOT_TELL: "These data cannot tell",
}
"""A verdict in a line."""


def png(figure: Figure) -> bytes:
    """Return a figure as a PNG file."""
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def write_page(figures: Mapping[str, Figure], page: Callable[[dict[str, str]], str], out: Path) -> list[Path]:
    """Write report.html and NAME.png of each figure; `page` is given the images as data URIs by name."""
    images = {name: png(figure) for name, figure in figures.items()}
    files = [replace_file(out / f"{name}.png", image) for name, image in images.items()]
    inline = {name: "data:image/png;base64," + base64.b64encode(image).decode() for name, image in images.items()}
    return [replace_file(out / "report.html", page(inline)), *files]


def rendered(template: str, content: Mapping[str, Any]) -> str:
    """Return a page from a template of this folder; whatever a name holds is shown as text."""
    loader = jinja2.PackageLoader("rover_pin.report", "")
    pages = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    pages.filters["shown"] = shown
    return pages.get_template(template).render(**content)
