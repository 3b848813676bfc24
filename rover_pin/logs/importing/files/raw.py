"""A recording as its files have it: columns of numbers by their own names, one clock in seconds."""

import math
import re
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import exists, is_file, is_folder
from rover_pin.base.files.table import read_table
from rover_pin.logs.importing.files.bags import bag_table, delimiter_of_records, record_table
from rover_pin.logs.importing.files.matlab import mat_table
from rover_pin.logs.ros_bag import is_bag

DATED = re.compile(
    r"(?:(?P<first>\d{1,2})[./-](?P<second>\d{1,2})[./-](?P<year>\d{4})[ T,]+)?(?P<time>\d{1,2}:\d\d:\d\d(?:[.,]\d+)?)"
    r"(?: ?Z| ?UTC)?$"
)
"""A time of day, perhaps after a date that begins with day or month."""
YEAR_FIRST = re.compile(
    r"(\d{4})[_:/.-](\d\d?)[_:/.-](\d\d?)[_ T:-]+(\d\d?)[_:.-](\d\d?)[_:.-](\d\d?)(?:[_.,:](\d{1,9}))?(?: ?Z| ?UTC)?$"
)
"""A date and a time of day with any marks between the numbers."""
LARGEST = math.sqrt(sys.float_info.max)
"""What is larger has no square, and is no reading."""
NO_DAY = pd.Timestamp("2000-01-01")
"""What stands for the day where only times are given."""


class Raw(NamedTuple):
    """One recording: its file, a table of numbers, and what was done to read it."""

    path: Path
    table: pd.DataFrame
    notes: tuple[str, ...] = ()


def read_raw(path: Path) -> Raw:
    """Return a recording of any kind that is known by its suffix, text where it is not.

    Raises DataError: the file is missing or cannot be read, or has fewer than two columns of numbers.
    Raises MissingExtraError: a bag without the extra that reads it.
    """
    if not exists(path):
        raise DataError(f"{path}: there is no such file: give recordings as CSV, Parquet, .mat, .bag, .db3 or .mcap.")
    if is_folder(path) and not is_file(path / "metadata.yaml"):
        raise DataError(f"{path}: is a folder and no bag (no metadata.yaml in it): give the recordings in it by name.")
    table, notes = _table(path)
    numbers, dropped = _numbers(table)
    if numbers.shape[1] < 2 or len(numbers) < 2:
        raise DataError(
            f"{path}: {numbers.shape[1]} columns of numbers in {len(numbers)} rows: a recording needs a time and what "
            "was measured, in two rows at least."
        )
    omissions = (f"columns without numbers are left out: {', '.join(dropped)}",) if dropped else ()
    lost = {name: int(_full(table[name]).sum() - numbers[name].notna().sum()) for name in numbers}
    cell_notes = (
        f"{count} cells of '{name}' are no numbers and are left out" for name, count in lost.items() if count > 0
    )
    return Raw(path, numbers, (*notes, *omissions, *cell_notes))


def _full(column: pd.Series) -> pd.Series:
    return column.notna() & (column.astype(str) != "")


def _table(path: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    if is_bag(path):
        return bag_table(path)
    if path.suffix == ".mat":
        return mat_table(path), ()
    if path.suffix not in (".parquet", ".pq") and (mark := delimiter_of_records(path)):
        return record_table(path, mark, _numbers)
    table = read_table(path)
    more = f" (and {len(table.faults) - 1} more)" if len(table.faults) > 1 else ""
    omissions = (f"left out: {table.faults[0].rstrip('.')}{more}",) if table.faults else ()
    return table.frame(), (*table.notes, *omissions)


def _numbers(table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """Return the columns of numbers, dates as nanoseconds, and the names of those without any."""
    numeric, dropped = {}, []
    for name in table.columns:
        column = _as_numbers(table[name])
        sane = None if column is None else column.where(np.abs(column.astype(float)) < LARGEST)
        if sane is None or not sane.notna().any():
            dropped.append(str(name))
        else:
            numeric[str(name)] = sane
    return pd.DataFrame(numeric), dropped


def _as_numbers(column: pd.Series) -> pd.Series | None:
    if pd.api.types.is_bool_dtype(column):
        return column.astype(float)
    if pd.api.types.is_numeric_dtype(column):
        return column
    if pd.api.types.is_datetime64_any_dtype(column):
        return column.dt.as_unit("ns").astype("int64")
    dated = column.astype(str).str.strip().str.fullmatch(YEAR_FIRST).mean() > 0.99
    numbers = pd.to_numeric(column, errors="coerce")
    if numbers.notna().sum() > 0.5 * column.notna().sum() and not dated:  # pandas reads 2024_04_23 as 20240423
        return numbers
    try:
        dates = pd.to_datetime(_as_iso(column.astype(str)), errors="coerce", utc=True, format="ISO8601")
    except (ValueError, TypeError, OverflowError):
        return None
    return dates.dt.as_unit("ns").astype("int64") if dates.notna().mean() > 0.99 else None


def _as_iso(column: pd.Series) -> pd.Series:
    """Return dates with the day or the month first, and times of day, as ISO 8601; what is neither as it is.

    Which of day and month comes first only matters where a drive passes midnight; a time of day does so once at most.
    """
    parts = column.str.strip().str.extract(YEAR_FIRST)
    if parts[5].notna().mean() > 0.99:
        milliseconds = parts[6].str.len().nunique() > 1 and (parts[6].str.len() <= 3).all()
        fraction = parts[6].str.zfill(3) if milliseconds else parts[6]
        day, time = (parts[list(at)].apply(lambda digits: digits.str.zfill(2)) for at in ((1, 2), (3, 4, 5)))
        iso = parts[0] + "-" + day[1] + "-" + day[2] + "T" + time[3] + ":" + time[4] + ":" + time[5]
        return iso + "." + fraction.fillna("0")
    parts = column.str.strip().str.extract(DATED)
    if not parts["time"].notna().mean() > 0.99:
        return column
    time = parts["time"].str.replace(",", ".").str.zfill(8)
    if parts["year"].isna().any():
        hours = parts["time"].str.split(":").str[0].astype(float)
        day = NO_DAY + pd.to_timedelta((hours.diff() < -12).cumsum(), unit="D")
        return day.dt.strftime("%Y-%m-%d") + "T" + time
    month, day = ("first", "second") if (parts["second"].astype(float) > 12).any() else ("second", "first")
    return parts["year"] + "-" + parts[month].str.zfill(2) + "-" + parts[day].str.zfill(2) + "T" + time
