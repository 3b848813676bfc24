"""Recognises the layout of a table in a text file: delimiter, decimal mark, header line, and a line of units below
it.
"""

import csv
import re
from collections import Counter
from typing import NamedTuple

from rover_pin.base.units import readings

DELIMITERS = (";", "\t", "|", ",", " ")
"""Delimiters that are tried on a text file. If two of them fit equally well, the earlier one of this tuple is taken."""
SAMPLED_LINES = 60
"""Number of non-empty lines at the beginning of a file from which the delimiter and the header are recognised. The text
above the header must be shorter, because otherwise these lines hold no numbers. More lines would take more time."""
MISSING = {"", "-", "--", "\u2013", "\u2014", "na", "n/a", "#n/a", "nan", "null", "none"}
"""Cells, in small letters, that mark a missing number."""
UNIT = r"[A-Za-z°%µμΩ][^\s,;]{0,7}(?:\s?m)?"
"""Pattern of a unit in a cell, after the number: up to eight characters, such as `kN/m^2`, and an `m` as in `N m`."""
NUMBERS = {
    ".": re.compile(rf"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?:\s*({UNIT}))?"),
    ",": re.compile(rf"([+-]?(?:\d+,?\d*|,\d+)(?:[eE][+-]?\d+)?)(?:\s*({UNIT}))?"),
}
"""Decimal mark -> the pattern of a number with this mark. A unit may follow the number."""
DATE = re.compile(r"(?:\d{4}-\d\d-\d\d|\d{1,2}[./-]\d{1,2}[./-]\d{4})[T ]+\d{1,2}:\d\d|\d{1,2}:\d\d:\d\d")
"""Pattern of a text that begins with a date and a time, or with a time of day."""
COMMENTS = ("#", "%", "//")
"""Marks at the beginning of a comment line."""


class Layout(NamedTuple):
    """The layout of a table in a text file: delimiter, decimal mark, position of the header, and width."""

    delimiter: str
    decimal: str
    "decimal mark: a point or a comma"
    header: int
    """index of the line with the column names; -1 if the file has no such line"""
    units: bool
    """whether the line after the column names holds the units of the columns"""
    width: int
    "number of cells in a line of numbers"

    @property
    def description(self) -> str:
        """The delimiter and the decimal mark in words, for a note to the user."""
        words = {";": "semicolons", "\t": "tabs", "|": "bars", ",": "commas", " ": "blanks"}
        decimal = ", decimal comma" if self.decimal == "," else ""
        return f"columns between {words[self.delimiter]}{decimal}"


def layout_of(lines: list[str]) -> Layout:
    """Return the layout of the table in the lines of a text file.

    Each delimiter is tried with each decimal mark, and the layout with the highest score is returned (see
    `_score_layout`). This layout gives the most numbers in lines of equal length. If no layout gives numbers, the first
    line that is not a comment counts as the header, and its most frequent delimiter is taken.
    """
    # The layout to return if no delimiter gives numbers.
    filled_lines = [index for index, line in enumerate(lines[: 10 * SAMPLED_LINES]) if line.strip()]
    sample = [lines[index] for index in filled_lines[:SAMPLED_LINES]]
    header = next((index for index in filled_lines if not lines[index].lstrip().startswith(COMMENTS)), -1)
    default_delimiter = max(",;\t|", key=lines[header].count) if header >= 0 else ","
    width = len(cells(lines[header], default_delimiter)) if header >= 0 else 0
    best, best_score = Layout(default_delimiter, ".", header, False, width), 0.0
    for delimiter in DELIMITERS:
        # A comma can be both the delimiter and the decimal mark only where quotes keep the two apart.
        for decimal in NUMBERS if delimiter != "," or any('"' in line for line in sample) else ".":
            score, layout = _score_layout(sample, filled_lines, delimiter, decimal)
            if score > best_score + 1e-9:
                best, best_score = layout, score
    return best


def _score_layout(sample: list[str], filled_lines: list[int], delimiter: str, decimal: str) -> tuple[float, Layout]:
    """Return the score of one delimiter with one decimal mark, and the table layout that belongs to them.

    The score is the mean number of numeric cells in a line, times the fraction of the lines after the header that have
    the usual number of cells. A wrong delimiter has a low score: it gives few numbers, or lines of many lengths.

    Parameters
    ----------
    sample : list of str
        Non-empty lines at the beginning of the file.
    filled_lines : list of int
        Index of each of these lines in the file.
    delimiter, decimal : str
        The delimiter and the decimal mark to score.
    """
    rows = [cells(line, delimiter) for line in sample]
    # For each row, the fraction of its filled cells that are numbers or dates.
    fractions = []
    for row in rows:
        filled = [cell for cell in row if cell.lower() not in MISSING]
        numeric = sum(bool(NUMBERS[decimal].fullmatch(cell) or DATE.match(cell)) for cell in filled)
        fractions.append(numeric / len(filled) if filled else 0.0)
    # The usual width of the rows that are mostly numbers; a row of one cell is a title or a remark.
    widths = Counter(len(row) for row, fraction in zip(rows, fractions, strict=True) if fraction > 0.5 and len(row) > 1)
    if not widths:
        return 0.0, Layout(delimiter, decimal, -1, False, 0)
    width, count = widths.most_common(1)[0]
    first = next(index for index, row in enumerate(rows) if len(row) == width and fractions[index] > 0.5)
    # The header is the last row of names above the first row of numbers. A row of units may be between the two, and
    # looks like names where its units are words.
    trailing_blank = not rows[first][-1]
    fit = [index for index in range(first) if len(fit_row(rows[index], width, trailing_blank)) == width]
    names = []
    for index in fit:
        # In a row of names most cells are filled, and none is a plain number or a mark for a missing number.
        filled = [cell for cell in rows[index] if cell]
        has_numbers = any(match and not match[2] for match in map(NUMBERS[decimal].fullmatch, filled))
        are_names = 2 * len(filled) > len(rows[index]) and not has_numbers and not MISSING & {*filled}
        if are_names and not (index - 1 in fit and _are_units(rows[index])):
            names.append(index)
    units = bool(names) and names[-1] + 1 in fit and _are_units(rows[names[-1] + 1])
    header = filled_lines[names[-1]] if names else -1
    # Many numeric cells in lines of equal length make a high score.
    numeric_cells = sum(fraction * len(row) for row, fraction in zip(rows, fractions, strict=True) if len(row) == width)
    score = numeric_cells / max(1, len(rows)) * (count / max(1, len(rows) - first))
    return score, Layout(delimiter, decimal, header, units, width)


def cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line of a table. Quotes and blanks around a cell, and a comment mark before it, are
    removed.

    Raises csv.Error: a cell in quotes is longer than the maximum of Python's csv reader.
    """
    # A per cent sign that a delimiter follows is the unit of the first cell, not a comment mark.
    is_percent = line.lstrip()[:1] == "%" and line.lstrip()[1:].lstrip().startswith(delimiter)
    if line.lstrip().startswith(COMMENTS) and not is_percent:
        line = line.lstrip("#% ").lstrip("/ ")
    # Several blanks count as one delimiter. Only a line with quotes needs the csv reader, which is slower.
    if delimiter == " ":
        parts = line.split()
    elif '"' in line:
        parts = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    else:
        parts = line.split(delimiter)
    return [cell.strip().strip('"').strip() for cell in parts]


def fit_row(row: list[str], width: int, names: bool = False) -> list[str]:
    """Return a row of cells, corrected to `width` cells if the row has one empty cell too many or lacks its last name.

    If the row has one cell more than `width` and the last cell is empty, the last cell is removed. If `names` is True
    (a row of column names) and the row has one cell less than `width`, an empty cell is added at the end. Any other row
    is returned unchanged.
    """
    if len(row) == width + 1 and not row[-1]:
        return row[:-1]
    return [*row, ""] if names and len(row) == width - 1 else row


def _are_units(row: list[str]) -> bool:
    """Return whether a row can hold the units of columns: most of its filled cells are units or texts in brackets."""
    filled = [cell for cell in row if cell not in MISSING]
    return 2 * sum(cell[0] in "[(" or bool(readings(cell)) for cell in filled) > len(filled)
