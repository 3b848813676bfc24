"""Read runs from ROS bags (.bag, .db3 and .mcap files, and ROS 2 bag folders) and resample them to even time steps.

Reading a bag needs the extra `ros`. The table [columns] of `drive.toml` states topic, field, unit and time stamp of
each column of the run::

    [bag]
    period = { value = 40, unit = "ms" }
    [columns]
    duty_fl = { topic = "/command", field = "data[0]", scale = 0.01 }
    wheel_rate_fl = { topic = "/joint_states", field = "velocity[name=wheel_fl]", unit = "rpm", stamp = "header.stamp" }
    body_x = { topic = "/tracker", field = "pose.position.x" }
    body_yaw = { topic = "/tracker", field = "pose.orientation.yaw" }
    [[run]]
    file = "climb.mcap"

A field is a path of names separated by dots. `[3]` takes the entry with index 3 of an array. `[name=wheel_fl]` takes
the entry at the position at which the array `name` of this message holds "wheel_fl". After the name of a quaternion,
`roll`, `pitch` or `yaw` computes this angle of the rotation sequence z-y-x. `stamp` is the field with the message's
time stamp; without `stamp`, the time of receipt counts. A duty keeps its value until the next message, and so does
every column with `hold = true`. All other columns are interpolated linearly, and stay empty in gaps between messages.
"""

import dataclasses
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError, MissingExtraError, ParameterError, RoverPinError, closest
from rover_pin.base.extras import install_command
from rover_pin.base.files.paths import exists, is_folder
from rover_pin.base.files.table import Columns
from rover_pin.base.quantity import to_si, value_and_unit
from rover_pin.logs.resampling import MOST_ROWS, hold_messages, interpolate_messages
from rover_pin.logs.unpacking import bounded_unpacking, refuse_anchors
from rover_pin.simulation.trace.channels import unit_of

KEYS = ("topic", "field", "scale", "unit", "hold", "stamp")
"""Keys that an entry of [columns] may have if the run is a ROS bag. Any other key is refused."""
PART = re.compile(r"(\w+)(?:\[(?:(\d+)|(\w+)=([^\]]+))\])?")
"""Pattern of one part of a field's path: a name, which [index] or [array=label] may follow."""
ANGLES = ("roll", "pitch", "yaw")
"""Names that may follow a quaternion in a field's path. Each means an angle that is computed from this quaternion."""


class Source(NamedTuple):
    """The source of one column in a ROS bag: topic, field, scale, unit, and field of the time stamp."""

    topic: str
    field: str
    scale: float = 1.0
    unit: str = ""
    hold: bool = False
    """True: a value is kept until the next message; False: values between two messages are interpolated"""
    stamp: str = ""
    """field that holds the time stamp of the message; if empty, the time at which the message was received is used"""


def sources_from(columns: Mapping[str, Any], where: str) -> dict[str, Source]:
    """Read the table [columns] of a drive log in ROS bags, and return the source of each column: its name -> `Source`.

    Parameters
    ----------
    columns : mapping
        Column of the drive log -> entry with `topic` and `field`, and optionally scale, unit, hold and stamp.
    where : str
        The file of the table, for error messages.

    Raises
    ------
    DataError
        The table is empty, or an entry has an unknown key, a value of the wrong type, no topic, or no field.
    """
    if not columns:
        raise DataError(
            f"{where}: a run in a ROS bag needs the table [columns], which states the topic and the field of each "
            "channel: add lines such as duty_fl = { topic = '...', field = '...' }."
        )
    # A single wrong entry raises an error, because a channel that is missing without notice would change the results.
    sources = {}
    for name, entry in columns.items():
        if not isinstance(entry, Mapping) or not {"topic", "field"} <= entry.keys():
            raise DataError(
                f"{where}: [columns] {name} = {entry!r} must state a topic and a field of the ROS bag: write "
                "{ topic = '...', field = '...' }."
            )
        # bool is a kind of int in Python, so that scale = true must be refused explicitly.
        for key, value in entry.items():
            if key not in KEYS:
                raise DataError(f"{where}: [columns] {name} has an unknown key '{key}': {closest(key, KEYS)}")
            kind = {"scale": (int, float), "hold": (bool,)}.get(key, (str,))
            if not isinstance(value, kind) or (key == "scale" and isinstance(value, bool)):
                words = {float: "a number", bool: "true or false", str: "text"}
                raise DataError(f"{where}: [columns] {name}: {key} = {value!r} must be {words[kind[-1]]}.")
        for path in (entry["field"], entry.get("stamp", "")):
            if path and not all(PART.fullmatch(part) for part in parts(path)):
                raise DataError(
                    f"{where}: [columns] {name}: '{path}' is not the path of a field in a message: write it as a.b, "
                    "a[3] or a[name=b]."
                )
        # Without `hold`, a duty keeps its value until the next message, and other columns are interpolated.
        sources[name] = Source(**{"hold": name.startswith("duty_"), **entry})
    return sources


def parts(field: str) -> list[str]:
    """Split the path of a field at its dots and return the parts. A dot inside brackets belongs to a label and does not
    split.
    """
    return re.split(r"\.(?![^\[]*\])", field)


def period_from(bag: Mapping[str, Any], where: str) -> float:
    """Return the time between two rows of the resampled run [ns], as the table [bag] states it by `period`.

    Raises DataError: the table has an unknown key, or the period is missing, not positive, or not in a unit of time.
    """
    for key in bag:
        if key != "period":
            raise DataError(f"{where}: [bag] has an unknown key '{key}': {closest(key, ('period',))}")
    entry = bag.get("period")
    value, unit = value_and_unit(entry, "s")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
        raise DataError(
            f"{where}: a ROS bag needs [bag] period = {{ value = 40, unit = 'ms' }}, the positive time between two "
            f"rows after resampling, but the period is {entry!r}."
        )
    try:
        return 1e9 * to_si(value, str(unit), "s", f"{where}: [bag] period")
    except ParameterError as error:
        raise DataError(str(error)) from error


def si(name: str, source: Source, values: np.ndarray, where: str) -> np.ndarray:
    """Return the values of one column of a bag in SI units, after multiplication by the scale that its source states.

    Raises DataError: the declared unit cannot be converted to the unit of the column.
    """
    expected = unit_of(name)
    if not source.unit:
        return source.scale * values
    try:
        return source.scale * values * to_si(1.0, source.unit, expected, f"{where}: [columns] {name}")
    except ParameterError as error:
        raise DataError(str(error)) from error


def angle_of(name: str, q: Any) -> float:
    """Return roll, pitch or yaw [rad] of a quaternion, for the rotation sequence z-y-x.

    `name` is "roll", "pitch" or "yaw". The quaternion has the fields x, y, z, w and need not be normalised. For a
    quaternion of zeros, which some sensors send before their first fix, the result is NaN.
    """
    square = q.x**2 + q.y**2 + q.z**2 + q.w**2
    if not square > 0.0:
        return math.nan
    if name == "roll":
        return math.atan2(2 * (q.w * q.x + q.y * q.z), square - 2 * (q.x**2 + q.y**2))
    if name == "yaw":
        return math.atan2(2 * (q.w * q.z + q.x * q.y), square - 2 * (q.y**2 + q.z**2))
    # Round-off may exceed the domain of asin, so the argument is clipped.
    return math.asin(max(-1.0, min(1.0, 2 * (q.w * q.y - q.z * q.x) / square)))


SUFFIXES = (".bag", ".db3", ".mcap")
"""Suffixes of the files that are read as ROS bags."""


def is_bag(path: Path) -> bool:
    """Return whether the file of a run is a ROS bag: a folder (ROS 2), or a file with one of the suffixes of ROS
    bags.
    """
    return is_folder(path) or path.suffix in SUFFIXES


def read_bag(path: Path, columns: Mapping[str, Any], bag: Mapping[str, Any], where: str) -> Columns:
    """Read a ROS bag and return the columns of the run, resampled to even time steps.

    The run begins when every measured column has had its first message, and ends when the first measured column has its
    last message. Commands do not limit this time span.

    Parameters
    ----------
    path : Path
        The bag: a file or a folder.
    columns, bag : Mapping
        The tables [columns] and [bag] of drive.toml.
    where : str
        The drive.toml, for error messages.

    Raises
    ------
    DataError
        A table of drive.toml is wrong, the file is not a bag, a topic or field is missing, or the times of a topic
        decrease.
    MissingExtraError
        The extra `ros` is not installed.
    """
    sources, period = sources_from(columns, where), period_from(bag, where)
    values = _Messages(path, sources).read()
    # Commands may begin later than the measurements, so that they do not limit the time span.
    measured = [name for name in values if not sources[name].hold] or list(values)
    begin = max(values[name][0][0] for name in measured)
    end = min(values[name][0][-1] for name in measured)
    if not end - begin > period:
        raise DataError(
            f"{path}: the topics of {', '.join(measured[:3])}, ... have no time in common, so no row can hold all of "
            "these channels: check their time stamps (`stamp` in [columns])."
        )
    # All rows are held in memory, so that the period must not be too short.
    rows = int((end - begin) / period) + 1
    if rows > MOST_ROWS:
        raise DataError(
            f"{where}: [bag] period = {1e-9 * period:g} s gives {rows} rows in {1e-9 * (end - begin):g} s, but the "
            f"maximum is {MOST_ROWS}: give a longer period."
        )
    t = 1e-9 * period * np.arange(rows)
    channels = {"t_s": t}
    # Times are subtracted as integers, so that stamps since 1970 keep their nanoseconds.
    for name, (at, messages) in values.items():
        source = sources[name]
        seconds = (at - begin) * 1e-9
        resampled = hold_messages(t, seconds, messages) if source.hold else interpolate_messages(t, seconds, messages)
        channels[name] = si(name, source, resampled, where)
    return Columns(path, channels, tuple(f"t = {instant:.6g} s" for instant in t))


@contextmanager
def open_bag(path: Path) -> Iterator[Any]:
    """Open a ROS bag, and yield the reader of the package rosbags. An error of this reader becomes a short DataError.

    Raises DataError: the file is not a bag, or it is damaged.
    Raises MissingExtraError: the extra `ros` is not installed.
    """
    for part in path.iterdir() if is_folder(path) else [path]:
        if not exists(part):
            raise DataError(f"{part} is not a regular file, so {path.name} is not read: give a bag of regular files.")
    # rosbags expands YAML aliases in metadata.yaml without limit, so such files are refused before it opens them.
    refuse_anchors(path)
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingExtraError(
            f"{path}: a ROS bag needs the package rosbags. Run `{install_command('ros')}`, or convert the bag to CSV."
        ) from error
    try:
        with bounded_unpacking(), AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as bag:
            yield bag
    except RoverPinError:
        raise
    except Exception as error:
        why = getattr(error, "strerror", "") or str(error) or repr(error)
        # rosbags reads MCAP files of ROS 2 only; the importer reads the others.
        if "Profile is not ros2" in why:
            why = "it is an MCAP without the profile ros2; `rover-pin import-log` reads JSON, ROS 1 and ROS 2 messages"
        raise DataError(f"{path}: the bag cannot be read: {why.splitlines()[0]}") from error


class _Messages:
    """Collector of the times and values of each column of a run, in one pass through a ROS bag.

    A column can select an array entry by a label. For such a column, `seen` holds the labels that occur in the
    messages.
    """

    def __init__(self, path: Path, sources: Mapping[str, Source]):
        self.path, self.sources = path, sources
        self.found: dict[str, tuple[list[int], list[float]]] = {name: ([], []) for name in sources}
        self.seen: dict[str, set[str]] = {name: set() for name in sources}

    def read(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Read the bag, and return for each column of the run its increasing times [ns] and its values, both
        (messages,).
        """
        # Each topic may feed several columns, so messages are decoded once for all of them.
        topics: dict[str, list[str]] = {}
        for name, source in self.sources.items():
            topics.setdefault(source.topic, []).append(name)
        with open_bag(self.path) as bag:
            for topic, names in topics.items():
                if topic not in bag.topics:
                    raise DataError(
                        f"{self.path}: there is no topic '{topic}' for {names[0]}: {closest(topic, bag.topics)}"
                    )
            # Other topics, such as images, are skipped without decoding.
            wanted = [connection for connection in bag.connections if connection.topic in topics]
            for connection, received, raw in bag.messages(connections=wanted):
                message = bag.deserialize(raw, connection.msgtype)
                for name in topics[connection.topic]:
                    source = self.sources[name]
                    value = self._value(name, message, source.field)
                    if value is None:
                        continue
                    at = self._time(name, message, source.stamp) if source.stamp else received
                    times, values = self.found[name]
                    # Interpolation needs increasing times.
                    if times and at < times[-1]:
                        raise DataError(
                            f"{self.path}: in topic '{source.topic}', the time decreases at message {len(times) + 1}: "
                            f"leave `stamp` out of the entry of {name}, or correct the bag."
                        )
                    # If several messages have equal times, only the value of the last message is kept.
                    if times and at == times[-1]:
                        values[-1] = value
                    else:
                        times.append(at)
                        values.append(value)
        arrays = {}
        for name, source in self.sources.items():
            times, values = self.found[name]
            # The topic has messages, but no message has the label. The error lists the labels that occur, so that the
            # user can correct the entry.
            if not times and self.seen[name]:
                label = source.field.partition("=")[2].partition("]")[0]
                raise DataError(
                    f"{self.path}: no message of topic '{source.topic}' names '{label}', the label that {name} needs: "
                    f"{closest(label, self.seen[name])}"
                )
            if len(times) < 2:
                raise DataError(
                    f"{self.path}: topic '{source.topic}' has {len(times)} messages for {name}, but at least two are "
                    "needed to interpolate: record more, or leave out this channel."
                )
            # Angles from quaternions jump by a full turn at 180 deg. The jumps are removed, because an interpolation
            # across a jump would give wrong angles.
            array, turns = np.array(values), source.field.rpartition(".")[2] in ANGLES
            arrays[name] = (np.array(times, dtype=np.int64), np.unwrap(array) if turns else array)
        return arrays

    def _time(self, name: str, message: Any, field: str) -> int:
        """Return the time stamp of a message [ns], read from the field that the entry of the column names as
        `stamp`.
        """
        stamp = self._follow(name, message, field)
        if not hasattr(stamp, "nanosec"):
            raise DataError(
                f"{self.path}: '{field}' of topic '{self.sources[name].topic}' is not a time stamp: give a field such "
                f"as header.stamp as `stamp` of {name}."
            )
        return nanoseconds(stamp)

    def _value(self, name: str, message: Any, field: str) -> float | None:
        """Return the number at a field of a message, or None if the field selects an array entry by a label that the
        message lacks.
        """
        value = self._follow(name, message, field)
        try:
            return None if value is None else float(value)
        except (TypeError, ValueError):
            inner = f", but a message with the fields {', '.join(field_names(value))}" if field_names(value) else ""
            raise DataError(
                f"{self.path}: '{field}' of topic '{self.sources[name].topic}' is not a number{inner}: extend `field` "
                f"of {name} until it leads to a number."
            ) from None

    def _follow(self, name: str, value: Any, field: str) -> Any:
        """Return the part of a message that a field's path leads to, or None if an array has no entry with the label of
        the path.
        """
        for part in parts(field):
            matched = PART.fullmatch(part)
            assert matched is not None
            key, index, beside, label = matched.groups()
            # Roll, pitch and yaw are no fields of a quaternion; they are computed from its four numbers.
            if key in ANGLES and set(field_names(value)) == set("xyzw"):
                value = angle_of(key, value)
                continue
            # The array with the labels is a field of the same message as the array with the values.
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
        """Return the field of a message or of a nested message by its name."""
        if key not in field_names(value):
            names = [*field_names(value), *(ANGLES if set(field_names(value)) == set("xyzw") else ())]
            topic = self.sources[name].topic
            raise DataError(f"{self.path}: topic '{topic}' has no field '{key}' for {name}: {closest(key, names)}")
        return getattr(value, key)

    def _entry(self, name: str, value: Any, key: str, index: int) -> Any:
        """Return the entry of an array in a message that a column selects by an index, after checking that the entry
        exists.
        """
        if not hasattr(value, "__len__") or index >= len(value):
            count = len(value) if hasattr(value, "__len__") else "no"
            raise DataError(
                f"{self.path}: '{key}' of topic '{self.sources[name].topic}' has {count} entries, but the entry of "
                f"{name} asks for [{index}], counted from 0: give a smaller index."
            )
        return value[index]


def nanoseconds(stamp: Any) -> int:
    """Return the time of a ROS time stamp as an integer [ns]."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def field_names(value: Any) -> list[str]:
    """Return the names of the fields of a ROS message, or an empty list for a value that is not a message."""
    fields = dataclasses.fields(value) if dataclasses.is_dataclass(value) else ()
    return [field.name for field in fields if not field.name.startswith("__")]
