"""Two drives, simulated or measured, over the time that both last."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file
from rover_pin.base.trust import Trust
from rover_pin.comparison.side import Comparison, Row, Side, Value, differences, number_rows, word_rows
from rover_pin.estimation.wording import format_value
from rover_pin.logs.drive_log import FILE, read_drive_log
from rover_pin.logs.saved import load_trace
from rover_pin.simulation.trace.channels import WHOLE
from rover_pin.simulation.trace.trace import Trace

UNITS = {"_s": "s", "_m": "m", "_deg": "deg", "_J": "J"}
"""Units by the end of a summary's names."""
AROUND = ("body_yaw", "body_roll")
"""Channels that begin again after a turn."""
PLACE = ("body_x", "body_y")
NOTHING = 1e-12
"""A channel that never leaves 0 by more than this [SI] is 0."""


class Channel(NamedTuple):
    """One channel of both drives at the common times, or that of all wheels: arrays (T, wheels or 1)."""

    name: str
    unit: str
    wheels: tuple[str, ...]
    first: np.ndarray
    second: np.ndarray

    @property
    def off(self) -> np.ndarray:
        """second - first."""
        off = self.second - self.first
        return np.asarray(np.angle(np.exp(1j * off)) if self.name in AROUND else off)

    @property
    def rms(self) -> float:
        """RMS of the difference."""
        return float(np.sqrt(np.nanmean(self.off**2)))

    @property
    def spread(self) -> float:
        """How far the first varies: SD."""
        return float(np.nanstd(self.first))

    @property
    def row(self) -> Row:
        """The channel in the table: means, and where it differs most."""
        first_mean, second_mean = (
            format_value(float(np.nanmean(side)), self.unit) for side in (self.first, self.second)
        )
        name = f"mean {self.name}" + (f", {len(self.wheels)} wheels" if self.wheels else "")
        return Row(
            name,
            first_mean,
            second_mean,
            note=f"RMS {format_value(self.rms, self.unit)}" if self.rms else "",
            differs=self.rms > 0,
        )


def read_drive(path: Path, run: str, trust: Trust) -> tuple[str, Trace]:
    """Return a drive and what it is called: a trace's file, or a run of a drive log, its first unless one is named.

    Raises DataError: it cannot be read, or the log has no such run.
    """
    if not is_file(path / FILE):
        return str(path), load_trace(path)
    log = read_drive_log(path, trust)
    trace = log.run(run) if run else log.runs[0]
    name = Path(str(trace.attrs.get("file", ""))).stem
    return f"{path}, {name}" if len(log.runs) > 1 else str(path), trace


def compare_drives(first: tuple[str, Trace], second: tuple[str, Trace]) -> Comparison:
    """Return the two side by side: where each ends, and how far every channel is off over the common time.

    Raises DataError: they share no time, or no channel.
    """
    first_side, second_side = (Side(label, _words(trace), _numbers(trace)) for label, trace in (first, second))
    t = _common_time(first, second)
    channels = [channel for channel in _channels(first[1], second[1], t) if _is_seen(channel)]
    if not channels:
        raise DataError(f"{first[0]} and {second[0]} have no channel in common: there is nothing to compare.")
    rows = (
        *word_rows(first_side, second_side),
        *number_rows(first_side, second_side),
        *(channel.row for channel in channels),
    )
    return Comparison(
        "drives", first[0], second[0], _describe_difference(t, channels), rows, differences(first_side, second_side)
    )


def _words(trace: Trace) -> dict[str, str]:
    words = {name: trace.attrs.get(name) for name in ("scenario", "rover", "control")}
    words |= {f"set {name}": value for name, value in dict(trace.attrs.get("settings") or {}).items()}
    words["what happened"] = trace.attrs.get("outcome") or trace.attrs.get("stop")
    return {name: str(value) for name, value in words.items() if value}


def _numbers(trace: Trace) -> dict[str, Value]:
    numbers = {}
    for name, value in trace.summary().items():
        end = next((end for end in UNITS if name.endswith(end)), "")
        if isinstance(value, float):
            numbers[name.removesuffix(end).replace("_", " ")] = Value(value, UNITS.get(end, ""))
    return numbers


def _common_time(first: tuple[str, Trace], second: tuple[str, Trace]) -> np.ndarray:
    t, second_t = first[1].t, second[1].t
    inside = t[(t >= second_t[0]) & (t <= second_t[-1])] if t.size and second_t.size else t[:0]
    if inside.size < 2:
        raise DataError(f"{first[0]} and {second[0]} share no two moments: compare drives that begin at the same time.")
    return inside


def _channels(first: Trace, second: Trace, t: np.ndarray) -> Iterator[Channel]:
    """Yield the channels that both have in one unit, those of the wheels together."""
    shared = [name for name in first if name != "t_s" and name in second and first.unit(name) == second.unit(name)]
    families: dict[str, list[tuple[str, str]]] = {}
    for name in shared:
        wheel = next((wheel_name for wheel_name in first.wheels if f"_{wheel_name}" in name and name not in WHOLE), "")
        family = name.removesuffix("_A").removesuffix(f"_{wheel}") if wheel else name
        families.setdefault(family, []).append((name, wheel))
    for family, members in families.items():
        sides = [
            np.column_stack([np.interp(t, trace.t, trace[name]) for name, _ in members]) for trace in (first, second)
        ]
        wheels = tuple(wheel for _, wheel in members if wheel)
        yield Channel(family, first.unit(members[0][0]).removeprefix("-"), wheels, sides[0], sides[1])


def _is_seen(channel: Channel) -> bool:
    """Return whether both recorded something there at the same time, and it is not 0 throughout."""
    both = np.isfinite(channel.first) & np.isfinite(channel.second)
    return bool(both.any()) and max(np.nanmax(np.abs(side)) for side in (channel.first, channel.second)) > NOTHING


def _describe_difference(t: np.ndarray, channels: list[Channel]) -> str:
    lasts = f"Over the {t[-1] - t[0]:.1f} s that both last"
    if all(channel.rms == 0.0 for channel in channels):
        return f"{lasts} they are the same in all {len(channels)} channels that both have."
    by_name = {channel.name: channel for channel in channels}
    clauses = []
    away = [by_name[name].off for name in PLACE if name in by_name]
    if away:
        distance = np.sqrt(sum(offset**2 for offset in away))
        end, rms = float(distance[-1, 0]), float(np.sqrt(np.nanmean(distance**2)))
        clauses = [f"they are {format_value(rms, 'm')} (RMS) apart, {format_value(end, 'm')} at the end"]
    scale = {channel.unit: max(peer.spread for peer in channels if peer.unit == channel.unit) for channel in channels}
    moving = [channel for channel in channels if scale[channel.unit] > 0 and channel.name not in PLACE]
    if moving:
        most = max(moving, key=lambda channel: channel.rms / scale[channel.unit])
        clauses.append(f"of what else was recorded {most.name} differs most: RMS {format_value(most.rms, most.unit)}")
    return f"{lasts}, {'; '.join(clauses)}."
