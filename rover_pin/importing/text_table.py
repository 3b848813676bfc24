"""Tables in text files as programs write them: any delimiter, decimal comma, byte-order mark, preamble, units row."""

from __future__ import annotations

import io
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from rover_pin.bounded import MOST_TABLE, content
from rover_pin.errors import DataError

DELIMITERS = (";", "\t", "|", ",")
LOOKED = 60
"""Lines by which delimiter and header are told."""
ENCODINGS = (
    (b"\xef\xbb\xbf", "utf-8-sig"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)
POINT = re.compile(r"[+-]?\d*\.?\d+(?:[eE][+-]?\d+)?")
COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?|[+-]?\d+")
DATE = re.compile(r"(?:\d{4}-\d\d-\d\d|\d{1,2}[./-]\d{1,2}[./-]\d{4})[T ]+\d{1,2}:\d\d|\d{1,2}:\d\d:\d\d")
EMPTY = ("", "nan", "NaN", "NA", "null", "None", "inf", "-inf", "-")
UNIT = re.compile(r"[\[(]?\s*[\w/°%*^² .µ-]{0,12}\s*[\])]?")


class Layout(NamedTuple):
    """How a text file is laid out."""

    delimiter: str
    decimal: str
    header: int
    "line of the names, counted from 0; -1 where there is none"
    units: bool
    "whether a line of units follows"

    @property
    def said(self) -> str:
        """The layout in words, where it is not the usual one."""
        words = {";": "semicolons", "\t": "tabs", "|": "bars", ",": "commas", " ": "blanks"}
        decimal = ", decimal comma" if self.decimal == "," else ""
        return f"columns between {words[self.delimiter]}{decimal}"


def text_table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return the table of a text file, and how it was read.

    Raises
    ------
    DataError
        The file cannot be read, or no lines of numbers in columns are found in it.
    """
    try:
        raw = content(path, MOST_TABLE)
    except OSError as error:
        raise DataError(f"{path}: the file cannot be read: {error.strerror or error}.") from error
    text, encoding = _decoded(raw)
    lines = text.splitlines()
    layout = layout_of(lines)
    if layout is None:
        raise DataError(
            f"{path}: no lines of numbers in columns are found: give a table as CSV, Parquet, .mat, or a ROS bag."
        )
    notes = (layout.said, *([f"text in {encoding}"] if encoding not in ("utf-8", "utf-8-sig") else []))
    return _parsed(path, lines, layout), notes


def _decoded(raw: bytes) -> tuple[str, str]:
    for mark, encoding in ENCODINGS:
        if raw.startswith(mark):
            return raw.decode(encoding, errors="replace"), encoding
    try:
        return raw.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace"), "cp1252"


def layout_of(lines: list[str]) -> Layout | None:
    """Return how lines are laid out: the layout under which most cells of the last of them are numbers."""
    kept = [at for at, line in enumerate(lines[: 10 * LOOKED]) if line.strip()]
    sample = [lines[at] for at in kept[:LOOKED]]
    best, most = None, 0.0
    for delimiter in (*DELIMITERS, " "):
        for decimal in (".", ",") if delimiter != "," else (".",):
            score, layout = _scored(sample, kept, delimiter, decimal)
            if score > most + 1e-9:
                best, most = layout, score
    return best


def _scored(sample: list[str], kept: list[int], delimiter: str, decimal: str) -> tuple[float, Layout]:
    """Return how many cells a line are numbers under a layout, and where its header is."""
    rows = [cells(line, delimiter) for line in sample]
    shares = [_numeric(row, decimal) for row in rows]
    widths = Counter(len(row) for row, share in zip(rows, shares, strict=True) if share > 0.5 and len(row) > 1)
    if not widths:
        return 0.0, Layout(delimiter, decimal, -1, False)
    width, count = widths.most_common(1)[0]
    first = next(at for at, row in enumerate(rows) if len(row) == width and shares[at] > 0.5)
    names = [at for at in range(first) if len(rows[at]) == width]
    units = len(names) > 1 and names[-2] == names[-1] - 1 and _are_units(rows[names[-1]])
    header = kept[names[-2] if units else names[-1]] if names else -1
    whole = sum(share * len(row) for row, share in zip(rows, shares, strict=True) if len(row) == width)
    return whole / max(1, len(rows)) * (count / max(1, len(rows) - first)), Layout(delimiter, decimal, header, units)


def cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, quotes, blanks and comment marks around them taken off."""
    line = line.lstrip("#% ").lstrip("/ ") if line.lstrip().startswith(("#", "%", "//")) else line
    found = line.split() if delimiter == " " else line.split(delimiter)
    found = [cell.strip().strip('"').strip() for cell in found]
    return found[:-1] if len(found) > 2 and found[-1] == "" and delimiter != "," else found


def _numeric(row: list[str], decimal: str) -> float:
    form = POINT if decimal == "." else COMMA
    told = [cell for cell in row if cell not in EMPTY]
    return sum(bool(form.fullmatch(cell) or DATE.match(cell)) for cell in told) / len(told) if told else 0.0


def _are_units(row: list[str]) -> bool:
    told = [cell for cell in row if cell]
    short = all(UNIT.fullmatch(cell) for cell in told)
    return bool(told) and short and sum(cell[0] in "[(" or len(cell) <= 5 for cell in told) > 0.7 * len(told)


def _parsed(path: Path, lines: list[str], layout: Layout) -> pd.DataFrame:
    names = _names(lines, layout)
    begin = layout.header + 1 + layout.units if layout.header >= 0 else 0
    whole = [line for line in lines[begin:] if line.strip() and not line.lstrip().startswith(("#", "%", "//"))]
    rows = [row for row in (cells(line, layout.delimiter) for line in whole) if len(row) == len(names)]
    text = "\n".join("\t".join(cell.replace("\t", " ") for cell in row) for row in rows)
    try:
        made: pd.DataFrame = pd.read_csv(
            io.StringIO(text),
            sep="\t",
            decimal=layout.decimal,
            header=None,
            names=names,
            quoting=3,
            skip_blank_lines=True,
        )
    except (ValueError, pd.errors.ParserError) as error:
        raise DataError(f"{path}: the table cannot be read: {str(error).splitlines()[0]}.") from error
    return made


def _names(lines: list[str], layout: Layout) -> list[str]:
    if layout.header < 0:
        first = next(line for line in lines if len(cells(line, layout.delimiter)) > 1)
        return [f"column {at}" for at in range(1, 1 + len(cells(first, layout.delimiter)))]
    names = [name or f"column {at}" for at, name in enumerate(_row(lines, layout, 0), 1)]
    if layout.units:
        units = [unit.strip("[]() ") for unit in _row(lines, layout, 1)]
        names = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
    count: Counter[str] = Counter()
    for at, name in enumerate(names):
        count[name] += 1
        names[at] = name if count[name] == 1 else f"{name} ({count[name]})"
    return names


def _row(lines: list[str], layout: Layout, further: int) -> list[str]:
    return cells(lines[layout.header + further], layout.delimiter)
