"""The clock of a recording: which column it is and in what unit, as seconds from the begin."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.errors import DataError
from rover_pin.importing.words import TIME, Word, word

EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
"""Numbers beyond these, counted from 1970, are in these units: 1e11 s are 3,000 years."""
UNNAMED = 8
"""Rank of a column whose name tells no clock."""
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
SLOWEST, FASTEST = 2.0, 1e-4
"""Rows of a drive lie between these apart [s], or the clock is in another unit."""
PARTS = {"nanosec": 1e-9, "nanosecs": 1e-9, "nsec": 1e-9, "nsecs": 1e-9, "usec": 1e-6, "microsec": 1e-6}
"""What follows whole seconds in a column of its own, in s."""
REST = re.compile(rf"(.*?)({'|'.join(PARTS)})")
BACK = 0.01
"""Share of rows that may run back or repeat and are then dropped."""


class Clock(NamedTuple):
    """Seconds from the begin, the rows that they are of, the column they come from, and what was done."""

    t: np.ndarray
    table: pd.DataFrame
    column: str
    said: str
    sure: bool


def find_clock(table: pd.DataFrame, path: Path) -> Clock:
    """Return the clock of a table, rows sorted out that repeat a time.

    Raises
    ------
    DataError
        No column increases as a clock does, or too many rows run back.
    """
    table = _whole_stamps(table)
    names = [word(str(name)) for name in table.columns]
    found = next(
        (each for each in sorted(names, key=_rank) if _is_clock(table[each.name], _rank(each) < UNNAMED)), None
    )
    if found is None:
        raise DataError(
            f"{path}: no column is a clock, one that increases from row to row: name it t_s (or time, stamp), in s."
        )
    raw = table[found.name]
    unit, sure = _unit(raw, found)
    begin = raw.iloc[0]
    t = (raw - begin).to_numpy(dtype=float) * SECONDS[unit]
    ahead = _ahead(t)
    dropped = int(np.sum(~ahead))
    said = f"'{found.name}' in {unit}" + (
        f"; {dropped} rows that repeat a time or run back are left out" if dropped else ""
    )
    return Clock(t[ahead], table[ahead].reset_index(drop=True), found.name, said, sure)


def _whole_stamps(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose stamps in two columns, whole seconds and the rest as ROS has them, are one column in s."""
    for rest in map(str, table.columns):
        found = REST.fullmatch(rest)
        whole = next((name for end in ("sec", "secs") if found and (name := found[1] + end) in table), None)
        if found and whole:
            stamp = (table[whole] - table[whole].iloc[0]) + PARTS[found[2]] * table[rest]
            table = table.drop(columns=[whole, rest]).assign(**{f"{found[1].rstrip('._')} stamp [s]".strip(): stamp})
    return table


def _ahead(t: np.ndarray) -> np.ndarray:
    """Return which rows are later than all before them."""
    before = np.maximum.accumulate(np.concatenate([[-np.inf], np.nan_to_num(t[:-1], nan=-np.inf)]))
    return np.isfinite(t) & (before < t)


def _rank(each: Word) -> int:
    """Return how likely a column is the clock by its name, the likeliest first."""
    if each.name == "t_s":
        return 0
    if each.has(TIME) and each.unit in SECONDS:
        return 1
    if each.tokens and each.tokens[0] in TIME and len(each.tokens) < 3:
        return 2
    return 3 if each.has(TIME) else UNNAMED


def _is_clock(values: pd.Series, named: bool) -> bool:
    """Whether a column runs on as a clock does: nearly always, and evenly where its name does not tell.

    Of a sawtooth, as the nanoseconds of a stamp are alone, hardly a row is later than all before.
    """
    t = values.to_numpy(dtype=float)
    known = np.diff(t[np.isfinite(t)])
    if not known.size or np.mean(_ahead(t)[np.isfinite(t)]) < 1.0 - BACK - 0.2 * (known.size > 50):
        return False
    middle = float(np.median(known))
    return named or bool(np.mean(np.abs(known - middle) < 0.2 * middle) > 0.9)


def _unit(values: pd.Series, about: Word) -> tuple[str, bool]:
    if about.unit in SECONDS:
        return about.unit, True
    size = float(np.nanmedian(np.abs(values.to_numpy(dtype=float))))
    for limit, unit in EPOCHS:
        if size > limit:
            return unit, True
    step = float(np.median(np.diff(values.to_numpy(dtype=float))))
    for unit in SECONDS:
        if FASTEST <= step * SECONDS[unit] <= SLOWEST:
            return unit, unit == "s"
    return "s", False
