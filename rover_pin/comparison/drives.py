"""Compare two drives, simulated or measured, over the period of time that both recorded."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file
from rover_pin.base.trust import Trust
from rover_pin.comparison.side import Comparison, Row, Side, Value, differences, number_rows, word_rows
from rover_pin.estimation.wording import format_value
from rover_pin.logs.drive_log import FILE, load_trace, read_drive_log
from rover_pin.simulation.trace.channels import WHOLE
from rover_pin.simulation.trace.trace import Trace

UNITS = {"_s": "s", "_m": "m", "_deg": "deg", "_J": "J"}
"""Last letters of a name in the summary of a trace, such as "_m" -> the unit of the number with this name."""
ANGLES = ("body_yaw", "body_roll")
"""Channels with angles that jump by a full turn. The difference between two drives is reduced to (-pi, pi] for them."""
POSITION = ("body_x", "body_y")
"""Channels of the rover's position in the horizontal plane [m]."""
ZERO_TOLERANCE = 1e-12
"""If the absolute value of a channel stays below this limit [SI unit] in both drives, the channel counts as not
recorded. The limit is far below every measured value, and only excludes zeros with their round-off."""


class Channel(NamedTuple):
    """One channel of two drives at T common times.

    `first` and `second` are the values in the first and the second drive: arrays (T, 1), or (T, wheels) for a channel
    that each wheel has. `wheels` are the names of these wheels.
    """

    name: str
    unit: str
    wheels: tuple[str, ...]
    first: np.ndarray
    second: np.ndarray

    @property
    def difference(self) -> np.ndarray:
        """Values of the second drive minus values of the first drive, with angles reduced to (-pi, pi]."""
        # The angle of exp(1j d) is d without full turns.
        difference = self.second - self.first
        return np.asarray(np.angle(np.exp(1j * difference)) if self.name in ANGLES else difference)

    @property
    def rms(self) -> float:
        """Root mean square (RMS) of the difference between the two drives, over times and wheels."""
        return float(np.sqrt(np.nanmean(self.difference**2)))

    @property
    def spread(self) -> float:
        """Standard deviation of the channel in the first drive. To compare differences of several channels, they are
        divided by such a standard deviation.
        """
        return float(np.nanstd(self.first))

    @property
    def row(self) -> Row:
        """The channel's line in the table of the comparison: the mean in each drive, and the RMS of the difference."""
        first_mean, second_mean = (
            format_value(float(np.nanmean(side)), self.unit) for side in (self.first, self.second)
        )
        # The column for the change stays empty: two drives can differ and still have equal means, so the row states the
        # RMS of the difference instead.
        name = f"mean {self.name}" + (f", {len(self.wheels)} wheels" if self.wheels else "")
        note = f"RMS {format_value(self.rms, self.unit)}" if self.rms else ""
        return Row(name, first_mean, second_mean, note=note, differs=self.rms > 0)


def read_drive(path: Path, run: str, trust: Trust) -> tuple[str, Trace]:
    """Read a trace in .parquet, or one run of a drive log, and return its label and the trace.

    The label is the path, followed by the name of the run if the log has several runs. `run` is the name of the run to
    read; if it is empty, the first run is read.

    Raises DataError if the file cannot be read, or if the log has no run of this name.
    """
    if not is_file(path / FILE):
        return str(path), load_trace(path)
    log = read_drive_log(path, trust)
    trace = log.run(run) if run else log.runs[0]
    name = Path(str(trace.attrs.get("file", ""))).stem
    return f"{path}, {name}" if len(log.runs) > 1 else str(path), trace


def compare_drives(first: tuple[str, Trace], second: tuple[str, Trace]) -> Comparison:
    """Return the comparison of two drives: of their summaries, and of every channel that both recorded.

    Channels are compared over the period of time that both drives cover. Each drive is given by its label and its
    trace, as `read_drive` returns them.

    Raises DataError if the drives have no common time or no common channel.
    """
    # Rows of words (settings, outcome) and of numbers (summary) need no common time.
    (first_label, first_trace), (second_label, second_trace) = first, second
    first_side, second_side = (Side(label, _words(trace), _numbers(trace)) for label, trace in (first, second))
    # The common times are the times of the first drive that the second drive covers. The second drive is interpolated
    # to these times.
    t, second_t = first_trace.t, second_trace.t
    t = t[(t >= second_t[0]) & (t <= second_t[-1])] if t.size and second_t.size else t[:0]
    if t.size < 2:
        raise DataError(
            f"The times of {first_label} and {second_label} do not overlap: compare drives that cover a common period."
        )
    channels = list(_channels(first_trace, second_trace, t))
    if not channels:
        raise DataError(f"{first_label} and {second_label} have no channel in common: there is nothing to compare.")
    rows = (
        *word_rows(first_side, second_side),
        *number_rows(first_side, second_side),
        *(channel.row for channel in channels),
    )
    changes = differences(first_side, second_side)
    period = f"Over the {t[-1] - t[0]:.1f} s that both drives cover"
    if all(channel.rms == 0.0 for channel in channels):
        sentence = f"{period}, all {len(channels)} common channels are equal."
        return Comparison("drives", first_label, second_label, sentence, rows, changes)
    # If the drives differ, the sentence states the distance between the positions, and the channel that differs most
    # among the other channels.
    by_name = {channel.name: channel for channel in channels}
    clauses = []
    offsets = [by_name[name].difference for name in POSITION if name in by_name]
    if offsets:
        distance = np.sqrt(sum(offset**2 for offset in offsets))
        end, rms = float(distance[-1, 0]), float(np.sqrt(np.nanmean(distance**2)))
        clauses = [f"the positions are {format_value(rms, 'm')} (RMS) apart, {format_value(end, 'm')} at the end"]
    # Differences of one unit are compared with the largest SD of this unit. A channel that hardly moves would
    # otherwise seem to differ most.
    scale = {channel.unit: max(peer.spread for peer in channels if peer.unit == channel.unit) for channel in channels}
    moving = [channel for channel in channels if scale[channel.unit] > 0 and channel.name not in POSITION]
    if moving:
        largest = max(moving, key=lambda channel: channel.rms / scale[channel.unit])
        clauses.append(
            f"among the other channels, {largest.name} differs most (RMS {format_value(largest.rms, largest.unit)})"
        )
    sentence = f"{period}, {'; '.join(clauses)}."
    return Comparison("drives", first_label, second_label, sentence, rows, changes)


def _words(trace: Trace) -> dict[str, str]:
    """Return the properties of a drive that are words: its scenario, rover, control, settings and outcome."""
    words = {name: trace.attrs.get(name) for name in ("scenario", "rover", "control")}
    words |= {f"set {name}": value for name, value in dict(trace.attrs.get("settings") or {}).items()}
    words["what happened"] = trace.attrs.get("outcome") or trace.attrs.get("stop")
    return {name: str(value) for name, value in words.items() if value}


def _numbers(trace: Trace) -> dict[str, Value]:
    """Return the numbers in the summary of a drive. The last letters of a number's name state its unit."""
    numbers = {}
    for name, value in trace.summary().items():
        # For example "distance_m" becomes the name "distance" with the unit m.
        end = next((end for end in UNITS if name.endswith(end)), "")
        if isinstance(value, float):
            numbers[name.removesuffix(end).replace("_", " ")] = Value(value, UNITS.get(end, ""))
    return numbers


def _channels(first: Trace, second: Trace, t: np.ndarray) -> Iterator[Channel]:
    """Yield each channel that both drives recorded in one unit, with values at the times t [s].

    The channels of single wheels, such as the wheel rates, are joined to one channel with a column for each wheel.
    """
    shared = [name for name in first if name != "t_s" and name in second and first.unit(name) == second.unit(name)]
    families: dict[str, list[tuple[str, str]]] = {}
    for name in shared:
        # The name of a wheel's channel contains the name of the wheel, as in rate_fl; channels of the whole rover
        # (WHOLE) may contain these letters by chance.
        wheel = next((wheel_name for wheel_name in first.wheels if f"_{wheel_name}" in name and name not in WHOLE), "")
        family = name.removesuffix("_A").removesuffix(f"_{wheel}") if wheel else name
        families.setdefault(family, []).append((name, wheel))
    for family, members in families.items():
        sides = [
            np.column_stack([np.interp(t, trace.t, trace[name]) for name, _ in members]) for trace in (first, second)
        ]
        # A channel is left out if the two drives have no common sample of it, or if it is zero in both drives.
        both = np.isfinite(sides[0]) & np.isfinite(sides[1])
        if not both.any() or max(np.nanmax(np.abs(side)) for side in sides) <= ZERO_TOLERANCE:
            continue
        wheels = tuple(wheel for _, wheel in members if wheel)
        yield Channel(family, first.unit(members[0][0]).removeprefix("-"), wheels, sides[0], sides[1])
