"""Resample series with different times, such as the topics of a ROS bag, to one common clock with even steps."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import BYTES_PER_NUMBER, MAX_NUMBERS_BYTES

if TYPE_CHECKING:
    import pandas as pd

MIN_MESSAGES = 5
"""Minimum number of messages in a series. A shorter series does not become a column, because fewer messages show no
usual interval between messages."""
FINEST, COARSEST = 0.02, 0.2
"""Lower and upper limit of the time step of the common clock [s]. The step is the median of the series' own time steps,
limited to this range. A shorter step would enlarge the log without more information on the motion of a slow rover. A
longer step would hide the motion of the suspension over obstacles."""
MOST_ROWS = 5_000_000
"""Maximum number of rows after resampling. A recording that needs more rows is refused. The limit corresponds to more
than an hour at 1 kHz."""
MAX_GAP_RATIO = 5.0
"""Maximum time between two messages, as a multiple of the series' median interval, at which values between them are
interpolated. In a longer gap, the resampled values are NaN. A few lost messages are bridged in this way, but not an
interruption of the recording."""
CLOCK = "t_s"
"""Name of the column that holds the common time of all series [s]."""
Series = dict[str, tuple[np.ndarray, np.ndarray]]
"""Name of a series -> its times [ns] and its values, both of shape (messages,)."""


def on_one_clock(path: Path, series: Series, held: Collection[str] = ()) -> tuple[pd.DataFrame, float]:
    """Resample all series to a common clock. Return a table with the time `t_s` and all series as columns, and the time
    step [s].

    Parameters
    ----------
    path : Path
        The file, for error messages.
    series : mapping
        Name of each series -> its times [ns] and values. A message whose time does not exceed all earlier times is
        dropped.
    held : collection of str
        Names of the series that hold commands. A command keeps its value until the next message; all other series are
        interpolated.

    Raises
    ------
    DataError
        The common clock would need more rows than MOST_ROWS or too much memory, for example because the series have
        different clocks.
    """
    import pandas as pd

    series = {name: _ahead(times, values) for name, (times, values) in series.items()}
    # The period of the clock is the median of the series' own periods, within the bounds.
    steps = [1e-9 * float(np.median(np.diff(times))) for times, _ in series.values()]
    period = round(float(np.clip(np.median(steps), FINEST, COARSEST)), 3)
    begin, end = min(times[0] for times, _ in series.values()), max(times[-1] for times, _ in series.values())
    lasts = 1e-9 * (end - begin)
    rows = int(lasts / period) + 1
    if rows > MOST_ROWS or BYTES_PER_NUMBER * rows * (len(series) + 1) > MAX_NUMBERS_BYTES:
        raise DataError(
            f"{path}: the messages span {lasts:.3g} s, which gives {rows} rows of {len(series)} fields after "
            f"resampling, but the maximum is {MOST_ROWS} rows and {MAX_NUMBERS_BYTES // BYTES_PER_NUMBER} numbers. If "
            "the time stamps belong to different clocks, convert the file to one clock. Otherwise leave out topics "
            "that are not needed."
        )
    t = period * np.arange(rows)
    columns = {}
    for name, (times, values) in series.items():
        seconds = (times - begin) * 1e-9
        if name in held:
            columns[name] = hold_messages(t, seconds, values)
        else:
            # A measured value is unknown before the first message of its series, and after the last.
            is_outside = (t < seconds[0]) | (t > seconds[-1])
            columns[name] = np.where(is_outside, np.nan, interpolate_messages(t, seconds, values))
    return pd.DataFrame({CLOCK: t, **columns}), period


def _ahead(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the times and values of a series without the messages whose time does not exceed all earlier times."""
    ahead = np.concatenate([[True], times[1:] > np.maximum.accumulate(times)[:-1]])
    return times[ahead], values[ahead]


def interpolate_messages(t: np.ndarray, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the values of a series at given times by linear interpolation between its messages.

    The result is NaN within a gap that is longer than MAX_GAP_RATIO allows. Before the first and after the last
    message, the result is the first or last value of the series.

    If the values of two neighbouring messages differ by more than half of the range of all values, the value of the
    nearer message is taken. An angle that jumps from 180 to -180 deg is such a case: its interpolation would pass
    through 0.

    Parameters
    ----------
    t : array (rows,)
        Times at which values are wanted [s].
    at, values : array (messages,)
        Times [s] and values of the messages.
    """
    # Index of the message after each time; the first and last interval serve times beyond the ends.
    after = np.clip(np.searchsorted(at, t), 1, len(at) - 1)
    low, high = values[after - 1], values[after]
    jumps = 2.0 * np.abs(high - low) > np.ptp(values[np.isfinite(values)]) if np.isfinite(values).any() else False
    nearer = np.where(t - at[after - 1] < at[after] - t, low, high)
    # An interpolated value within a long gap would be invented, so it becomes NaN. At the time of a message itself, the
    # value is known in any case.
    gaps = (at[after] - at[after - 1]) > MAX_GAP_RATIO * np.median(np.diff(at))
    inside = (t > at[after - 1]) & (t < at[after])
    return np.where(gaps & inside, np.nan, np.where(jumps, nearer, np.interp(t, at, values)))


def hold_messages(t: np.ndarray, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the value of the last message at or before each given time (rows,); NaN before the first message.

    Parameters
    ----------
    t : array (rows,)
        Times at which values are wanted [s].
    at, values : array (messages,)
        Times [s] and values of the messages.
    """
    # A message at exactly the given time counts. The tolerance of 1 ns covers round-off.
    before = np.searchsorted(at, t + 1e-9, side="right") - 1
    return np.where(before >= 0, values[np.maximum(before, 0)], np.nan)
