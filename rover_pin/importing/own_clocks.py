"""Resample a table whose columns have different clocks to one clock, for example a plotter's export of several topics.

A series is a group of columns that are measured together. Two layouts of such tables occur. In the first, each row
holds one series and has empty cells for the others. In the second, the series are next to each other, each with its own
column of times. `on_common_clock` recognises both layouts. A table with a single clock is returned unchanged.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files import column_names as called
from rover_pin.base.files.column_names import word
from rover_pin.importing.clock import SECONDS, SINCE_1970, clock_words, is_ahead, times
from rover_pin.logs.resampling import MIN_MESSAGES, on_one_clock

ALTERNATION = 0.1
"""Minimum number of places where a column's numbers stop and empty cells begin, as a fraction of the column's rows.
From this number on, the rows of the table alternate between series; with fewer places, the gaps are failures of a
sensor, which are few and long."""
ISOLATED = 0.5
"""Minimum fraction of a column's numbers that are followed by an empty cell. From it on, the column counts as a slow
series between the rows of faster ones."""
MAX_STAMP_OFFSET = 1.0
"""Maximum median difference between the time stamps of a series and the clock of the rows [s]. If the difference is
larger, the stamps belong to another clock, and the clock of the rows is used for the series."""
MAX_DRIFT = 5.0
"""Maximum change of the difference between two clocks over a recording, as a multiple of their step. Up to this value,
both clocks count as one."""
MIN_OVERLAP = 0.5
"""Minimum time that two series have in common, as a fraction of the shorter one. With less overlap, their clocks count
from different starting points, and the table is refused."""


class Series(NamedTuple):
    """Columns that are measured together, with their clock.

    `t` holds the time of each row of the table by this clock [s], and NaN in rows where the series has no sample.
    """

    clock: str
    t: np.ndarray
    columns: tuple[str, ...]


def on_common_clock(
    path: Path, table: pd.DataFrame, dates: Sequence[str], declared: str = ""
) -> tuple[pd.DataFrame, list[str]]:
    """Return the table with all columns interpolated on one clock `t_s`, and a note for the user.

    A table with a single clock is returned unchanged and without a note. The times of a series are its own time stamps
    if it has any and if they agree with the clock of the rows. Otherwise its times come from the clock of the rows.

    Parameters
    ----------
    path : Path
        The file, for notes and error messages.
    table : DataFrame
        The numbers of one recording.
    dates : sequence of str
        Columns that were read from dates and hold nanoseconds.
    declared : str
        Column that the user named as the clock of the rows, or ''.

    Raises
    ------
    DataError
        A series has no clock, or its clock has no time in common with the other clocks. The message names the columns.
    """
    clocks = {item.name: _absolute(table, item.name, item.unit, dates) for item in clock_words(table)}
    clocks = {name: t for name, t in clocks.items() if np.isfinite(t).sum() >= MIN_MESSAGES}
    data = [str(name) for name in table if name not in clocks]
    has_alternating_rows = any(_is_sparse(table[name].to_numpy(dtype=float)) for name in data)
    full = np.isfinite(np.array(list(clocks.values()))).mean(axis=1) > 0.99 if clocks else np.zeros(0)
    row_clocks = [name for name, is_full in zip(clocks, full, strict=True) if is_full and _increases(clocks[name])]
    # Columns with many short gaps mean that the rows alternate between series; several unrelated clocks mean that the
    # series lie side by side. Otherwise all columns are on one clock already.
    if has_alternating_rows:
        row_clock = declared if declared in clocks else next(iter(row_clocks), "")
        # Columns that have numbers in common rows form one series. Up to 5 % of the rows may differ, because single
        # cells of a message may be missing.
        groups: list[tuple[np.ndarray, list[str]]] = []
        for name in data:
            known = np.isfinite(table[name].to_numpy(dtype=float))
            for mask, names in groups:
                if np.sum(known != mask) <= 0.05 * max(np.sum(known | mask), 1):
                    names.append(name)
                    break
            else:
                groups.append((known, [name]))
        series = [_alternating(path, table, clocks, row_clock, names) for _, names in groups]
    elif len(clocks) > 1 and not declared and not _same_instants(clocks):
        row_clock, series = "", _side_by_side(table, clocks, data)
    else:
        return table, []
    series = [item for item in series if item.columns]
    # Clocks that have no time in common cannot be compared, as one since 1970 and one since the computer's start.
    for item in series[1:]:
        (a, b), (c, d) = ((float(np.nanmin(part.t)), float(np.nanmax(part.t))) for part in (series[0], item))
        if min(b, d) - max(a, c) < MIN_OVERLAP * min(b - a, d - c):
            raise DataError(
                f"{path}: '{series[0].clock}' runs from {a:.10g} to {b:.10g} s, but '{item.clock}', the clock of "
                f"{_short(item.columns)}, runs from {c:.10g} to {d:.10g} s: these clocks share no time, or too little. "
                "Export both series with time stamps of one clock."
            )
    # Times are counted from the first sample in whole nanoseconds, so that long stamps keep their digits.
    begin = min(float(np.nanmin(item.t)) for item in series)
    samples, held = {}, set()
    for item in series:
        for name in item.columns:
            values = table[name].to_numpy(dtype=float)
            use = np.isfinite(values) & np.isfinite(item.t)
            if use.sum() >= MIN_MESSAGES:
                samples[name] = (np.round(1e9 * (item.t[use] - begin)).astype(np.int64), values[use])
                # Commands and duties keep their value until the next message, so they are not interpolated.
                held |= {name} if word(name).has(called.COMMAND | called.DUTY) else set()
    joined, period = on_one_clock(path, samples, held)
    order = [name for name in data if name in joined]
    clock_notes = ", ".join(f"{_short(item.columns)} by '{item.clock}'" for item in series)
    note = (
        f"{path.name}: its columns have {len(series)} different clocks, so all columns are interpolated to one clock "
        f"with a row every {period:g} s: {clock_notes}"
    )
    return joined[["t_s", *order]], [note]


def _absolute(table: pd.DataFrame, name: str, unit: str, dates: Sequence[str]) -> np.ndarray:
    """Return the times of a clock in all rows [s], counted from the clock's own starting point; NaN in a row without a
    time.

    If the column name states no unit, the unit is the one that makes the times dates since 1970. If no unit gives such
    dates, the unit is the one with a row spacing nearest to 50 ms.
    """
    values = table[name].to_numpy(dtype=float)
    t = times(table[name])
    first = values[np.isfinite(t)][0] if np.isfinite(t).any() else 0.0
    if name in dates:
        unit = "ns"
    if unit not in SECONDS:
        steps = np.diff(t[np.isfinite(t)])
        step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 1.0
        since_1970 = [u for u in ("s", "ms", "us", "ns") if SINCE_1970[0] < first * SECONDS[u] < SINCE_1970[1]]
        usual = min(("s", "ms", "us", "ns"), key=lambda u: abs(np.log(step * SECONDS[u] / 0.05)))
        unit = since_1970[0] if since_1970 else usual
    return np.asarray(SECONDS[unit] * (first + t))


def _is_sparse(values: np.ndarray) -> bool:
    """Return whether a column (rows,) is empty in many short stretches, because the rows between its numbers hold other
    series.
    """
    known = np.isfinite(values)
    if known.sum() < MIN_MESSAGES or known.all():
        return False
    # Empty cells before the first and after the last number only mean that the column begins later or ends earlier.
    inside = known[np.argmax(known) : len(known) - np.argmax(known[::-1])]
    ends = int(np.sum(inside[:-1] & ~inside[1:]))
    return ends > ALTERNATION * len(inside) or (ends > ISOLATED * known.sum() and ends > MIN_MESSAGES)


def _increases(t: np.ndarray) -> bool:
    """Return whether a column of times increases in more than 90 % of its rows."""
    return bool(np.mean(is_ahead(t)[np.isfinite(t)]) > 0.9) if np.isfinite(t).any() else False


def _alternating(
    path: Path, table: pd.DataFrame, clocks: Mapping[str, np.ndarray], row_clock: str, names: Sequence[str]
) -> Series:
    """Return one group of columns that are measured together as a series with a clock, for a table of alternating rows.

    The clock is a column with the group's own time stamps, or else the clock of all rows of the table.

    Parameters
    ----------
    clocks : mapping
        Column of times -> its times [s] in all rows.
    row_clock : str
        The clock that has a time in every row, or ''.
    names : sequence of str
        The columns of the group.
    """
    known = np.isfinite(table[list(names)].to_numpy(dtype=float)).any(axis=1)
    # Candidates are clocks with increasing times in the rows of this group.
    stamps = {
        name: t
        for name, t in clocks.items()
        if name != row_clock and np.isfinite(t[known]).mean() > 0.9 and _increases(t[known])
    }
    # A stamp in all rows does not belong to this group in particular, unless its name begins like the group's names.
    stamps = {name: t for name, t in stamps.items() if np.isfinite(t).mean() < 0.99 or _shared(name, names) > 0}
    stamp = max(stamps, key=lambda name: _shared(name, names), default="")
    if stamp and row_clock:
        offset = stamps[stamp][known] - clocks[row_clock][known]
        if abs(float(np.nanmedian(offset))) > MAX_STAMP_OFFSET:
            stamp = ""
    if stamp or row_clock:
        return Series(stamp or row_clock, np.where(known, clocks[stamp or row_clock], np.nan), tuple(names))
    raise DataError(
        f"{path}: the numbers of {_short(names)} are in rows of their own, and no column holds the times of these "
        "rows: name the clock of all rows by --column t_s='COLUMN', or export each series with its time stamps."
    )


def _same_instants(clocks: Mapping[str, np.ndarray]) -> bool:
    """Return whether all increasing clocks of a table differ by a constant only, so that one of them is enough for all
    columns.
    """
    running = [t for t in clocks.values() if _increases(t) and np.isfinite(t).sum() > 10]
    for other in running[1:]:
        both = np.isfinite(running[0]) & np.isfinite(other)
        if both.sum() < 10:
            continue
        offset = (other - running[0])[both]
        step = max(float(np.median(np.diff(t[both]))) for t in (running[0], other))
        lengths = np.ptp(running[0][both]), np.ptp(other[both])
        # A difference that changes over the recording means that the samples of a row were not taken at the same time.
        if abs(offset[-1] - offset[0]) > max(MAX_DRIFT * step, 0.02 * max(lengths)):
            return False
        # A clock that is missing in many rows belongs to a shorter series.
        if len(both) - both.sum() > 0.05 * len(both):
            return False
    return True


def _side_by_side(table: pd.DataFrame, clocks: Mapping[str, np.ndarray], data: Sequence[str]) -> list[Series]:
    """Return the series of a table with series next to each other, each after its own column of times.

    Each column is assigned to the clock with an equal number of rows whose name begins with the words of the column's
    name. If several clocks fit equally well, the nearest clock to the left of the column is taken.
    """
    order = [str(name) for name in table]
    running = {name: t for name, t in clocks.items() if _increases(t)}
    members: dict[str, list[str]] = {name: [] for name in running}
    for name in data:
        rows = int(np.isfinite(table[name].to_numpy(dtype=float)).sum())

        def fit(clock: str, name: str = name, rows: int = rows) -> tuple[int, bool, int]:
            """Return a rank for the fit of a clock to a column: names and lengths count first, then the position."""
            difference = abs(int(np.isfinite(running[clock]).sum()) - rows)
            before = order.index(clock) < order.index(name)
            distance = abs(order.index(clock) - order.index(name))
            return _shared(clock, [name]) - (difference > 0.02 * len(table)), before, -distance

        members[max(running, key=fit)].append(name)
    return [Series(clock, running[clock], tuple(names)) for clock, names in members.items()]


def _shared(clock: str, names: Sequence[str]) -> int:
    """Return the fit of a clock's name to the name of the first column: the number of equal first words."""
    first, second = word(clock).tokens, word(names[0]).tokens
    return next(
        (at for at, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), min(map(len, (first, second)))
    )


def _short(names: Sequence[str]) -> str:
    """Return a list of column names as a short text for a message: the first name in quotes, and the number of the
    other names.
    """
    return f"'{names[0]}'" + (f" and {len(names) - 1} more" if len(names) > 1 else "")
