"""The clock of a recording: which column it may be and in what unit, as seconds from the begin."""

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.formula import evaluate, quote
from rover_pin.logs.importing.column_names import TIME, Word
from rover_pin.logs.importing.recording import Entry, Recording, words_of

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
UNTOLD = {"s": 0.6, "ms": 0.25, "us": 0.1, "ns": 0.05}
"""How often a clock without a unit is in these."""
STEP, STEPS = math.log(0.05), 1.5
"""Logarithm of the usual time between rows [s], and its spread: 2 ms to 1 s."""
SINCE_1970 = (9e8, 2.2e9)
"""What clocks show [s] that count from 1970."""
PARTS = {"nanosec": 1e-9, "nanosecs": 1e-9, "nsec": 1e-9, "nsecs": 1e-9, "usec": 1e-6, "microsec": 1e-6}
"""What follows whole seconds in a separate column, in s."""
REST = re.compile(rf"(.*?)({'|'.join(PARTS)})")
BACK = 0.01
"""Share of rows that may run back or repeat and are then dropped."""


class Clock(NamedTuple):
    """A column that may be the clock, in a unit; without one it counts rows, of unknown period."""

    column: str
    unit: str
    weight: float
    "logarithm of its prior"
    formula: str = ""

    def recording(self, table: pd.DataFrame, helpers: Mapping[str, Entry] = MappingProxyType({})) -> Recording:
        """Return the rows that run ahead, on this clock."""
        t = _seconds(table, self)
        ahead = _ahead(t)
        if not ahead.any():
            raise DataError(
                f"no row of '{self.column}' holds a time: name the column that does by --column t_s='COLUMN'."
            )
        return Recording(t[ahead] - t[ahead][0], table[ahead].reset_index(drop=True), helpers)

    def description(self, table: pd.DataFrame) -> str:
        """Return which column in what unit, and how many rows do not run ahead."""
        dropped = len(table) - int(np.sum(_ahead(_seconds(table, self))))
        more = f"; {dropped} rows that repeat a time or run back are left out" if dropped else ""
        return (self.formula or f"'{self.column}' in {self.unit}") + more


def _seconds(table: pd.DataFrame, clock: Clock) -> np.ndarray:
    if clock.formula:
        columns = {str(name): table[name].to_numpy(dtype=float) for name in table}
        return evaluate(clock.formula, columns, "the column t_s")
    raw = table[clock.column]
    return np.asarray((raw - raw.iloc[0]).to_numpy(dtype=float) * SECONDS.get(clock.unit, 1.0))


def clocks(table: pd.DataFrame, declared: str, path: Path) -> list[Clock]:
    """Return the columns that may be the clock, each in every unit that it may have.

    Raises DataError: no column increases as a clock does.
    """
    if declared:
        return [Clock("t_s", "s", 0.0, quote(declared) if declared in table else declared)]
    named = [word for word in words_of(table) if _runs(table[word.name], word)]
    best = min(map(_rank, named), default=0)
    candidates = [clock for word in named if _rank(word) <= max(best, 2) for clock in _in_units(table[word.name], word)]
    if not candidates:
        raise DataError(
            f"{path}: no column is a clock, one that increases from row to row: name it t_s (or time, stamp), in s."
        )
    return candidates


def whole_stamps(table: pd.DataFrame) -> pd.DataFrame:
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
    return 2 if word.has(TIME) else 3


def _runs(values: pd.Series, word: Word) -> bool:
    """Whether a column runs on as a clock does: nearly always, and evenly where its name does not tell.

    Of a sawtooth, as the nanoseconds of a stamp are alone, hardly a row is later than all before.
    """
    t = values.to_numpy(dtype=float)
    steps = np.diff(t[np.isfinite(t)])
    if not steps.size or np.mean(_ahead(t)[np.isfinite(t)]) < 1.0 - BACK - 0.2 * (steps.size > 50):
        return False
    middle = float(np.median(steps))
    return _rank(word) < 3 or bool(np.mean(np.abs(steps - middle) < 0.2 * middle) > 0.9)


def _in_units(values: pd.Series, word: Word) -> Iterator[Clock]:
    """Yield a clock in every unit; whole numbers one apart are a counter unless their name tells a unit."""
    if word.unit in SECONDS or word.name == "t_s":
        yield Clock(word.name, word.unit or "s", 0.0)
        return
    t = values.to_numpy(dtype=float)
    step, size = float(np.nanmedian(np.diff(t))), float(np.nanmedian(np.abs(t)))
    if step == 1.0 and np.all(t == np.round(t)):
        yield Clock(word.name, "", 0.0)
        if _rank(word) == 3:
            return
    for unit, share in UNTOLD.items():
        prior = 0.0 if SINCE_1970[0] < size * SECONDS[unit] < SINCE_1970[1] else math.log(share)
        yield Clock(word.name, unit, prior - 0.5 * ((math.log(step * SECONDS[unit]) - STEP) / STEPS) ** 2)
