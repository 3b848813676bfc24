"""How a text file holds a table: which delimiter and decimal mark, where its header is, whether units follow it."""

import csv
import re
from collections import Counter
from typing import NamedTuple

from rover_pin.base.units import readings

DELIMITERS = (";", "\t", "|", ",", " ")
LOOKED = 60
"""Lines from which delimiter and header are recognised."""
MISSING = {"", "-", "--", "\u2013", "\u2014", "na", "n/a", "#n/a", "nan", "null", "none"}
"""Cells, in small letters, that stand for a missing one."""
UNIT = r"[A-Za-z°%µμΩ][^\s,;]{0,7}(?:\s?m)?"
NUMBERS = {
    ".": re.compile(rf"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?:\s*({UNIT}))?"),
    ",": re.compile(rf"([+-]?(?:\d+,?\d*|,\d+)(?:[eE][+-]?\d+)?)(?:\s*({UNIT}))?"),
}
"""A number under a decimal mark, perhaps with its unit."""
DATE = re.compile(r"(?:\d{4}-\d\d-\d\d|\d{1,2}[./-]\d{1,2}[./-]\d{4})[T ]+\d{1,2}:\d\d|\d{1,2}:\d\d:\d\d")
COMMENTS = ("#", "%", "//")


class Layout(NamedTuple):
    """How a text file is laid out."""

    delimiter: str
    decimal: str
    header: int
    "line of the names, counted from 0; -1 where there is none"
    units: bool
    "whether a line of units follows"
    width: int
    "how many cells a line of numbers has"

    @property
    def description(self) -> str:
        """The layout in words."""
        words = {";": "semicolons", "\t": "tabs", "|": "bars", ",": "commas", " ": "blanks"}
        decimal = ", decimal comma" if self.decimal == "," else ""
        return f"columns between {words[self.delimiter]}{decimal}"


def layout_of(lines: list[str]) -> Layout:
    """Return how lines are laid out: the layout under which most cells of the last of them are numbers.

    Where hardly any is a number, the first line that is no comment has the names, and tells what parts them.
    """
    line_numbers = [at for at, line in enumerate(lines[: 10 * LOOKED]) if line.strip()]
    sample = [lines[at] for at in line_numbers[:LOOKED]]
    named = next((at for at in line_numbers if not lines[at].lstrip().startswith(COMMENTS)), -1)
    default_delimiter = max(",;\t|", key=lines[named].count) if named >= 0 else ","
    best, most = (
        Layout(default_delimiter, ".", named, False, len(cells(lines[named], default_delimiter)) if named >= 0 else 0),
        0.0,
    )
    for delimiter in DELIMITERS:
        for decimal in NUMBERS if delimiter != "," else ".":
            score, layout = _score_layout(sample, line_numbers, delimiter, decimal)
            if score > most + 1e-9:
                best, most = layout, score
    return best


def _score_layout(sample: list[str], line_numbers: list[int], delimiter: str, decimal: str) -> tuple[float, Layout]:
    """Return how many cells a line are numbers under a layout, and where its header is."""
    rows = [cells(line, delimiter) for line in sample]
    shares = [_numeric(row, decimal) for row in rows]
    widths = Counter(len(row) for row, share in zip(rows, shares, strict=True) if share > 0.5 and len(row) > 1)
    if not widths:
        return 0.0, Layout(delimiter, decimal, -1, False, 0)
    width, count = widths.most_common(1)[0]
    first = next(at for at, row in enumerate(rows) if len(row) == width and shares[at] > 0.5)
    trailing_blank = not rows[first][-1]
    fit = [at for at in range(first) if len(fit_row(rows[at], width, trailing_blank)) == width]
    names = [at for at in fit if _are_names(rows[at], decimal) and not (at - 1 in fit and _are_units(rows[at]))]
    units = bool(names) and names[-1] + 1 in fit and _are_units(rows[names[-1] + 1])
    header = line_numbers[names[-1]] if names else -1
    numeric_cells = sum(share * len(row) for row, share in zip(rows, shares, strict=True) if len(row) == width)
    return numeric_cells / max(1, len(rows)) * (count / max(1, len(rows) - first)), Layout(
        delimiter, decimal, header, units, width
    )


def cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, quotes, blanks and comment marks around them taken off.

    Raises csv.Error: a cell longer than the reader of quotes takes.
    """
    line = line.lstrip("#% ").lstrip("/ ") if line.lstrip().startswith(COMMENTS) else line
    if delimiter == " ":
        parts = line.split()
    elif '"' in line:
        parts = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    else:
        parts = line.split(delimiter)
    return [cell.strip().strip('"').strip() for cell in parts]


def fit_row(row: list[str], width: int, names: bool = False) -> list[str]:
    """Return a row without a delimiter too many at its end; one of `names` also with one too few."""
    if len(row) == width + 1 and not row[-1]:
        return row[:-1]
    return [*row, ""] if names and len(row) == width - 1 else row


def _numeric(row: list[str], decimal: str) -> float:
    """Return the share of a row's cells that are numbers or dates, of those that hold something."""
    full = [cell for cell in row if cell.lower() not in MISSING]
    return sum(bool(NUMBERS[decimal].fullmatch(cell) or DATE.match(cell)) for cell in full) / len(full) if full else 0.0


def _are_names(row: list[str], decimal: str) -> bool:
    """Return whether a row names columns: most cells hold something, none a number or a mark for a missing one."""
    full = [cell for cell in row if cell]
    numbers = (NUMBERS[decimal].fullmatch(cell) for cell in full)
    return 2 * len(full) > len(row) and not any(match and not match[2] for match in numbers) and not MISSING & {*full}


def _are_units(row: list[str]) -> bool:
    """Return whether a row has the units of columns: most cells that are not missing are a unit or in brackets."""
    filled = [cell for cell in row if cell not in MISSING]
    return 2 * sum(cell[0] in "[(" or bool(readings(cell)) for cell in filled) > len(filled)
