"""Make figures without opening a window, and write figures and tables to files in one step."""

import io
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from rover_pin.base.encode import missing_glyphs_allowed
from rover_pin.base.files.whole_file import replace_file

MARGINS = (0.75, 0.15, 0.5, 0.5)
"""Margins around the axes of a sheet: left, right, bottom and top [in]. They are fixed, because a layout that measures
every text would double the time of the drawing."""

MAX_TITLE = 110
"""Maximum number of characters in a line of a title above the axes of a sheet. A longer title continues on the next
line, because it would extend beyond a figure of the usual width."""


def in_lines(parts: Sequence[str], longest: int = MAX_TITLE) -> str:
    """Return the parts of a title as lines of at most `longest` characters.

    A line break is between two parts. Only a part that is longer than a line is split.
    """
    lines = [""]
    for part in parts:
        longer = f"{lines[-1]}   {part}".strip()
        # A part that does not fit on the line begins a new line; only a longer part is wrapped inside.
        if len(longer) > longest >= len(part):
            lines.append(part)
        else:
            lines[-1:] = textwrap.wrap(longer, longest)
    return "\n".join(lines)


def save(figure: Figure, file: Path) -> Path:
    """Write a figure to a PNG file in one step, so that a stop never leaves half a file, and return the path."""
    # The picture is made in memory, so that the file can be replaced in one step.
    content = io.BytesIO()
    with missing_glyphs_allowed():
        figure.savefig(content, dpi=130, format="png")
    return replace_file(file, content.getvalue())


def new_figure(
    rows: int, columns: int = 1, size: tuple[float, float] = (8.0, 6.0), **options: Any
) -> tuple[Figure, Any]:
    """Return a figure of this size [in] and its axes; matplotlib computes their layout from the texts."""
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def sheet(rows: int, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:
    """Return a figure of this size [in] and its axes, which are one above the other within the fixed MARGINS."""
    (left, right, bottom, top), (width, height) = MARGINS, size
    figure = Figure(figsize=size)
    figure.subplots_adjust(left / width, bottom / height, 1.0 - right / width, 1.0 - top / height, hspace=0.08)
    return figure, figure.subplots(rows, **options)


def write_csv(frame: Any, file: Path) -> Path:
    """Write a pandas table to a CSV file in one step, so that a stop never leaves half a file, and return the path."""
    return replace_file(file, frame.to_csv(index=False))
