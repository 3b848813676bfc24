"""Read files of messages (ROS bags, MCAP, lines of JSON, text records) as one table of numbers on one clock.

Each topic or record type has its own times, so all numbers are interpolated on a common clock with even time steps.
"""

import csv
import dataclasses
import json
import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import BYTES_PER_NUMBER, MAX_NUMBERS_BYTES, MAX_TABLE_BYTES, Allowance, content
from rover_pin.base.files.column_names import COMMAND, DUTY, word
from rover_pin.base.files.table import decode
from rover_pin.base.files.table_layout import MISSING, SAMPLED_LINES, cells
from rover_pin.importing.files.mcap import is_other_mcap, mcap_messages
from rover_pin.logs.resampling import MIN_MESSAGES, Series, on_one_clock
from rover_pin.logs.ros_bag import field_names, nanoseconds, open_bag

MAX_ARRAY = 16
"""Maximum number of entries of an array that becomes columns. Longer arrays, such as images and covariances, are
skipped."""
MAX_STAMP_OFFSET = 3600 * 10**9
"""Maximum median difference between the time stamps of a topic and its times of receipt [ns]. If the difference is
larger, the stamps belong to another clock, and the times of receipt are used."""


def bag_table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return every number in a ROS bag or MCAP file as a column `/topic.field` next to the time `t_s`, and notes for
    the user.

    Raises DataError: the file is not a bag, no encoding of its messages can be read, or no topic has enough numbers.
    Raises MissingExtraError: the extra `ros` is not installed.
    """
    if is_other_mcap(path):
        return _table_of(path, mcap_messages(path))
    with open_bag(path) as bag:
        return _table_of(path, _decoded(bag))


def json_lines_table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return every number in lines of JSON as a column `/topic.field` next to the time `t_s`, and notes for the user.

    Each line is a message with the keys topic, log_time, publish_time and data, as `mcap cat --json` prints it.

    Raises DataError: the file cannot be read, or a line is not a message with these keys.
    """
    try:
        lines = decode(content(path, MAX_TABLE_BYTES))[0].splitlines()
    except OSError as error:
        raise DataError(f"{path}: the file cannot be read: {error.strerror or error}.") from error
    messages: list[Messages] = []
    for line in filter(str.strip, lines):
        try:
            entry = json.loads(line)
            logged = _json_time(entry["log_time"])
            published = _json_time(entry.get("publish_time", entry["log_time"]))
            # A recorder without a publication time writes 0 for it.
            messages.append((str(entry["topic"]), published or None, logged, entry["data"]))
        except (ValueError, KeyError, TypeError) as error:
            raise DataError(
                f"{path}, line {len(messages) + 1}: this line is not a message with the keys topic, log_time and data, "
                "as `mcap cat --json` prints it. Give such lines, or a CSV with one line of column names and one line "
                "for each row."
            ) from error
    return _table_of(path, iter(messages))


def is_json_lines(path: Path) -> bool:
    """Return whether a file begins with an object of JSON, that is, with a brace."""
    try:
        return content(path, MAX_TABLE_BYTES, HEAD).lstrip()[:1] == b"{"
    except OSError:
        return False


def _json_time(value: Any) -> int:
    """Return a time [ns] from JSON, which states it as whole nanoseconds or as seconds with a decimal point."""
    text = str(value)
    if "." not in text:
        return int(text)
    seconds, _, fraction = text.partition(".")
    return int(seconds) * 1_000_000_000 + int(fraction[:9].ljust(9, "0"))


Messages = tuple[str, int | None, int, Any]
"""One message: its topic, its time of publication [ns] or None, its time of receipt [ns], and its content. The content
is None if it cannot be decoded."""


def _decoded(bag: Any) -> Iterator[Messages]:
    """Yield the messages of a bag that rosbags has opened. The content of a message is None if its type is unknown."""
    for connection, received, raw in bag.messages():
        try:
            message = bag.deserialize(raw, connection.msgtype)
        except Exception:
            message = None
        yield connection.topic, None, received, message


def _table_of(path: Path, messages: Iterator[Messages]) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return all numbers in some messages as a table on one clock, and notes for the user.

    The notes state the number of fields, the topics of unknown type, and the topics whose time stamps were not used.
    """
    # Collect the samples of every field. A topic that cannot be decoded is skipped.
    # An array keeps a sample in 24 bytes, a tuple in 200. A packed bag of a few kB may hold millions of numbers.
    samples_of: dict[str, tuple[array[int], array[int], array[float]]] = {}
    skipped: set[str] = set()
    allowance = Allowance(MAX_NUMBERS_BYTES)
    for topic, published, received, message in messages:
        if message is None:
            skipped.add(topic)
        if topic in skipped:
            continue
        # The best time is the message's own stamp, then the time of publication, then the time of receipt.
        stamp = _stamp(message)
        at = stamp if stamp is not None else received if published is None else published
        for field, value in _leaves(message, ""):
            allowance.take(BYTES_PER_NUMBER)
            samples = samples_of.setdefault(f"{topic}{field}", (array("q"), array("q"), array("d")))
            samples[0].append(at)
            samples[1].append(received)
            samples[2].append(value)
    # The time stamps of a topic are unusable if they do not increase, or if they belong to another clock than the times
    # of receipt.
    series: Series = {}
    stale: dict[str, None] = {}
    for field, samples in samples_of.items():
        stamps, receipts, values = (np.array(column) for column in samples)
        if values.size < MIN_MESSAGES:
            continue
        if np.mean(np.diff(stamps) > 0) < 0.5 or abs(np.median(stamps - receipts)) > MAX_STAMP_OFFSET:
            stale[field.split(".")[0]] = None
            stamps = receipts
        series[field] = (stamps, values)
    if not series:
        raise DataError(
            f"{path}: no topic of the bag has numbers in at least {MIN_MESSAGES} messages, so there is nothing to "
            "import: give a longer recording."
        )
    # A command or a duty keeps its value until the next message; measured values are interpolated.
    held = {name for name in series if word(name).has(COMMAND | DUTY)}
    table, period = on_one_clock(path, series, held)
    omissions = [f"topics of unknown type are left out: {', '.join(sorted(skipped))}"] if skipped else []
    if stale:
        omissions.append(
            "the time stamps of some topics do not increase or belong to another clock, so times of receipt are taken: "
            f"{', '.join(stale)}"
        )
    return table, (f"the {len(series)} fields of the bag are interpolated to a row every {period:g} s", *omissions)


def _stamp(message: Any) -> int | None:
    """Return the time stamp that a message holds [ns]; None if it holds none.

    A ROS message has its time stamp in header.stamp. A message in JSON may instead have a field timestamp or stamp with
    seconds and nanoseconds.
    """
    if not isinstance(message, Mapping):
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        return None if stamp is None else nanoseconds(stamp)
    header = message.get("header")
    stamp = header.get("stamp") if isinstance(header, Mapping) else message.get("timestamp", message.get("stamp"))
    if not isinstance(stamp, Mapping):
        return None
    # The names of both numbers differ between ROS 1, ROS 2 and JSON.
    seconds, fraction = (next((stamp[key] for key in keys if key in stamp), None) for keys in (
        ("sec", "secs", "seconds"), ("nanosec", "nsec", "nsecs", "nanos")))  # fmt: skip
    return int(seconds) * 1_000_000_000 + int(fraction) if seconds is not None and fraction is not None else None


def _leaves(value: Any, path: str) -> Iterator[tuple[str, float]]:
    """Yield every number in a message as (path of the field, value).

    The entries of an array are named by the array `name` of their message, as in ROS joint states, or otherwise by
    their index.
    """
    # The header holds only stamp and frame, and the array `name` only labels; neither is a measurement.
    if isinstance(value, (bool, int, float, np.number)):
        yield path, float(value)
    elif isinstance(value, Mapping):
        names = value.get("name")
        for key, entry in value.items():
            if key not in ("header", "name", "timestamp", "stamp") or isinstance(entry, (int, float)):
                yield from _member(entry, f"{path}.{key}", names)
    elif dataclasses.is_dataclass(value):
        names = getattr(value, "name", None)
        for field in field_names(value):
            if field not in ("header", "name"):
                yield from _member(getattr(value, field), f"{path}.{field}", names)


def _member(value: Any, path: str, names: Any) -> Iterator[tuple[str, float]]:
    """Yield every number in one field of a message as (path of the field, value).

    The entries of a short array are labelled by `names` if there is one name for each entry, and otherwise by their
    index.
    """
    if isinstance(value, (str, bytes, Mapping)) or not hasattr(value, "__len__"):
        yield from _leaves(value, path)
    elif len(value) <= MAX_ARRAY:
        labels = list(names) if isinstance(names, list) and len(names) == len(value) else range(len(value))
        for label, element in zip(labels, value, strict=True):
            yield from _leaves(element, f"{path}[{label}]")


DELIMITERS = ";\t|,"
"""Characters that are tried as the separator of the cells in a text of records."""
HEAD = 1 << 16
"""Number of bytes at the beginning of a text file that are read to recognise its format."""
WORD = re.compile(r"\$?[^\W\d][\w ./-]*(?:\[[^\]]*\])?")
"""Pattern of a cell that holds a name, which a unit in brackets may follow."""


def delimiter_of_records(path: Path) -> str:
    """Return the separator of the cells in a text of records, or '' if the file is no such text.

    A text of records has lines of several types, such as GPS and IMU; each line begins with the name of its type.
    """
    try:
        head = decode(content(path, MAX_TABLE_BYTES, HEAD))[0].splitlines()[:SAMPLED_LINES]
    except OSError:
        return ""
    for mark in DELIMITERS:
        try:
            rows = [cells(line, mark) for line in head[:-1] if line.strip()]
        except csv.Error:
            continue
        # Each record begins with the name of its type, which is the only word among its first two cells.
        if not rows or any(not _is_word(row[0]) or len(row) < 3 or _is_word(row[1]) for row in rows):
            continue
        # All records of a type have the same number of cells, and at least two types differ in this number. A table
        # has rows of one width.
        widths = {(row[0], len(row)) for row in rows}
        if len(widths) == len({name for name, _ in widths}) and len({width for _, width in widths}) > 1:
            return mark
    return ""


def _is_word(cell: str) -> bool:
    """Return whether a cell holds a name, and neither a number nor a mark for a missing value."""
    return cell.lower() not in MISSING and bool(WORD.fullmatch(cell))


Numbers = Callable[[pd.DataFrame], tuple[pd.DataFrame, list[str]]]
"""Function that converts a table to its columns of numbers, with dates as nanoseconds, and also returns the names of
the columns without numbers."""


def record_table(path: Path, delimiter: str, numbers_of: Numbers) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return the numbers of all records in a text as columns `NAME_word_1` next to the time `t_s`, and notes for the
    user.

    NAME is the type of the record, `word` is the last constant word before the number, and 1 counts the numbers after
    it.

    Parameters
    ----------
    path : Path
        The file.
    delimiter : str
        Separator of the cells, from `delimiter_of_records`.
    numbers_of : function
        Converts a table to its columns of numbers, with dates as nanoseconds.

    Raises
    ------
    DataError
        The file cannot be read, or the second cell of its records is not a date.
    """
    try:
        lines = decode(content(path, MAX_TABLE_BYTES))[0].splitlines()
        rows = [cells(line, delimiter) for line in lines if line.strip()]
    except (OSError, csv.Error) as error:
        raise DataError(f"{path}: the file cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    counts = Counter((row[0], len(row)) for row in rows)
    # A name may occur with several widths by mistake; the most frequent width counts.
    kinds = {name: width for (name, width), count in reversed(counts.most_common()) if count >= MIN_MESSAGES}
    series: Series = {}
    for name, width in kinds.items():
        table = pd.DataFrame([row[1:] for row in rows if (row[0], len(row)) == (name, width)], dtype=object)
        table.columns = _names(name.lstrip("$"), table)
        numbers, _ = numbers_of(table)
        if "t" not in numbers or numbers["t"].dtype != np.int64 or table["t"].str.isdigit().any():
            raise DataError(
                f"{path}: its lines are records ({', '.join(sorted(kinds))}), but the cell after '{name}' is no date "
                f"({table['t'].iloc[0]!r}): write one table for each record type, or write a date such as "
                "2022-06-01 13:42:57.86 after the type."
            )
        at = numbers.pop("t").to_numpy()
        series |= {str(column): (at, numbers[column].to_numpy(dtype=float)) for column in numbers}
    table, period = on_one_clock(path, series)
    others = len(rows) - sum(counts[kind] for kind in kinds.items())
    dropped = (f"{others} lines that belong to no record type are left out",) if others else ()
    of_each = ", ".join(f"{counts[name, width]} of {name}" for name, width in sorted(kinds.items()))
    return table, (f"records of several types ({of_each}) are interpolated to a row every {period:g} s", *dropped)


def _names(kind: str, table: pd.DataFrame) -> list[str]:
    """Return the column names of one record type: the last constant word before each column, with a number if it
    repeats.
    """
    # A column with the same word in all rows is a label; it names the columns after it.
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
