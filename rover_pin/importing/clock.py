"""Find the clock of a recording: the column that holds the time, and its unit.

A recording rarely states which column is its clock. `clocks` lists the candidates, with a prior probability for each
unit. `joint_choice` later takes the unit that makes wheels and positions agree. A clock that overflows, decreases, or
has too few digits is repaired here if its times can be reconstructed. Otherwise the error message states the fault of
each column that may be a clock.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.column_names import TIME, Word, word
from rover_pin.base.formula import evaluate
from rover_pin.importing.recording import Entry, Recording, words_of

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}
"""Unit of time -> its length in seconds. A column in one of these units can be a clock."""
UNIT_PRIORS = {"s": 0.6, "ms": 0.25, "us": 0.1, "ns": 0.05, "d": 0.001}
"""Unit of time -> prior probability that a clock without a stated unit has this unit. Days occur in exports of
spreadsheets and MATLAB."""
LOG_STEP, LOG_STEP_SD = math.log(0.05), 1.5
"""Prior mean and SD of log(time between two rows / 1 s). The prior makes units of the clock that imply unusual row
spacings improbable: 95 % of recordings have a row every 2 ms to 1 s."""
SINCE_1970 = (9e8, 2.2e9)
"""Times [s] between these limits are taken as seconds since 1970. The limits are the years 1998 and 2039."""
FRACTIONS = {"nanosec": 1e-9, "nanosecs": 1e-9, "nsec": 1e-9, "nsecs": 1e-9, "usec": 1e-6, "microsec": 1e-6}
"""Ending of a column name -> unit [s] of the fraction of a second that the column holds. Another column holds the whole
seconds of this time stamp."""
FRACTION = re.compile(rf"(.*?)({'|'.join(FRACTIONS)})")
MAX_LATE_SHARE = 0.01
"""Maximum fraction of rows whose time does not exceed all earlier times. In a table of more than 51 rows, 0.2 is added
to it. Up to this fraction, such rows are dropped. With more of them, the column is not taken as a clock."""
MAX_REPEATS = 0.02
"""Maximum fraction of rows that repeat the time of the row before. With a larger fraction, the clock may have too few
digits. The rows are then tested for even spacing in time."""
MIN_CHANGES = 10
"""Minimum number of value changes of a clock with too few digits. With this number, the time between two rows is known
to about 2 %. A clock with fewer changes is not used."""
MIN_PART = 20
"""Minimum number of rows of each recording, if one file holds several recordings one after the other. A shorter stretch
of decreased times counts as a few late messages."""
MAX_PARTS = 50
"""Maximum number of recordings in one file. A column that decreases more often is a sawtooth and not a clock."""
LATEST = np.iinfo(np.int64).min
"""Integer that pandas gives for a date that it cannot read. Such a cell counts as a missing time."""


class Clock(NamedTuple):
    """One candidate for the clock of a recording: a column or a formula, and the unit of its times.

    The unit is empty if the column counts rows, because the time between two rows is then unknown. The user must state
    this time.
    """

    column: str
    unit: str
    weight: float
    "logarithm of the prior probability"
    formula: str = ""
    even: bool = False
    "whether the column has too few digits, so that the rows are assumed to be evenly spaced in time"
    dates: bool = False
    "whether the column holds dates or times of day as text; its numbers are then nanoseconds"

    def recording(self, table: pd.DataFrame, helpers: Mapping[str, Entry] = MappingProxyType({})) -> Recording:
        """Return the rows of a table with their times by this clock. A row whose time does not exceed all earlier times
        is dropped.

        Raises DataError: no row of the clock's column holds a time.
        """
        t = _seconds(table, self)
        # A simulation needs increasing times, so repeated and late rows are dropped.
        ahead = is_ahead(t)
        if not ahead.any():
            raise DataError(
                f"column '{self.column}' was taken as the clock, but none of its rows holds a time: give the column of "
                "the clock by --column t_s='COLUMN'."
            )
        return Recording(t[ahead] - t[ahead][0], table[ahead].reset_index(drop=True), helpers)

    def description(self, table: pd.DataFrame) -> str:
        """Return a text for the user about this clock: its column, its unit, assumptions, and the number of dropped
        rows.
        """
        t = _seconds(table, self)
        dropped = len(table) - int(np.sum(is_ahead(t)))
        # Everything that the file does not state itself is marked, because the user must check it.
        unit = "read as dates or times of day" if self.dates else f"in {self.unit}"
        text = self.formula or f"'{self.column}' {unit}"
        if self.even:
            values = times(table[self.column])
            text += (
                f", GUESSED: its {len(values)} rows have only {len(np.unique(values[np.isfinite(values)]))} distinct "
                f"times, {_form(values, self.unit)}. So the rows are assumed to be evenly spaced by "
                f"{np.median(np.diff(t)):.4g} s, which agrees with all recorded times"
            )
        late = f"; {dropped} rows are left out, because their times do not exceed all earlier times"
        return text + (late if dropped else "")


def _seconds(table: pd.DataFrame, clock: Clock) -> np.ndarray:
    """Return the time of each row by this clock [s] (rows,), counted from the clock's first time; NaN for a row without
    a time.
    """
    if clock.formula:
        columns = {"row": np.arange(len(table), dtype=float)}
        columns |= {str(name): table[name].to_numpy(dtype=float) for name in table}
        return evaluate(clock.formula, columns, "the column t_s")
    values, factor = times(table[clock.column]), SECONDS.get(clock.unit, 1.0)
    if clock.even:
        even = even_times(values)
        return factor * (even if even is not None else np.full(len(values), np.nan))
    return factor * values


def times(values: pd.Series) -> np.ndarray:
    """Return the numbers of a column minus its first number (rows,). An empty cell and an unreadable date give NaN.

    The first number is subtracted before the conversion to float, so that a time stamp of 19 digits keeps its
    nanoseconds.
    """
    raw = values.to_numpy()
    known = np.isfinite(raw.astype(float)) & (raw != LATEST)
    if not known.any():
        return np.full(len(raw), np.nan)
    return np.where(known, (raw - raw[known][0]).astype(float), np.nan)


def clocks(
    table: pd.DataFrame,
    declared: str,
    path: Path,
    dates: Sequence[str] = (),
    texts: Mapping[str, str] = MappingProxyType({}),
) -> list[Clock]:
    """Return the candidates for the clock of a table: each column that increases like a clock, in each unit that it may
    have.

    Parameters
    ----------
    table : DataFrame
        The numbers of one recording, one row for each sample.
    declared : str
        Column or formula that the user stated as the clock; '' if the user stated none. A formula may use `row`, the
        row number counted from 0.
    path : Path
        The file, for the error message.
    dates : sequence of str
        Columns that were read from dates and now hold nanoseconds.
    texts : mapping
        Column without numbers -> its first non-numeric cell, for the error message.

    Returns
    -------
    list of Clock
        The candidates. A column whose name does not mean time is a candidate only if its numbers increase evenly, and
        if there is no column whose name means time.

    Raises
    ------
    DataError
        No column increases like a clock. For each column whose name means time, the message states why the column is
        not usable.
    """
    if declared and declared not in table:
        return [Clock("t_s", "s", 0.0, declared)]
    # A formula cannot be checked before it is evaluated, so it is taken as it is. Otherwise each column is tested:
    # first for a coarse clock of evenly spaced rows, then for one that increases from row to row.
    words = [item._replace(unit="ns") if item.name in dates else item for item in words_of(table)]
    if declared:
        words = [item for item in words if item.name == declared]
    candidates: list[tuple[int, Word, bool]] = []
    for item in words:
        values, rank = times(table[item.name]), 1 if declared else _rank(item)
        # Repeated times mean that the clock has too few digits. If most rows with a repeated time repeat all other
        # cells too, the rows are doubled instead, and one of two equal rows is dropped later.
        is_coarse = rank < 3 and _repeats(values) > MAX_REPEATS
        again = np.flatnonzero(values[1:] == values[:-1]) + 1
        if is_coarse and again.size:
            before, after = (table.iloc[again + shift].to_numpy(dtype=float) for shift in (-1, 0))
            is_coarse = bool(np.mean(np.all((before == after) | np.isnan(after), axis=1)) <= 0.5)
        if is_coarse and even_times(values) is not None:
            candidates.append((rank, item, True))
        elif _runs(values, rank):
            candidates.append((rank, item, False))
    # If the name of some column means time, columns that are merely even (rank 3) are no candidates, even if the cells
    # of the named column cannot be read: the error then shows such a cell.
    best = min((rank for rank, _, _ in candidates), default=0)
    if best == 3 and any(word(name).has(TIME) for name in texts):
        candidates = []
    options = [
        clock._replace(dates=item.name in dates)
        for rank, item, even in candidates
        if rank <= max(best, 2)
        for clock in _in_units(table[item.name], item, rank, even)
    ]
    if options:
        return options
    # Without a clock, the error states why each column whose name means time is not usable.
    reasons = []
    for item in words:
        if _rank(item) < 3:
            values = times(table[item.name])
            first = next(iter(table[item.name][np.isfinite(values)]), math.nan)
            is_constant = np.unique(values[np.isfinite(values)]).size == 1
            constant_fault = (
                f"has the time {first:.10g} in all of its {len(values)} rows, like a stamp printed with too few digits"
            )
            reasons.append(f"'{item.name}' {constant_fault if is_constant else clock_fault(values, item.unit)}")
    reasons += [
        f"'{name}' holds {cell!r}, which cannot be read as a time (s, ms, 2026-05-01T10:00:00.05, 10:00:00.05)"
        for name, cell in texts.items()
        if word(name).has(TIME)
    ]
    advice = "give --column t_s='COLUMN', or --column t_s='row / RATE' if the rows are evenly spaced in time"
    if reasons:
        raise DataError(
            f"{path}: the clock cannot be read: {'; '.join(reasons)}. Export the clock with more digits, or {advice}."
        )
    raise DataError(
        f"{path}: no column can be the clock: no column is named time, stamp or t_s, and none of the columns "
        f"{', '.join(item.name for item in words)} increases evenly from row to row. To state the clock, {advice}."
    )


def clock_fault(values: np.ndarray, unit: str = "") -> str:
    """Return the reason why a column (rows,) cannot be the clock, as a verb phrase for an error message.

    The phrase states the number of distinct times, their resolution, or the first row at which the times decrease.
    """
    known = values[np.isfinite(values)]
    # The faults are tested in the order in which they hide each other: too few numbers, decreases, too few digits.
    if known.size < 2:
        return f"has a number in only {known.size} of {len(values)} rows"
    distinct, falls = len(np.unique(known)), np.flatnonzero(np.diff(known) < 0.0)
    if known.size < 0.5 * len(values):
        return f"has a number in only {known.size} of {len(values)} rows"
    if falls.size:
        at = int(np.flatnonzero(np.isfinite(values))[falls[0] + 1]) + 1
        return f"falls back {falls.size} times in {len(values)} rows, first at row {at}"
    text = f"has {distinct} distinct times in {len(values)} rows, {_form(values, unit)}"
    if distinct < 2 or np.sum(np.diff(known) > 0.0) < MIN_CHANGES:
        return f"{text}, which are too few to determine the time between rows"
    # Numbers of rows that share one time: they vary if the rows are unevenly spaced.
    lengths = np.diff(np.flatnonzero(np.diff(known, prepend=-np.inf) > 0.0))
    return f"{text}; each time is shared by {lengths.min()} to {lengths.max()} rows, so the rows are not evenly spaced"


def _form(values: np.ndarray, unit: str) -> str:
    """Return a phrase for the resolution of a clock, for example "in tenths of a second".

    The resolution is the largest power of ten that divides every step of the clock.
    """
    steps = np.unique(np.abs(np.diff(values[np.isfinite(values)])))
    steps = steps[steps > 0.0]
    if not steps.size:
        return "all the same"
    # The search begins at the power of ten below the smallest step and goes down until all steps are multiples of it.
    for power in range(math.floor(math.log10(steps.min()) + 1e-9), -10, -1):
        if np.all(np.abs(steps / 10.0**power - np.round(steps / 10.0**power)) < 1e-3):
            step = 10.0**power * SECONDS.get(unit, 1.0)
            break
    else:
        step = float(steps.min()) * SECONDS.get(unit, 1.0)
    if unit in SECONDS:
        words = {1.0: "in whole seconds", 0.1: "in tenths of a second", 60.0: "in whole minutes"}
        return next((text for size, text in words.items() if math.isclose(size, step)), f"in steps of {step:.3g} s")
    return f"in steps of {step:.10g}"


def even_times(values: np.ndarray) -> np.ndarray | None:
    """Return evenly spaced times (rows,) that agree with every stamp of a clock with too few digits; None if no such
    times exist.

    A time stamp with too few digits stays constant over several rows. If the rows are evenly spaced in time, the rows
    at which the stamp changes lie on a straight line, whose slope is the time between two rows. If a change is farther
    from this line than one step of the rows, rows are missing or unevenly spaced, and the result is None.
    """
    rows = np.flatnonzero(np.isfinite(values))
    stamps = values[rows]
    changes = np.flatnonzero(np.diff(stamps) > 0.0) + 1
    if np.any(np.diff(stamps) < 0.0) or changes.size < MIN_CHANGES or len(rows) < len(values) * (1.0 - MAX_LATE_SHARE):
        return None
    # The stamp changed at some time between the last old row and the first new row: half a row earlier on average.
    step, first = np.polyfit(rows[changes] - 0.5, stamps[changes], 1)
    residual = stamps[changes] - first - step * (rows[changes] - 0.5)
    if not step > 0.0 or np.max(np.abs(residual)) > step:
        return None
    return np.asarray(step * np.arange(len(values)))


def _repeats(values: np.ndarray) -> float:
    """Return the fraction of rows whose time equals the time of the row before."""
    known = values[np.isfinite(values)]
    return float(np.mean(np.diff(known) == 0.0)) if known.size > 1 else 0.0


def whole_stamps(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with the two columns of each ROS time stamp (seconds and fraction) joined to one column [s]."""
    for fraction in map(str, table.columns):
        # The whole seconds have the same name with the ending "sec" or "secs".
        match = FRACTION.fullmatch(fraction)
        seconds = next((name for end in ("sec", "secs") if match and (name := match[1] + end) in table), None)
        if match and seconds:
            stamp = table[seconds] + FRACTIONS[match[2]] * table[fraction]
            prefix = match[1].rstrip("._/ ")
            name = f"{prefix} [s]" if prefix.endswith("stamp") else f"{prefix} stamp [s]".strip()
            # The joined column replaces the seconds at their position, because the nearest clock of a series may be
            # the one to its left.
            at = list(table.columns).index(seconds)
            table = table.drop(columns=[seconds, fraction])
            table.insert(min(at, table.shape[1]), name, stamp)
    return table


def restarts(t: np.ndarray) -> list[int]:
    """Return the rows at which another recording begins in the file, because the clock decreases there and goes on.

    The list is empty if the file holds one recording. A late message also has a smaller time than the row before, but
    the following rows soon exceed the earlier maximum again.
    """
    rows = np.flatnonzero(np.isfinite(t))
    stamps = t[rows]
    falls = np.flatnonzero(np.diff(stamps) < 0.0) + 1
    if not falls.size or falls.size > 0.05 * len(stamps):
        return []
    step = float(np.median(np.abs(np.diff(stamps))))
    begins: list[int] = []
    for fall in falls:
        last = begins[-1] if begins else 0
        top = float(np.max(stamps[last:fall], initial=-np.inf))
        # After a late message, the times exceed the old maximum within a few rows. A second recording starts far below
        # this maximum and increases steadily from there.
        later = stamps[fall : fall + MIN_PART]
        is_restart = top - stamps[fall] > MIN_PART * step and np.all(later < top) and np.mean(np.diff(later) >= 0) > 0.8
        if is_restart and len(later) == MIN_PART and fall - last >= MIN_PART:
            begins.append(int(fall))
    return [int(rows[fall]) for fall in begins] if len(begins) < MAX_PARTS else []


def wrapped_clock(values: np.ndarray, begins: Sequence[int]) -> np.ndarray | None:
    """Return the times of a clock that overflowed, continued past each overflow; None if the decreases are no
    overflows.

    Overflows are recognised by their size: the range of a counter of 16 or 32 bits, of an hour or a day in s, of a day
    in ms, or of a week in s or ms.

    Parameters
    ----------
    values : array (rows,)
        The clock as recorded.
    begins : sequence of int
        Rows at which the clock decreases, from `restarts`.
    """
    steps = np.diff(values)
    usual = float(np.nanmedian(np.abs(steps)))
    # After an overflow of the full range, the next time is one usual step further on. A fall of another size means
    # that another recording begins.
    for size in (2.0**16, 2.0**32, 86400.0, 3600.0, 86_400_000.0, 604_800.0, 604_800_000.0):
        falls = [steps[begin - 1] for begin in begins]
        if all(abs(fall + size - usual) < 5.0 * usual for fall in falls) and size > 100.0 * usual:
            turns = np.zeros(len(values))
            turns[list(begins)] = size
            return np.asarray(values + np.cumsum(turns))
    return None


def is_ahead(t: np.ndarray) -> np.ndarray:
    """Return a mask (rows,) that is True for a row whose time exceeds all earlier times. A row without a time (NaN) is
    False.
    """
    before = np.maximum.accumulate(np.concatenate([[-np.inf], np.nan_to_num(t[:-1], nan=-np.inf)]))
    return np.isfinite(t) & (before < t)


def _rank(item: Word) -> int:
    """Return how clearly the name of a column means the clock, as a rank from 0 (clearest) to 3 (not at all).

    The rank is 0 for the name t_s, 1 for another name that means time and states a unit of time, 2 for a name that
    means time without such a unit, and 3 for all other names.
    """
    if item.name == "t_s":
        return 0
    if item.has(TIME) and item.unit in SECONDS:
        return 1
    return 2 if item.has(TIME) else 3


def clock_words(table: pd.DataFrame) -> list[Word]:
    """Return the columns whose names mean time, sorted so that the clearest name comes first."""
    return sorted((item for item in words_of(table) if _rank(item) < 3), key=_rank)


def _runs(t: np.ndarray, rank: int) -> bool:
    """Return whether a column increases from row to row like a clock, with few exceptions.

    If the name of the column does not mean time (rank 3 of `_rank`), the times must also be evenly spaced. A column
    with only the nanoseconds of time stamps is a sawtooth: hardly any of its rows exceeds all earlier rows. For such a
    column the result is False.
    """
    # In a long table, a fifth of the rows more may be late or repeated.
    steps = np.diff(t[np.isfinite(t)])
    if not steps.size or np.mean(is_ahead(t)[np.isfinite(t)]) < 1.0 - MAX_LATE_SHARE - 0.2 * (steps.size > 50):
        return False
    middle = float(np.median(steps))
    return rank < 3 or bool(np.mean(np.abs(steps - middle) < 0.2 * middle) > 0.9)


def _in_units(values: pd.Series, item: Word, rank: int, even: bool) -> Iterator[Clock]:
    """Yield one candidate for the clock for each unit that a column may have, with the log prior of the unit.

    A stated unit is certain. If no unit is stated, each unit is weighted by the prior of the row spacing that it
    implies. Whole numbers that increase by one from row to row may also count rows, and such a counter has no unit.
    """
    if item.unit in SECONDS or item.name == "t_s":
        yield Clock(item.name, item.unit or "s", 0.0, even=even)
        return
    t = times(values)
    known = t[np.isfinite(t)]
    # Repeated times make the median step 0. Then the step of evenly spaced rows is the time span over the number of
    # steps.
    step = float(np.median(np.diff(known))) or float(np.ptp(known)) / max(len(known) - 1, 1)
    size = float(np.nanmedian(np.abs(values.to_numpy(dtype=float))))
    if step == 1.0 and np.all(known == np.round(known)) and not even:
        yield Clock(item.name, "", 0.0)
        if rank == 3:
            return
    # If the numbers are dates since 1970 in some unit, this unit is certain. Otherwise the prior of the unit is its
    # usual frequency.
    for unit, share in UNIT_PRIORS.items():
        prior = 0.0 if SINCE_1970[0] < size * SECONDS[unit] < SINCE_1970[1] else math.log(share)
        density = -0.5 * ((math.log(step * SECONDS[unit]) - LOG_STEP) / LOG_STEP_SD) ** 2
        yield Clock(item.name, unit, prior + density, even=even)
