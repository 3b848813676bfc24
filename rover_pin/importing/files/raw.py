"""Read a recording of any file type as a table of numbers with the recorded column names; dates become nanoseconds.

`read_raw` chooses the reader by the suffix and the content of the file. Text, Parquet and MATLAB files are read in this
module.
"""

import math
import re
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.matlab import NotNumbers, Variables, mat_variables
from rover_pin.base.files.paths import exists, is_file, is_folder
from rover_pin.base.files.table import read_table
from rover_pin.importing.files.bags import (
    bag_table,
    delimiter_of_records,
    is_json_lines,
    json_lines_table,
    record_table,
)
from rover_pin.logs.ros_bag import is_bag

DATED = re.compile(
    r"(?:(?P<first>\d{1,2})[./-](?P<second>\d{1,2})[./-](?P<year>\d{4})[ T,]+)?"
    r"(?P<time>(?:\d{1,2}:)?\d{1,2}:\d\d(?:[.,]\d+)?)(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?Z| ?UTC)?$"
)
"""Pattern of a time of day (or of minutes and seconds). A date that begins with the day or the month may precede the
time."""
YEAR_FIRST = re.compile(
    r"(\d{4})[_:/.-](\d\d?)[_:/.-](\d\d?)[_ T:-]+(\d\d?)[_:.-](\d\d?)[_:.-](\d\d?)(?:[_.,:](\d{1,9}))?(?: ?Z| ?UTC)?$"
)
"""Pattern of a date that begins with the year, followed by a time of day, with any separators between the numbers."""
MAX_SIZE = math.sqrt(sys.float_info.max)
"""Maximum absolute value of a number. A larger number counts as missing, because its square would overflow and no
measurement is as large."""
NO_DAY = pd.Timestamp("2000-01-01")
"""Date that is assumed if a recording has only the time of day."""


class Raw(NamedTuple):
    """One recorded file as a table of numbers, with notes for the user on how the file was read."""

    path: Path
    table: pd.DataFrame
    notes: tuple[str, ...] = ()
    dates: tuple[str, ...] = ()
    """names of the columns that were read from dates and hold nanoseconds"""
    texts: Mapping[str, str] = MappingProxyType({})
    """name of each column without numbers -> its first cell that is not a number"""


def read_raw(path: Path) -> Raw:
    """Read a recorded file and return its numbers as a table. A file with an unknown suffix is read as text.

    Raises DataError: the file is missing or cannot be read, or has fewer than two columns of numbers or two rows.
    Raises MissingExtraError: the file is a bag, and the extra that reads it is not installed.
    """
    if not exists(path):
        raise DataError(f"{path}: there is no such file: give recordings as CSV, Parquet, .mat, .bag, .db3 or .mcap.")
    if is_folder(path) and not is_file(path / "metadata.yaml"):
        raise DataError(
            f"{path} is a folder without metadata.yaml, so it is not a ROS bag: give the recordings in the folder by "
            "their names."
        )
    table, notes = _table(path)
    numbers, dropped = _numbers(table)
    if numbers.shape[1] < 2 or len(numbers) < 2:
        raise DataError(
            f"{path}: the file has {numbers.shape[1]} columns of numbers in {len(numbers)} rows, but a recording needs "
            "a time and a measured column, and at least two rows."
        )
    # A column of text that became large integers was a column of dates: nanoseconds since 1970.
    dates = tuple(
        name
        for name in numbers
        if not pd.api.types.is_numeric_dtype(table[name])
        and numbers[name].dtype == np.int64
        and bool(np.abs(numbers[name].to_numpy()).max() > 1e12)
    )
    omissions = (f"columns without numbers are left out: {', '.join(dropped)}",) if dropped else ()
    # Error messages quote the first cell that is no number, or else the first that is not empty.
    texts = {}
    for name in dropped:
        filled = table[name][_full(table[name])].astype(str)
        words = filled[pd.to_numeric(filled, errors="coerce").isna()]
        texts[name] = next(iter(words), next(iter(filled), ""))
    # A note states each word that stands in place of numbers in some rows, with its columns and its first row. Columns
    # that lose the same cells to the same word share one note, as x and y do with "NO FIX".
    named: dict[tuple[str, int, int], list[str]] = {}
    for name in numbers:
        lost = (_full(table[name]) & numbers[name].isna()).to_numpy()
        if lost.any():
            key = (str(table[name][lost].iloc[0]), int(np.argmax(lost)) + 1, int(lost.sum()))
            named.setdefault(key, []).append(str(name))
    word_notes = []
    for (word, row, count), names in named.items():
        columns = " and ".join(f"'{name}'" for name in names[:4])
        columns += f" and {len(names) - 4} more" if len(names) > 4 else ""
        word_notes.append(
            f"{count} cells of {columns} are left out, because they hold no numbers. The first of them is {word!r} in "
            f"row {row}"
        )
    return Raw(path, numbers, (*notes, *omissions, *word_notes), dates, texts)


def _full(column: pd.Series) -> pd.Series:
    """Return a mask of the cells of a column that are not empty.

    Only columns of Python objects can hold empty texts. Only these columns are compared with '', because the comparison
    is slow.
    """
    return column.notna() & (column.astype(str) != "") if column.dtype == object else column.notna()


def _table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Read a file with the reader for its suffix and content, and return its table and notes on how it was read."""
    if is_bag(path):
        return bag_table(path)
    if path.suffix == ".mat":
        return mat_table(path)
    if path.suffix in (".jsonl", ".json", ".ndjson") and is_json_lines(path):
        return json_lines_table(path)
    if path.suffix not in (".parquet", ".pq") and (mark := delimiter_of_records(path)):
        return record_table(path, mark, _numbers)
    table = read_table(path)
    # The reader numbers columns of the same name from the second on, so none of these columns is lost.
    twice = [fault for fault in table.faults if "twice" in fault]
    short = [fault for fault in table.faults if fault not in twice]
    more = f" (and {len(short) - 1} more)" if len(short) > 1 else ""
    omissions = (f"left out: {short[0].rstrip('.')}{more}",) if short else ()
    numbered = (fault.partition(";")[0] + ", so these columns are numbered from the second on" for fault in twice)
    return table.frame(), (*table.notes, *numbered, *omissions)


def _numbers(table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """Return the columns of a table that hold numbers, with dates as nanoseconds, and the names of the columns without
    numbers.
    """
    numeric, dropped = {}, []
    for name in table.columns:
        column = _as_numbers(table[name])
        sane = None if column is None else column.where(np.abs(column.astype(float)) < MAX_SIZE)
        if sane is None or not sane.notna().any():
            dropped.append(str(name))
        else:
            numeric[str(name)] = sane
    return pd.DataFrame(numeric), dropped


def _as_numbers(column: pd.Series) -> pd.Series | None:
    """Return a column as numbers, or its dates as nanoseconds since 1970; None if the column holds neither."""
    # The order matters: numbers are kept, dates are tested before texts, because pandas reads some dates as numbers.
    if pd.api.types.is_bool_dtype(column):
        return column.astype(float)
    if pd.api.types.is_numeric_dtype(column):
        return column
    if pd.api.types.is_datetime64_any_dtype(column):
        return _nanoseconds(column)
    dated = column.astype(str).str.strip().str.fullmatch(YEAR_FIRST).mean() > 0.99
    numbers = pd.to_numeric(column, errors="coerce")
    # pandas reads the date 2024_04_23 as the number 20240423, so dates are recognised first.
    if numbers.notna().sum() > 0.5 * column.notna().sum() and not dated:
        return numbers
    try:
        dates = pd.to_datetime(_as_iso(column.astype(str)), errors="coerce", utc=True, format="ISO8601")
    except (ValueError, TypeError, OverflowError):
        return None
    return _nanoseconds(dates) if dates.notna().mean() > 0.99 else None


def _nanoseconds(dates: pd.Series) -> pd.Series | None:
    """Return dates as nanoseconds since 1970; None if they lie before 1678 or after 2262, which 64 bits cannot hold."""
    try:
        return dates.dt.as_unit("ns").astype("int64")
    except (ValueError, OverflowError):  # pandas' error for dates out of bounds is a ValueError
        return None


def _as_iso(column: pd.Series) -> pd.Series:
    """Return dates and times of day in any usual order as ISO 8601. Other texts are returned unchanged.

    A time of day that becomes smaller from one row to the next belongs to the next day. A date that may begin with the
    day or the month is read with the day first, unless a second number exceeds 12. This matters only if a drive passes
    midnight.
    """
    parts = column.str.strip().str.extract(YEAR_FIRST)
    if parts[5].notna().mean() > 0.99:
        # A fraction of varying length with at most 3 digits is a count of milliseconds: 7 means 0.007 s.
        milliseconds = parts[6].str.len().nunique() > 1 and (parts[6].str.len() <= 3).all()
        fraction = parts[6].str.zfill(3) if milliseconds else parts[6]
        day, time = (parts[list(at)].apply(lambda digits: digits.str.zfill(2)) for at in ((1, 2), (3, 4, 5)))
        iso = parts[0] + "-" + day[1] + "-" + day[2] + "T" + time[3] + ":" + time[4] + ":" + time[5]
        return iso + "." + fraction.fillna("0")
    parts = column.str.strip().str.extract(DATED)
    if not parts["time"].notna().mean() > 0.99:
        return column
    time = parts["time"].str.replace(",", ".")
    if (time.str.count(":") == 1).all():
        # Spreadsheets print mm:ss.0 without the hour, so the minutes begin again at 0 after 59. Each fall is an hour.
        minutes = time.str.split(":").str[0].astype(float)
        hour = ((minutes.diff() < -30).cumsum() + minutes // 60).astype("Int64")
        day = (NO_DAY + pd.to_timedelta(hour.fillna(0).astype(int) // 24, unit="D")).dt.strftime("%Y-%m-%d")
        minute, second = (minutes % 60).fillna(0).astype(int).astype(str).str.zfill(2), time.str.split(":").str[1]
        return day + "T" + (hour % 24).astype(str).str.zfill(2) + ":" + minute + ":" + second
    if parts["half"].notna().any():
        hours = time.str.split(":").str[0].astype(float) % 12 + 12 * parts["half"].str.lower().eq("p")
        time = hours.fillna(0).astype(int).astype(str) + ":" + time.str.split(":", n=1).str[1]
    time = time.str.replace(r"^(\d):", r"0\1:", regex=True)
    if parts["year"].isna().any():
        hours = time.str.split(":").str[0].astype(float)
        day = NO_DAY + pd.to_timedelta((hours.diff() < -12).cumsum(), unit="D")
        return day.dt.strftime("%Y-%m-%d") + "T" + time
    month, day = ("first", "second") if (parts["second"].astype(float) > 12).any() else ("second", "first")
    return parts["year"] + "-" + parts[month].str.zfill(2) + "-" + parts[day].str.zfill(2) + "T" + time


SHOWN_OBJECTS = 5
"""Maximum number of variables without numbers that a note lists by name."""


def mat_table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return the vectors of the most frequent length in a .mat file as a table, and a note on variables without
    numbers.

    A matrix becomes one column for each of its channels. A field of a struct is named by its path, such as `log.rate`.

    Raises DataError: the file cannot be read, or none of its variables is a vector of numbers.
    """
    # Variables of several lengths may be in one file; the most frequent length is that of the recorded channels.
    variables = dict(_leaves("", mat_variables(path)))
    objects = [f"'{name}' ({value.kind})" for name, value in variables.items() if isinstance(value, NotNumbers)]
    named = ", ".join(objects[:SHOWN_OBJECTS]) + (
        f" and {more} more" if (more := len(objects) - SHOWN_OBJECTS) > 0 else ""
    )
    vectors: dict[str, np.ndarray] = {}
    for name, value in variables.items():
        if isinstance(value, np.ndarray) and value.ndim == 1:
            vectors[name] = value.astype(float)
        elif isinstance(value, np.ndarray) and value.ndim == 2:
            # A channel has more samples than there are channels, so the longer side of the matrix is time.
            columns = value.T if value.shape[0] >= value.shape[1] else value
            vectors |= {f"{name} {number}": column.astype(float) for number, column in enumerate(columns, 1)}
    lengths = Counter(len(values) for values in vectors.values() if len(values) > 1)
    if not lengths:
        hint = (
            f" It holds {named}: convert these objects to numbers first, for example a datetime t by seconds(t - t(1))."
            if objects
            else ""
        )
        raise DataError(f"{path}: the file holds no vector of numbers: save one variable for each channel.{hint}")
    length = lengths.most_common(1)[0][0]
    table = pd.DataFrame({name: values for name, values in vectors.items() if len(values) == length})
    notes = (f"variables left out, because they are not arrays of numbers: {named}",) if objects else ()
    return table, notes


def _leaves(prefix: str, variables: Variables) -> Iterator[tuple[str, object]]:
    """Yield every array, and every object without numbers, in nested structs of a .mat file, together with its path."""
    for key, value in variables.items():
        name = f"{prefix}.{key}" if prefix else key
        if isinstance(value, dict):
            yield from _leaves(name, value)
        else:
            yield name, value
