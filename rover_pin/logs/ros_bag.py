"""Runs from ROS bags: .bag, .db3 and .mcap files and ROS 2 bag folders, resampled on one clock; needs the extra `ros`.

`bag_columns` says how a drive log tells which column comes from where.
"""

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, MissingExtraError, RoverPinError, closest
from rover_pin.base.files.columns import Columns
from rover_pin.base.files.paths import exists, is_folder
from rover_pin.logs.bag_columns import ANGLES, PART, Source, angle_of, parts, period_from, si, sources_from
from rover_pin.logs.one_clock import MOST_ROWS, interpolate_messages
from rover_pin.logs.unpacking import bounded_unpacking, refuse_anchors

SUFFIXES = (".bag", ".db3", ".mcap")


def is_bag(path: Path) -> bool:
    """Return whether a run's file is a ROS bag: a folder, or by its suffix."""
    return is_folder(path) or path.suffix in SUFFIXES


def read_bag(path: Path, columns: Mapping[str, Any], bag: Mapping[str, Any], where: str) -> Columns:
    """Return the columns of a bag on a clock of even steps that starts at 0 where all measured columns have begun.

    Parameters
    ----------
    columns, bag : Mapping
        The tables [columns] and [bag] of the drive log that stands at `where`.

    Raises
    ------
    DataError
        A map that cannot be read, a file that is no bag, a topic or field that it lacks, times that run back.
    MissingExtraError
        The extra `ros` is not installed.
    """
    sources, period = sources_from(columns, where), period_from(bag, where)
    values = _Messages(path, sources).read()
    measured = [name for name in values if not sources[name].hold] or list(values)
    begin = max(values[name][0][0] for name in measured)
    end = min(values[name][0][-1] for name in measured)
    if not end - begin > period:
        raise DataError(
            f"{path}: the topics of {', '.join(measured[:3])}, ... share no stretch of time: check `stamp`."
        )
    rows = int((end - begin) / period) + 1
    if rows > MOST_ROWS:
        raise DataError(
            f"{where}: [bag] period = {1e-9 * period:g} s makes {rows} rows of {1e-9 * (end - begin):g} s, more than "
            f"{MOST_ROWS}: give a longer period."
        )
    t = 1e-9 * period * np.arange(rows)
    channels = {"t_s": t}
    for name, (at, messages) in values.items():
        source = sources[name]
        seconds = (at - begin) * 1e-9
        resampled = _hold_messages(t, seconds, messages) if source.hold else interpolate_messages(t, seconds, messages)
        channels[name] = si(name, source, resampled, where)
    return Columns(path, channels, tuple(f"t = {instant:.6g} s" for instant in t))


@contextmanager
def open_bag(path: Path) -> Iterator[Any]:
    """Give the reader of a bag; whatever it raises is reported in one sentence.

    Raises DataError: it is no bag, or is damaged.
    Raises MissingExtraError: the extra `ros` is not installed.
    """
    for part in path.iterdir() if is_folder(path) else [path]:
        if not exists(part):
            raise DataError(f"{part} is no file, so that {path.name} is no bag: give one of regular files.")
    refuse_anchors(path)
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingExtraError(
            f"{path}: a ROS bag needs the extra 'ros': pip install 'rover-pin[ros]', or convert it to CSV."
        ) from error
    try:
        with bounded_unpacking(), AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as bag:
            yield bag
    except RoverPinError:
        raise
    except Exception as error:
        why = getattr(error, "strerror", "") or str(error) or repr(error)
        raise DataError(f"{path}: the bag cannot be read: {why.splitlines()[0]}") from error


def _hold_messages(t: np.ndarray, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    before = np.searchsorted(at, t + 1e-9, side="right") - 1
    return np.where(before >= 0, values[np.maximum(before, 0)], np.nan)


class _Messages:
    """One pass through a bag, with what each column finds in its topic's messages."""

    def __init__(self, path: Path, sources: Mapping[str, Source]):
        self.path, self.sources = path, sources
        self.found: dict[str, tuple[list[int], list[float]]] = {name: ([], []) for name in sources}
        self.seen: dict[str, set[str]] = {name: set() for name in sources}

    def read(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return name -> (times [ns], values) of every column, times increasing."""
        with open_bag(self.path) as bag:
            self._pass(bag)
        return {name: self._arrays(name) for name in self.sources}

    def _pass(self, bag: Any) -> None:
        topics: dict[str, list[str]] = {}
        for name, source in self.sources.items():
            topics.setdefault(source.topic, []).append(name)
        for topic, names in topics.items():
            if topic not in bag.topics:
                raise DataError(
                    f"{self.path}: there is no topic '{topic}' for {names[0]}: {closest(topic, bag.topics)}"
                )
        wanted = [connection for connection in bag.connections if connection.topic in topics]
        for connection, received, raw in bag.messages(connections=wanted):
            message = bag.deserialize(raw, connection.msgtype)
            for name in topics[connection.topic]:
                self._take(name, message, received)

    def _take(self, name: str, message: Any, received: int) -> None:
        source = self.sources[name]
        value = self._value(name, message, source.field)
        if value is None:
            return
        at = self._time(name, message, source.stamp) if source.stamp else received
        times, values = self.found[name]
        if times and at < times[-1]:
            raise DataError(
                f"{self.path}: the times of topic '{source.topic}' run back at message {len(times) + 1}: leave out "
                f"`stamp` of {name}, or mend the bag."
            )
        if times and at == times[-1]:
            values[-1] = value
        else:
            times.append(at)
            values.append(value)

    def _time(self, name: str, message: Any, field: str) -> int:
        stamp = self._follow(name, message, field)
        if not hasattr(stamp, "nanosec"):
            raise DataError(
                f"{self.path}: '{field}' of topic '{self.sources[name].topic}' is no time, as header.stamp."
            )
        return nanoseconds(stamp)

    def _value(self, name: str, message: Any, field: str) -> float | None:
        value = self._follow(name, message, field)
        try:
            return None if value is None else float(value)
        except (TypeError, ValueError):
            inner = f", but has {', '.join(field_names(value))}" if field_names(value) else ""
            raise DataError(
                f"{self.path}: '{field}' of topic '{self.sources[name].topic}' is no number{inner}: go on for {name}."
            ) from None

    def _follow(self, name: str, value: Any, field: str) -> Any:
        """Return what a path of names leads to; None where an array has no entry of that name this time."""
        for part in parts(field):
            matched = PART.fullmatch(part)
            assert matched is not None
            key, index, beside, label = matched.groups()
            if key in ANGLES and set(field_names(value)) == set("xyzw"):
                value = angle_of(key, value)
                continue
            parent, value = value, self._member(name, value, key)
            if index is not None:
                value = self._entry(name, value, key, int(index))
            elif beside is not None:
                labels = [str(entry) for entry in self._member(name, parent, beside)]
                self.seen[name].update(labels)
                if label not in labels or labels.index(label) >= len(value):
                    return None
                value = value[labels.index(label)]
        return value

    def _member(self, name: str, value: Any, key: str) -> Any:
        if key not in field_names(value):
            names = [*field_names(value), *(ANGLES if set(field_names(value)) == set("xyzw") else ())]
            topic = self.sources[name].topic
            raise DataError(f"{self.path}: topic '{topic}' has no field '{key}' for {name}: {closest(key, names)}")
        return getattr(value, key)

    def _entry(self, name: str, value: Any, key: str, index: int) -> Any:
        if not hasattr(value, "__len__") or index >= len(value):
            count = len(value) if hasattr(value, "__len__") else "no"
            raise DataError(
                f"{self.path}: '{key}' of topic '{self.sources[name].topic}' has {count} entries, and {name} asks for "
                f"[{index}], counted from 0."
            )
        return value[index]

    def _arrays(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        times, values = self.found[name]
        source = self.sources[name]
        if not times and self.seen[name]:
            label = source.field.partition("=")[2].partition("]")[0]
            raise DataError(
                f"{self.path}: no message of topic '{source.topic}' names '{label}' for {name}: "
                f"{closest(label, self.seen[name])}"
            )
        if len(times) < 2:
            raise DataError(
                f"{self.path}: topic '{source.topic}' has {len(times)} messages for {name}; two are needed."
            )
        array = np.array(values)
        turns = source.field.rpartition(".")[2] in ANGLES
        return np.array(times, dtype=np.int64), np.unwrap(array) if turns else array


def nanoseconds(stamp: Any) -> int:
    """Return the time of a stamp [ns]."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def field_names(value: Any) -> list[str]:
    """Return the names of a message's fields."""
    fields = dataclasses.fields(value) if dataclasses.is_dataclass(value) else ()
    return [field.name for field in fields if not field.name.startswith("__")]
