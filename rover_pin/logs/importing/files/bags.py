"""All numbers in a ROS bag as one table: every topic's fields, on one clock."""

import csv
import dataclasses
import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import MOST_TABLE, content
from rover_pin.base.files.table import decode
from rover_pin.base.files.table_layout import LOOKED, MISSING, cells
from rover_pin.logs.one_clock import FEWEST, Series, on_one_clock
from rover_pin.logs.ros_bag import field_names, nanoseconds, open_bag

LONGEST_ARRAY = 16
"""Arrays with more entries, as images, scans and covariances, are left out."""
APART = 3600 * 10**9
"""Stamps that are off the times of receipt by more [ns] are of another clock."""


def bag_table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return every number of a bag as columns `/topic.field`, interpolated on even steps of `t_s`, and what was done.

    Raises DataError: it is no bag, or no topic in it has numbers.
    Raises MissingExtraError: the extra `ros` is not installed.
    """
    with open_bag(path) as bag:
        series, skipped, stale = _read(bag)
    if not series:
        raise DataError(f"{path}: no topic of the bag has numbers in {FEWEST} messages or more.")
    table, period = on_one_clock(path, series)
    omissions = [f"topics of unknown type are left out: {', '.join(skipped)}"] if skipped else []
    if stale:
        omissions.append(
            f"stamps stand still or are of another clock, so times of receipt are taken: {', '.join(stale)}"
        )
    return table, (f"{len(series)} fields of the bag, interpolated every {period:g} s", *omissions)


def _read(bag: Any) -> tuple[Series, list[str], list[str]]:
    """Return the fields, the topics that cannot be read, and those whose stamps are no times."""
    samples_of: dict[str, list[tuple[int, int, float]]] = {}
    skipped: set[str] = set()
    for connection, received, raw in bag.messages():
        if connection.topic in skipped:
            continue
        try:
            message = bag.deserialize(raw, connection.msgtype)
        except Exception:
            skipped.add(connection.topic)
            continue
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        at = received if stamp is None else nanoseconds(stamp)
        for field, value in _leaves(message, ""):
            samples_of.setdefault(f"{connection.topic}{field}", []).append((at, received, value))
    series: Series = {}
    stale: dict[str, None] = {}
    for field, samples in ((field, samples) for field, samples in samples_of.items() if len(samples) >= FEWEST):
        stamps, receipts = (np.array([sample[at] for sample in samples]) for at in (0, 1))
        if np.mean(np.diff(stamps) > 0) < 0.5 or abs(np.median(stamps - receipts)) > APART:
            stale[field.split(".")[0]] = None
            stamps = receipts
        series[field] = (stamps, np.array([sample[2] for sample in samples]))
    return series, sorted(skipped), list(stale)


def _leaves(value: Any, path: str) -> Iterator[tuple[str, float]]:
    """Yield every number in a message with its path; entries of an array by the names beside it, else by place."""
    if isinstance(value, (bool, int, float, np.number)):
        yield path, float(value)
    elif dataclasses.is_dataclass(value):
        names = getattr(value, "name", None)
        for field in field_names(value):
            if field not in ("header", "name"):
                yield from _member(getattr(value, field), f"{path}.{field}", names)


def _member(value: Any, path: str, names: Any) -> Iterator[tuple[str, float]]:
    if isinstance(value, (str, bytes)) or not hasattr(value, "__len__"):
        yield from _leaves(value, path)
    elif len(value) <= LONGEST_ARRAY:
        labels = list(names) if isinstance(names, list) and len(names) == len(value) else range(len(value))
        for label, element in zip(labels, value, strict=True):
            yield from _leaves(element, f"{path}[{label}]")


DELIMITERS = ";\t|,"
HEAD = 1 << 16
"""Bytes from which records are recognised."""
WORD = re.compile(r"\$?[^\W\d][\w ./-]*(?:\[[^\]]*\])?")
"""A name, perhaps with its unit."""


def delimiter_of_records(path: Path) -> str:
    """Return what parts the cells of a text of records; empty where a file is none."""
    try:
        head = decode(content(path, MOST_TABLE, HEAD))[0].splitlines()[:LOOKED]
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
        lines = decode(content(path, MOST_TABLE))[0].splitlines()
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
