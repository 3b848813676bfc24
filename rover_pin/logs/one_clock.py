"""Series that were recorded each on its own times, as topics of a bag, on one clock of even steps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rover_pin.base.errors import DataError

if TYPE_CHECKING:
    import pandas as pd

FEWEST = 5
"""Messages that a series needs."""
FINEST, COARSEST = 0.02, 0.2
"""Bounds of the clock's period [s], between which it is that of the series in the middle."""
MOST_ROWS = 5_000_000
"""Rows to which recordings are resampled at most: more than an hour at 1 kHz."""
MISSED = 5.0
"""Between messages that are this many usual intervals apart nothing is interpolated."""
CLOCK = "t_s"
Series = dict[str, tuple[np.ndarray, np.ndarray]]
"""Name -> times [ns] and values."""


def on_one_clock(path: Path, series: Series) -> tuple[pd.DataFrame, float]:
    """Return series as columns beside `t_s`, and the period [s]; a message no later than those before is left out.

    Raises DataError: they span too many rows.
    """
    import pandas as pd

    series = {name: _ahead(times, values) for name, (times, values) in series.items()}
    steps = [1e-9 * float(np.median(np.diff(times))) for times, _ in series.values()]
    period = round(float(np.clip(np.median(steps), FINEST, COARSEST)), 3)
    begin, end = min(times[0] for times, _ in series.values()), max(times[-1] for times, _ in series.values())
    lasts = 1e-9 * (end - begin)
    rows = int(lasts / period) + 1
    if rows > MOST_ROWS:
        raise DataError(
            f"{path}: what it holds spans {lasts:.3g} s, {rows} rows, and {MOST_ROWS} are the most: where stamps are "
            "of different clocks, convert it with one."
        )
    t = period * np.arange(rows)
    columns = {name: _within(t, (times - begin) * 1e-9, values) for name, (times, values) in series.items()}
    return pd.DataFrame({CLOCK: t, **columns}), period


def _ahead(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the messages that are later than all before."""
    ahead = np.concatenate([[True], times[1:] > np.maximum.accumulate(times)[:-1]])
    return times[ahead], values[ahead]


def _within(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.where((t < times[0]) | (t > times[-1]), np.nan, interpolate_messages(t, times, values))


def interpolate_messages(t: np.ndarray, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the values of messages at these times, NaN where they fail to come; beyond the ends the last ones.

    Where a value jumps by more than half of its range, as an angle from 180 to -180 deg, the nearer one stands.
    """
    after = np.clip(np.searchsorted(at, t), 1, len(at) - 1)
    low, high = values[after - 1], values[after]
    jumps = 2.0 * np.abs(high - low) > np.ptp(values[np.isfinite(values)]) if np.isfinite(values).any() else False
    nearer = np.where(t - at[after - 1] < at[after] - t, low, high)
    gaps = (at[after] - at[after - 1]) > MISSED * np.median(np.diff(at))
    inside = (t > at[after - 1]) & (t < at[after])
    return np.where(gaps & inside, np.nan, np.where(jumps, nearer, np.interp(t, at, values)))
