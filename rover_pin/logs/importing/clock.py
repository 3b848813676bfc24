"""The clock of a recording: which column it is and in what unit, as seconds from the begin."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.logs.importing.words import TIME, Word, word

EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
"""Numbers beyond these, counted from 1970, are in these units: 1e11 s are 3,000 years."""
UNNAMED = 8
"""Rank of a column whose name tells no clock."""
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
SLOWEST, FASTEST = 2.0, 1e-4
"""Rows of a drive lie between these apart [s], or the clock is in another unit."""
PARTS = {"nanosec": 1e-9, "nanosecs": 1e-9, "nsec": 1e-9, "nsecs": 1e-9, "usec": 1e-6, "microsec": 1e-6}
"""What follows whole seconds in a separate column, in s."""
REST = re.compile(rf"(.*?)({'|'.join(PARTS)})")
BACK = 0.01
"""Share of rows that may run back or repeat and are then dropped."""


class Clock(NamedTuple):
    """Seconds from the begin, the rows that they are of, the column they come from, and what was done."""

    t: np.ndarray
    table: pd.DataFrame
    column: str
    description: str
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
    clock_word = next(
        (
            candidate
            for candidate in sorted(names, key=_rank)
            if _is_clock(table[candidate.name], _rank(candidate) < UNNAMED)
        ),
        None,
    )
    if clock_word is None:
        raise DataError(
            f"{path}: no column is a clock, one that increases from row to row: name it t_s (or time, stamp), in s."
        )
    raw = table[clock_word.name]
    unit, sure = _unit(raw, clock_word)
    begin = raw.iloc[0]
    t = (raw - begin).to_numpy(dtype=float) * SECONDS[unit]
    ahead = _ahead(t)
    dropped = int(np.sum(~ahead))
    description = f"'{clock_word.name}' in {unit}" + (
        f"; {dropped} rows that repeat a time or run back are left out" if dropped else ""
    )
    return Clock(t[ahead], table[ahead].reset_index(drop=True), clock_word.name, description, sure)


def _whole_stamps(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose stamps in two columns, whole seconds and the rest as ROS has them, are one column in s."""
    for fraction in map(str, table.columns):
        match = REST.fullmatch(fraction)
        seconds = next((name for end in ("sec", "secs") if match and (name := match[1] + end) in table), None)
        if match and seconds:
            stamp = (table[seconds] - table[seconds].iloc[0]) + PARTS[match[2]] * table[fraction]
            table = table.drop(columns=[seconds, fraction]).assign(
                **{f"{match[1].rstrip('._')} stamp [s]".strip(): stamp}
            )
    return table


def _ahead(t: np.ndarray) -> np.ndarray:
    """Return which rows are later than all before them."""
    before = np.maximum.accumulate(np.concatenate([[-np.inf], np.nan_to_num(t[:-1], nan=-np.inf)]))
    return np.isfinite(t) & (before < t)


def _rank(word: Word) -> int:
    """Return how likely a column is the clock by its name, the likeliest first."""
    if word.name == "t_s":
        return 0
    if word.has(TIME) and word.unit in SECONDS:
        return 1
    if word.tokens and word.tokens[0] in TIME and len(word.tokens) < 3:
        return 2
    return 3 if word.has(TIME) else UNNAMED


def _is_clock(values: pd.Series, named: bool) -> bool:
    """Whether a column runs on as a clock does: nearly always, and evenly where its name does not tell.

    Of a sawtooth, as the nanoseconds of a stamp are alone, hardly a row is later than all before.
    """
    t = values.to_numpy(dtype=float)
    steps = np.diff(t[np.isfinite(t)])
    if not steps.size or np.mean(_ahead(t)[np.isfinite(t)]) < 1.0 - BACK - 0.2 * (steps.size > 50):
        return False
    middle = float(np.median(steps))
    return named or bool(np.mean(np.abs(steps - middle) < 0.2 * middle) > 0.9)


def _unit(values: pd.Series, word: Word) -> tuple[str, bool]:
    if word.unit in SECONDS:
        return word.unit, True
    size = float(np.nanmedian(np.abs(values.to_numpy(dtype=float))))
    for limit, unit in EPOCHS:
        if size > limit:
            return unit, True
    step = float(np.median(np.diff(values.to_numpy(dtype=float))))
    for unit in SECONDS:
        if FASTEST <= step * SECONDS[unit] <= SLOWEST:
            return unit, unit == "s"
    return "s", False
