"""Texts in which every line begins with what it is of, as `GPS;2022:06:01 13:42:57.86;51.98;5.66`: one table of them.

A line is a name, a time and cells; lines of a name have the same cells, those of another name others. A cell that holds
the same word in all lines of a name is called after the cells behind it.
"""

import csv
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import MOST_TABLE, content
from rover_pin.base.files.table import decoded
from rover_pin.base.files.table_layout import LOOKED, MISSING, cells
from rover_pin.logs.one_clock import FEWEST, Series, on_one_clock

DELIMITERS = ";\t|,"
HEAD = 1 << 16
"""Bytes from which records are recognised."""
WORD = re.compile(r"\$?[^\W\d][\w ./-]*(?:\[[^\]]*\])?")
"""A name, perhaps with its unit."""


def delimiter_of_records(path: Path) -> str:
    """Return what parts the cells of a text of records; empty where a file is none."""
    try:
        head = decoded(content(path, MOST_TABLE, HEAD))[0].splitlines()[:LOOKED]
    except OSError:
        return ""
    return next((mark for mark in DELIMITERS if _are_records(head, mark)), "")


def _are_records(lines: list[str], delimiter: str) -> bool:
    """Whether names begin all lines, of two widths at least, and each name has one of them."""
    try:
        rows = [cells(line, delimiter) for line in lines[:-1] if line.strip()]
    except csv.Error:
        return False
    if not rows or any(not _is_word(row[0]) or len(row) < 3 or _is_word(row[1]) for row in rows):
        return False
    widths = {(row[0], len(row)) for row in rows}
    return len(widths) == len({name for name, _ in widths}) and len({width for _, width in widths}) > 1


def _is_word(cell: str) -> bool:
    return cell.lower() not in MISSING and bool(WORD.fullmatch(cell))


Numbers = Callable[[pd.DataFrame], tuple[pd.DataFrame, list[str]]]


def record_table(path: Path, delimiter: str, numbers_of: Numbers) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return the numbers of all records as columns `NAME_word_1`, interpolated on even steps of `t_s`; and notes.

    `numbers_of` tells which columns of a table are numbers, dates as nanoseconds.

    Raises DataError: it cannot be read, or its records have no dates.
    """
    try:
        lines = decoded(content(path, MOST_TABLE))[0].splitlines()
        rows = [cells(line, delimiter) for line in lines if line.strip()]
    except (OSError, csv.Error) as error:
        raise DataError(f"{path}: the file cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    counts = Counter((row[0], len(row)) for row in rows)
    kinds = {name: width for (name, width), count in reversed(counts.most_common()) if count >= FEWEST}
    series: Series = {}
    for name, width in kinds.items():
        table = pd.DataFrame([row[1:] for row in rows if (row[0], len(row)) == (name, width)], dtype=object)
        table.columns = _names(name.lstrip("$"), table)
        numbers, _ = numbers_of(table)
        if "t" not in numbers or numbers["t"].dtype != np.int64 or table["t"].str.isdigit().any():
            raise DataError(
                f"{path}: its lines are records ({', '.join(sorted(kinds))}), and what follows '{name}' is no date "
                f"({table['t'].iloc[0]!r}): write a table a record, or dates as 2022-06-01 13:42:57.86."
            )
        at = numbers.pop("t").to_numpy()
        series |= {str(column): (at, numbers[column].to_numpy(dtype=float)) for column in numbers}
    table, period = on_one_clock(path, series)
    others = len(rows) - sum(counts[kind] for kind in kinds.items())
    dropped = (f"{others} lines that are of no record are left out",) if others else ()
    of_each = ", ".join(f"{counts[name, width]} of {name}" for name, width in sorted(kinds.items()))
    return table, (f"records of several kinds ({of_each}), interpolated every {period:g} s", *dropped)


def _names(kind: str, table: pd.DataFrame) -> list[str]:
    """Return the columns' names: the word that all lines have in a cell before them, numbered where several follow."""
    stems, stem = [], kind
    for at in table.columns[1:]:
        word = table[at].iloc[0]
        is_word = _is_word(word) and bool((table[at] == word).all())
        stem = f"{kind}_{word}" if is_word else stem
        stems.append(f"{stem} word" if is_word else stem)
    several, count_of = Counter(stems), Counter[str]()
    names = ["t"]
    for stem in stems:
        count_of[stem] += 1
        names.append(f"{stem}_{count_of[stem]}" if several[stem] > 1 else stem)
    return names
