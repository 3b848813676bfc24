"""Find cells of a recording that hold a number but no measurement, and empty them.

Such cells hold a code such as -9999, a position of 0, 0, or the repeated position of a frozen tracker.
`drop_lost_values` empties them before the columns are matched, because a single code can make a position jump by
kilometres.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files import column_names as called
from rover_pin.base.files.column_names import Word
from rover_pin.importing.clock import clock_words, is_ahead
from rover_pin.importing.recording import words_of

MAX_NUMBER = 1e12
"""Maximum absolute value of a measured number in any unit. A larger number, such as 1e20, is taken as a code for a
missing value."""
CODES = {sign * code for sign in (-1.0, 1.0) for code in (
    99.0, 999.0, 9999.0, 99999.0, 999999.0, 9999999.0, 99.99, 999.9, 999.99, 9999.9, 9999.99, 999.999, 32767.0,
    32768.0, 65535.0, 1e6, 1e9, 2147483647.0, 2147483648.0, 4294967295.0)}  # fmt: skip
"""Numbers that programs write in place of a missing measurement, such as -9999."""
MIN_JUMP = 20.0
"""Minimum distance of a code for a missing value from the rows before and after it, as a multiple of the usual step
from row to row. A rover that drives over the position 0, 0 makes no such jump, so its positions are kept."""
MIN_DISTANCE = 3.0
"""Minimum distance of a code for a missing value from the median of its column, as a multiple of the range of the
column's other values. The limit applies to columns other than positions: currents and rates jump whenever a motor
starts, so a jump alone does not show a code."""
MIN_REPEATS = 3
"""Minimum number of rows with exactly one coordinate. From this number on, the coordinate is tested as a code for a
missing position, although `CODES` does not list it."""
MIN_FROZEN, FROZEN_RATIO = 5, 10.0
"""Minimum number of equal rows of a frozen position: as a number of rows, and as a multiple of the usual number of
equal rows. A receiver of 1 Hz in rows of 20 Hz repeats each position 20 times and is not frozen."""
MAX_LOST_SHARE = 0.5
"""Maximum fraction of a position's rows that may be without a measurement. If the fraction is larger, the recording is
refused."""


class Lost(NamedTuple):
    """Cells of a recording that hold no measurement: their columns, a mask of their rows (rows,), and the reason in
    words.
    """

    columns: tuple[str, ...]
    rows: np.ndarray
    reason: str


def drop_lost_values(path: Path, table: pd.DataFrame, dates: Sequence[str]) -> tuple[pd.DataFrame, list[str]]:
    """Return the table with empty cells in place of codes and frozen positions, and one note for each code or frozen
    column.

    Parameters
    ----------
    path : Path
        The file, for notes and error messages.
    table : DataFrame
        The numbers of one recording.
    dates : sequence of str
        Columns that were read from dates. Times are never taken as codes.

    Raises
    ------
    DataError
        More than half of the rows of a position hold no measurement. The message states the code and the rows.
    """
    clocks = {item.name for item in clock_words(table)} | set(dates)
    words = [item for item in words_of(table) if item.name not in clocks]
    pairs = list(_places(words))
    # A number larger than MAX_NUMBER is no measurement. Columns that have the same such number in the same rows share
    # one finding. A column that nearly always increases is a counter or a clock without a name, and may be huge.
    huge: dict[tuple[float, bytes], list[str]] = {}
    for name in (item.name for item in words):
        values = table[name].to_numpy(dtype=float)
        if np.mean(is_ahead(values)) <= 0.9:
            for value in np.unique(values[np.abs(values) > MAX_NUMBER])[:3]:
                huge.setdefault((float(value), (values == value).tobytes()), []).append(name)
    findings = [
        Lost(tuple(names), np.frombuffer(rows, dtype=bool), f"{value:g}") for (value, rows), names in huge.items()
    ]
    findings += _codes(table, words, pairs)
    cleaned = _without(table, findings)
    # Codes are removed first: a code between two frozen stretches would look like the jump that ends one.
    # A frozen position repeats one value, then jumps to the rover's present position.
    frozen: list[Lost] = []
    for x, y in pairs:
        # Both coordinates are one complex number, so that a step is zero only if neither changes.
        place = cleaned[x].to_numpy(dtype=float) + 1j * cleaned[y].to_numpy(dtype=float)
        known = np.flatnonzero(np.isfinite(place))
        if known.size < 4 * MIN_FROZEN:
            continue
        steps = np.abs(np.diff(place[known]))
        usual = float(np.median(steps))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], steps == 0.0, [False]]).astype(int))).reshape(-1, 2)
        lengths = np.diff(edges, axis=1).ravel() + 1
        if not lengths.size:
            continue
        # Stretches of a single row count too. They are the usual case if the position changes from row to row.
        single = int(np.sum(steps > 0.0)) + 1 - len(lengths)
        typical = float(np.median(np.concatenate([np.ones(max(single, 0)), lengths])))
        min_length = max(MIN_FROZEN, FROZEN_RATIO * (typical if typical > 1.0 else 0.5))
        is_frozen = np.zeros(len(place), dtype=bool)
        for (begin, end), length in zip(edges, lengths, strict=True):
            # A rover that really stood still goes on from its position by a usual step. After a frozen position, the
            # next step covers the whole distance driven meanwhile.
            exit_jump = steps[end] if end < len(steps) else 0.0
            moved_on = exit_jump > 0.5 * (length - 1) * usual and exit_jump > 3.0 * usual
            if length >= min_length and usual > 0.0 and moved_on:
                is_frozen[known[begin + 1 : end + 1]] = True
        if is_frozen.any():
            frozen.append(Lost((x, y), is_frozen, "frozen at an earlier value"))
    cleaned = _without(cleaned, frozen)
    for item in (*findings, *frozen):
        if item.columns[0] in {name for pair in pairs for name in pair} and item.rows.mean() > MAX_LOST_SHARE:
            raise DataError(
                f"{path}: {_description(item)}. More than half of the {len(table)} rows have no position, which is too "
                "few to compare. Give other columns for body_x and body_y by --column, or leave this recording out."
            )
    return cleaned, [f"{path.name}: {_description(item)}: left out" for item in (*findings, *frozen)]


def _without(table: pd.DataFrame, findings: Sequence[Lost]) -> pd.DataFrame:
    """Return the table of a recording with empty cells where the given findings state that a cell holds no
    measurement.
    """
    columns = {str(name): table[name] for name in table}
    for item in findings:
        columns |= {name: columns[name].astype(float).where(~item.rows) for name in item.columns}
    return pd.DataFrame(columns)


def _description(item: Lost) -> str:
    """Return a text for the user on cells without a measurement: their columns, the reason, and their rows, counted
    from 1.

    At most five stretches of rows are listed.
    """
    # Neighbouring rows are joined to stretches such as "101 to 105", because a list of all rows would be too long.
    rows = np.flatnonzero(item.rows) + 1
    groups = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    texts = [f"{group[0]}" if len(group) == 1 else f"{group[0]} to {group[-1]}" for group in groups]
    more = f" and {len(texts) - 4} more stretches" if len(texts) > 5 else ""
    verb = "is" if len(item.columns) == 1 else "are"
    named = " and ".join(f"'{name}'" for name in item.columns[:4])
    return (
        f"{named} {verb} {item.reason} in {len(rows)} rows ({', '.join(texts[: 4 if more else 5])}{more}), so these "
        "cells hold no measurement"
    )


def _places(words: Sequence[Word]) -> Iterator[tuple[str, str]]:
    """Yield the pairs of columns that may form a position: x and y, or latitude and longitude.

    Both names must be equal apart from these letters, such as `gps x` and `gps y`.
    """
    for first, second in ((called.X, called.Y), (called.LATITUDE, called.LONGITUDE)):
        for x in (item for item in words if item.has(first) and not item.has(called.NO_PLACE)):
            for y in (item for item in words if item.has(second) and not item.has(called.NO_PLACE)):
                if set(x.tokens) - first == set(y.tokens) - second:
                    yield x.name, y.name


def _codes(table: pd.DataFrame, words: Sequence[Word], pairs: Sequence[tuple[str, str]]) -> Iterator[Lost]:
    """Yield the cells that hold a code for a missing value, such as -9999: first in positions, then in all other
    columns.

    If other columns, for example the height, hold the code of a position in these rows, their cells are yielded too.
    """
    numbers = {item.name: table[item.name].to_numpy(dtype=float) for item in words}
    taken: set[str] = set()
    for x, y in pairs:
        x_values, y_values = numbers[x], numbers[y]
        # Possible codes are 0, listed codes, and numbers that occur several times. If positions are printed in mm or
        # held over several rows, most numbers repeat, and a repeated number is no sign of a code.
        distinct, count = np.unique(x_values[np.isfinite(x_values)], return_counts=True)
        is_coarse = distinct.size < 0.2 * count.sum()
        repeated = [] if is_coarse else distinct[count >= MIN_REPEATS].tolist()[:20]
        for value in dict.fromkeys((0.0, *sorted(CODES), *repeated)):
            if value not in distinct:
                continue
            both = (x_values == value) & (y_values == value)
            # A tracker that loses the position writes the code to both columns, so both are tried first.
            rows = both if both.any() else x_values == value
            names = (x, y) if both.any() else (x,)
            if all(_is_far_from_neighbours(numbers[name], rows) for name in names):
                same = [
                    name
                    for name, values in numbers.items()
                    if name not in names and np.all(values[rows] == value) and np.sum(values == value) < 2 * rows.sum()
                ]
                columns = tuple(dict.fromkeys((*names, *same)))
                taken |= set(columns)
                yield Lost(columns, rows, f"{value:g}")
    for name, values in numbers.items():
        if name in taken:
            continue
        # In other columns only listed codes count, and only if they are far from all other values.
        for value in CODES & set(np.unique(values[np.isfinite(values)]).tolist()):
            rows = values == value
            good = values[np.isfinite(values) & ~rows]
            distance = abs(value - float(np.median(good))) if good.size else 0.0
            is_far = good.size > rows.sum() and distance > MIN_DISTANCE * np.ptp(good)
            if is_far and _is_far_from_neighbours(values, rows):
                yield Lost((name,), rows, f"{value:g}")


def _is_far_from_neighbours(values: np.ndarray, rows: np.ndarray) -> bool:
    """Return whether the values in some rows are far from the measured values before and after each stretch of these
    rows.

    This test decides whether a number is a code for a missing value: a code is far from the true position in every
    stretch, but a position that the rover reaches by driving is not.

    Parameters
    ----------
    values : array (rows,)
        The column.
    rows : array of bool (rows,)
        The rows that hold the possible code.
    """
    # Distances are compared with the usual step between measured values that differ.
    known = np.flatnonzero(np.isfinite(values) & ~rows)
    if known.size < 2 or not rows.any():
        return False
    steps = np.abs(np.diff(values[known]))
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    at = np.flatnonzero(rows)
    after = np.searchsorted(known, at)
    sides = [values[known[np.clip(side, 0, known.size - 1)]] for side in (after - 1, after)]
    return bool(usual > 0.0 and all(np.all(np.abs(side - values[at]) > MIN_JUMP * usual) for side in sides))
