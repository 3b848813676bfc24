"""Figures without a window, and files that are written whole or not at all."""

import io
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from rover_pin.base.files.whole_file import replace_file

MARGINS = (0.75, 0.15, 0.5, 0.5)
"""Left, right, bottom and top of the axes [in]: a layout that measures every text costs as much as the drawing."""

LONGEST = 110
"""Letters of a title's line that fit above a sheet's axes."""


def in_lines(parts: Sequence[str]) -> str:
    """Return the parts of a title side by side, in as many lines as they need to be read whole."""
    lines = [""]
    for part in parts:
        longer = f"{lines[-1]}   {part}".strip()
        if len(longer) > LONGEST >= len(part):
            lines.append(part)
        else:
            lines[-1:] = textwrap.wrap(longer, LONGEST)
    return "\n".join(lines)


def save(figure: Figure, file: Path) -> Path:
    """Write a figure as PNG, atomically; return its path."""
    content = io.BytesIO()
    figure.savefig(content, dpi=130, format="png")
    return replace_file(file, content.getvalue())


def new_figure(
    rows: int, columns: int = 1, size: tuple[float, float] = (8.0, 6.0), **options: Any
) -> tuple[Figure, Any]:
    """Return a figure and its axes, laid out around their texts, without any window."""
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def sheet(rows: int, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:
    """Return a figure of this size [in] and its axes one above the other, within `MARGINS`."""
    (left, right, bottom, top), (width, height) = MARGINS, size
    figure = Figure(figsize=size)
    figure.subplots_adjust(left / width, bottom / height, 1.0 - right / width, 1.0 - top / height, hspace=0.08)
    return figure, figure.subplots(rows, **options)


def write_csv(frame: Any, file: Path) -> Path:
    """Write a table as CSV, atomically; return its path."""
    return replace_file(file, frame.to_csv(index=False))
