"""Read and write drive logs: folders with `drive.toml` and one CSV file, Parquet file or ROS bag for each run.

The runs may be measured or simulated.

`drive.toml`::

    kind = "drive-log"
    name = "slope"
    source = "our test field, 2026"
    rover = "nexus6"                      # or a TOML next to its URDF
    gravity = 9.81                        # m/s^2, or { value = ..., unit = "..." }
    wheels = ["fl", "fr", "ml", "mr", "rl", "rr"]
    input = "rates"                       # hold the wheels to their measured rates; else duties, if logged
    angles = "sinkage"                    # contact angles from the sinkage, or "fixed" as in Table 1 of the paper
    [terrain]                             # see terrain.files
    polyline = "slope.csv"
    [soil]                                # known constants: { value, unit, sd }; [wheel] and [motor] alike
    phi = { value = 30.0, unit = "deg" }
    [resistance]                          # R of `MotionResistance`; else R from a flat drive at S = 0.05
    R = { value = 0.028, unit = "" }
    [tracker]                             # scale error e and delay d, e.g. of visual odometry; tracked point x, y
    e = { value = 0.0, sd = 0.02 }
    [noise]                               # SD of one sample for each kind of channel, see `NOISE`
    wheel_rate = { value = 0.02, unit = "rad/s" }
    [[run]]
    file = "climb.csv"
    start = { x = 0.0, y = 0.0, yaw = 0.0 }
    purpose = "climb until it stops"
    terrain = { slope = { value = 12, unit = "deg" } }   # terrain of this run only, see `run_terrain`
    units = { wheel_rate_fl = "rpm" }     # units of columns whose name states another unit

`column_map` describes the table [columns] of runs that are tables, and `ros_bag` the table [columns] of ROS bags.

`read_drive_log` and `write_drive_log` read and write a whole log. `save_trace` and `load_trace` write and read a single
run.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rover_pin.base.encode import printable
from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.paths import exists, is_file, is_folder
from rover_pin.base.files.table import Columns, columns_text, read_columns
from rover_pin.base.files.toml_file import read_toml, toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.jobs.time_left import showing_progress
from rover_pin.base.public import brief
from rover_pin.base.quantity import as_float, refuse_strange, to_si, value_and_unit
from rover_pin.base.trust import Trust
from rover_pin.logs.column_map import map_columns
from rover_pin.logs.ros_bag import is_bag, read_bag
from rover_pin.logs.run_terrain import is_of_run, run_terrain
from rover_pin.parameters.gravity import EARTH, gravity_from
from rover_pin.rover.rover import Rover, load_named
from rover_pin.simulation.trace.channels import DUTIES, ODOMETRY, RATES, WHEELS, unit_of
from rover_pin.simulation.trace.files import read_run, run_from, write_parquet
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.angles import ANGLES
from rover_pin.terrain.files import terrain_from
from rover_pin.terrain.shapes import flat
from rover_pin.terrain.terrain import Terrain

FILE, KIND = "drive.toml", "drive-log"
"""Name of the file that describes a drive log, and the value of its key `kind`."""
RUN_KEYS, START_KEYS = ("file", "start", "purpose", "units", "attrs", "terrain"), ("x", "y", "yaw")
"""Keys that a table [[run]] of drive.toml may have, and keys of its table `start`. Any other key is refused."""


@brief
@dataclass(frozen=True)
class LogMetadata:
    """The content of drive.toml apart from its runs: rover, gravity, wheels, constants, noise and column sources.

    Tables such as [soil] are kept as the user wrote them. They are converted and checked where they are used.
    """

    name: str
    source: str = ""
    rover: str = "nexus6"
    gravity: float = EARTH
    wheels: tuple[str, ...] = WHEELS
    input: str = ""
    """The measured channels that a simulation takes as its input: the "duties" of the motors, or the "rates" of the
    wheels. Empty means duties if the log has them, and otherwise rates."""
    place: str = ""
    """Empty if the pose in the log was measured; "odometry" if the pose was computed from the wheels."""
    angles: str = ""
    """The rule for the contact angles of the wheels: "fixed" angles, or angles from the "sinkage". If empty, the angles
    are fixed for the wheels of the paper, and follow from the sinkage for other wheels."""
    licence: str = ""
    method: str = ""
    missing: Any = ""
    terrain: Mapping[str, Any] = field(default_factory=dict)
    soil: Mapping[str, Any] = field(default_factory=dict)
    wheel: Mapping[str, Any] = field(default_factory=dict)
    motor: Mapping[str, Any] = field(default_factory=dict)
    resistance: Mapping[str, Any] = field(default_factory=dict)
    tracker: Mapping[str, Any] = field(default_factory=dict)
    noise: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, Any] = field(default_factory=dict)
    bag: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, trace: Trace, name: str) -> LogMetadata:
        """Return the metadata with which a simulated trace is written as a drive log. Origin, rover and gravity come
        from the attributes of the trace.
        """
        rover, gravity = trace.attrs.get("rover", "nexus6"), trace.attrs.get("gravity_mps2", EARTH)
        return cls(name, trace.attrs.get("made_by", ""), rover, gravity, trace.wheels or WHEELS)


TABLES = ("terrain", "soil", "wheel", "motor", "resistance", "tracker", "noise", "columns", "bag")
"""Keys of drive.toml whose value must be a table. Any other value is refused."""
TEXTS = ("name", "source", "rover", "licence", "method", "input", "place", "angles")
"""Keys of drive.toml whose value must be text. Any other value is refused."""
WORDS = {"input": ("", DUTIES, RATES), "place": ("", ODOMETRY), "angles": ("", *ANGLES)}
"""Keys of drive.toml that allow only certain words -> these words. An empty text means that the key is absent."""


@brief
@dataclass(frozen=True)
class DriveLog:
    """A drive log that has been read: its folder, the content of its drive.toml, and its runs in the order of the file.

    The attributes of each run hold the run's file, purpose, start pose, rover and gravity.
    """

    folder: Path
    metadata: LogMetadata
    runs: tuple[Trace, ...]
    trust: Trust = Trust()
    """which files outside the log's folder the user has allowed to be read"""

    @property
    def file(self) -> Path:
        """The path of the log's drive.toml."""
        return self.folder / FILE

    def run(self, name: str) -> Trace:
        """Return the run whose file has this name, with or without the suffix of the file.

        Raises ParameterError: no run of the log has this name.
        """
        # The suffix is optional: the name can be "climb" or "climb.csv".
        stems = [Path(trace.attrs["file"]).stem for trace in self.runs]
        for trace, stem in zip(self.runs, stems, strict=True):
            if name in (stem, Path(trace.attrs["file"]).name):
                return trace
        raise ParameterError(f"{self.folder}: there is no run '{name}': {closest(name, stems)}")

    def terrain(self) -> Terrain:
        """Return the terrain that drive.toml declares for all runs, or a flat terrain if each run has a terrain of its
        own.
        """
        if self.metadata.terrain and not is_of_run(self.metadata.terrain):
            return terrain_from(self.metadata.terrain, self.file, self.trust)
        return flat()

    def terrain_of(self, run: Trace) -> Terrain | None:
        """Return the terrain of one run; None if the terrain of the whole log (`terrain`) applies to this run.

        A run has its own terrain if its entry [[run]] declares one, or if the table [terrain] of the log gives every
        run its own slope or its own estimate. If neither the log nor the run declares a terrain, the terrain is
        estimated from the run's pitch, roll and height.
        """
        # The terrain of the run has priority over the terrain of the log. Without either, the terrain is estimated.
        declared = run.attrs.get("terrain")
        table = declared or self.metadata.terrain or {"estimated": True}
        if is_of_run(table):
            return run_terrain(table, run, self.load_rover(), f"{self.folder}: {run.attrs.get('file', 'run')}: terrain")
        return None if declared is None else terrain_from(table, self.file, self.trust)

    def is_estimated(self, run: Trace) -> bool:
        """Return whether the terrain under a run is estimated from the run's own sensors."""
        table = run.attrs.get("terrain") or self.metadata.terrain
        return not table or bool(table.get("estimated"))

    @property
    def noise_sd(self) -> dict[str, float]:
        """Declared SD of one sample in SI units for each kind of channel: key of [noise], such as "current" -> SD."""
        return read_declared_noise(self.metadata.noise, str(self.file))

    def load_rover(self) -> Rover:
        """Return the model of the rover that drive.toml names."""
        return load_named(self.metadata.rover, self.file, self.trust)

    @property
    def rover(self) -> str:
        """The name of the rover, or the path of the rover's file if this file lies in the folder of the log.

        `rover_pin.load_rover` accepts both.
        """
        beside = self.folder / self.metadata.rover
        return str(beside) if is_file(beside) else self.metadata.rover


def read_drive_log(folder: str | Path, trust: Trust = Trust()) -> DriveLog:
    """Read the drive log in a folder and return the content of its drive.toml together with all of its runs.

    Parameters
    ----------
    folder : path
        The folder with `drive.toml`.
    trust : Trust
        States which files outside the folder may be read. By default, all runs and terrain files must lie in the
        folder.

    Raises
    ------
    DataError
        The folder has no `drive.toml`; this file is not TOML or does not describe a drive log; a key is unknown or
        missing; or a run's file is missing, lies outside the folder, or cannot be read.

    Examples
    --------
    >>> from rover_pin.logs.drive_log import read_drive_log
    >>> log = read_drive_log("my-log")  # doctest: +SKIP
    >>> log.run("climb")["body_x"]  # doctest: +SKIP
    """
    folder = Path(folder)
    file = folder / FILE
    if not is_file(file):
        raise DataError(
            f"{folder}: there is no {FILE} in this folder, so it is not a drive log: give the folder of a drive log, "
            "or write one with `write_drive_log`."
        )
    table = read_toml(file)
    if table.get("kind") != KIND:
        raise DataError(f"{file}: kind = {table.get('kind')!r}, but a drive log has kind = '{KIND}'.")
    entries = table.get("run")
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        raise DataError(f"{file}: the drive log lists no run: add a table [[run]] with file = '...' for each run.")
    # All declarations are checked before the first run is read, because to read many runs takes long. Types are checked
    # before values, so that each message names the key as the user wrote it.
    declared = {key: value for key, value in table.items() if key not in ("kind", "run")}
    keys = [field.name for field in dataclasses.fields(LogMetadata)]
    for key, value in declared.items():
        if key not in keys:
            raise DataError(f"{file}: there is no key '{key}' in a drive log: {closest(key, keys)}")
        kind, word = (dict, "a table") if key in TABLES else (str, "text")
        if key in (*TABLES, *TEXTS) and not isinstance(value, kind):
            raise DataError(f"{file}: {key} = {value!r} must be {word}.")
    for key, words in WORDS.items():
        if declared.get(key, "") not in words:
            raise DataError(f"{file}: {key} = {declared[key]!r}: write {' or '.join(map(repr, words[1:]))}.")
    read_declared_noise(declared.get("noise", {}), str(file))
    if not declared.get("name"):
        raise DataError(f"{file}: the drive log has no name: add the line name = '...'.")
    # Without the key, the rover has the six wheels of the paper's rover.
    wheels = declared.get("wheels", list(WHEELS))
    if not isinstance(wheels, list) or not all(isinstance(wheel, str) for wheel in wheels):
        raise DataError(f"{file}: wheels = {wheels!r} must be a list of wheel names, such as ['fl', 'fr'].")
    gravity = gravity_from(declared.get("gravity", EARTH), str(file))
    # The name is printed in reports, so control characters are removed from it.
    named = {**declared, "name": printable(declared["name"])}
    metadata = LogMetadata(**{**named, "wheels": tuple(wheels), "gravity": gravity})
    # A file that is named twice would count the same measurement twice.
    names = [entry.get("file") for entry in entries]
    for at, name in enumerate(names, 1):
        if name in names[: at - 1]:
            first = names.index(name) + 1
            raise DataError(f"{file}: run {at} names the file {name!r}, as run {first} does: leave one of them out.")
    # Each run is read when it is requested, so that the remaining time can be shown.
    runs = (_run(file, metadata, at, entry, trust) for at, entry in enumerate(entries, 1))
    return DriveLog(folder, metadata, tuple(showing_progress(runs, len(entries), "runs read")), trust)


def write_drive_log(folder: str | Path, traces: Mapping[str, Trace], metadata: LogMetadata) -> Path:
    """Write traces as a drive log, and return the folder of the log.

    Each trace is written to `NAME.csv` with all digits. `drive.toml` is written last, so a folder with this file always
    holds all runs.

    Parameters
    ----------
    folder : path
        The folder of the log; it is created if needed.
    traces : mapping
        Name of each run -> its trace.
    metadata : LogMetadata
        Declarations for drive.toml.

    Raises
    ------
    DataError
        There is no trace, a trace has no rows, a name is not a file name, or TOML cannot hold a value.

    Examples
    --------
    >>> write_drive_log("out", {"run": trace}, LogMetadata.of(trace, "test"))  # doctest: +SKIP
    """
    folder = Path(folder)
    # All names are checked before anything is written.
    for name, trace in traces.items():
        if Path(name).name != name or name.startswith("."):
            raise DataError(f"{folder}: '{name}' is not a file name for a run: leave out folders and leading dots.")
        if not len(trace.t):
            raise DataError(f"{folder}: run '{name}' has no rows, so there is nothing to write.")
    if not traces:
        raise DataError(f"{folder}: no trace was given, but a drive log needs at least one run.")
    # Empty declarations are omitted, so that the defaults apply when the log is read.
    declared = {key: value for key, value in dataclasses.asdict(metadata).items() if value not in ("", {})}
    entries = [_entry(name, trace) for name, trace in traces.items()]
    text = toml_text({"kind": KIND, **declared, "run": entries})
    for name, trace in traces.items():
        replace_file(folder / f"{name}.csv", columns_text(trace.channels))
    # drive.toml comes last: a folder with drive.toml holds every run that this file names.
    replace_file(folder / FILE, text)
    return folder


def _entry(name: str, trace: Trace) -> dict[str, Any]:
    """Return the table [[run]] that describes one trace in drive.toml.

    Units are written only for channels whose unit differs from the unit that the channel's name implies.
    """
    # The attributes `start` and `purpose` have their own keys in [[run]]. All other attributes are stored in `attrs`.
    head: dict[str, Any] = {key: trace.attrs[key] for key in ("start", "purpose") if key in trace.attrs}
    units = {channel: unit for channel, unit in trace.units.items() if unit != unit_of(channel)}
    attrs = {key: value for key, value in trace.attrs.items() if key not in ("file", *head)}
    return {"file": f"{name}.csv", **head, **({"units": units} if units else {}), **({"attrs": attrs} if attrs else {})}


def _run(file: Path, metadata: LogMetadata, at: int, entry: dict[str, Any], trust: Trust) -> Trace:
    """Read the file that an entry [[run]] names, and return its trace with the attributes of the run.

    `at` is the number of the run, counted from 1, for error messages.
    """
    for key in entry:
        if key not in RUN_KEYS:
            raise DataError(f"{file}: run {at} has an unknown key '{key}': {closest(key, RUN_KEYS)}")
    for key in ("units", "attrs", "terrain"):
        if not isinstance(entry.get(key, {}), dict):
            raise DataError(f"{file}: run {at} has {key} = {entry[key]!r}: give a table, such as {{ name = value }}.")
    name = entry.get("file")
    # The file must lie in the log's folder, unless the user trusts other places.
    path = trust.within(file.parent, name, f"{file}: run {at}") if name and isinstance(name, str) else None
    if path is None or not exists(path):
        raise DataError(
            f"{file}: run {at} names the file {name!r}, which is not in {file.parent}: add it, or correct its name."
        )
    attrs = {"file": name, "rover": metadata.rover, "gravity_mps2": metadata.gravity, "wheels": list(metadata.wheels)}
    # Only declared attributes are set, because readers distinguish undeclared from default values.
    if "start" in entry:
        # The start pose is x [m], y [m] and yaw [rad], each 0 if it is not stated.
        start = entry["start"]
        if not isinstance(start, dict) or not set(start) <= set(START_KEYS):
            raise DataError(
                f"{file}: run {at} has start = {start!r}: give a table with the keys x and y in m and yaw in rad, such "
                "as { x = 1.0, y = 0.0, yaw = 0.5 }."
            )
        try:
            place = {key: as_float(start.get(key, 0.0)) for key in START_KEYS}
        except (TypeError, ValueError):
            raise DataError(
                f"{file}: run {at} has start = {start!r}: x, y [m] and yaw [rad] must be numbers."
            ) from None
        # A yaw beyond a full turn is probably in degrees.
        if not all(map(math.isfinite, place.values())) or abs(place["yaw"]) > 2.0 * math.pi:
            raise DataError(
                f"{file}: run {at} has start = {start!r}: x and y [m] must be finite, and yaw must lie within one turn "
                "(2 pi): give yaw in rad, not in degrees."
            )
        attrs["start"] = place
    attrs |= {key: getattr(metadata, key) for key in ("input", "place") if getattr(metadata, key)}
    attrs |= {"terrain": entry["terrain"]} if "terrain" in entry else {}
    attrs |= {"purpose": str(entry["purpose"])} if "purpose" in entry else {}
    # If an attribute is stated twice, `attrs` of the [[run]] has priority, then the run's file, then drive.toml.
    trace = run_from(_table(file, metadata, path, trust), metadata.wheels, units=entry.get("units", {}))
    return Trace(trace.channels, trace.units, {**attrs, **trace.attrs, **entry.get("attrs", {})})


def _table(file: Path, metadata: LogMetadata, run: Path, trust: Trust) -> Columns:
    """Read the file of one run and return its columns as channels of the drive log.

    A table is converted by the entries of [columns]. A ROS bag is also resampled to even time steps, as [bag] states.
    """
    if not is_bag(run):
        table = read_columns(run)
        return map_columns(table, metadata.columns, str(file), metadata.wheels) if metadata.columns else table
    # A ROS 2 bag is a folder, whose files may be links to places outside the log.
    for part in run.iterdir() if is_folder(run) else [run]:
        trust.within(file.parent, str(part.relative_to(file.parent)), str(file))
    # The paths in a bag have been checked, so it can be read.
    return read_bag(run, metadata.columns, metadata.bag, str(file))


SAMPLE_PERIOD = "sample_period"
"""Key in the table [noise] of drive.toml for the time between two samples [s]."""
NOISE = {
    "wheel_rate": "rad/s",
    "angle": "rad",
    "current": "A",
    "body_position": "m",
    "body_attitude": "rad",
    "body_velocity": "m/s",
    "battery": "V",
    "gyro": "rad/s",
    "accelerometer": "m/s^2",
    SAMPLE_PERIOD: "s",
}
"""Keys of the table [noise] in drive.toml -> SI unit. Each key is one kind of channel, for example "current" for all
motor currents. "angle" means the angles of steering, rockers and bogies."""
STARTS = {
    "wheel_rate_": "wheel_rate",
    "rocker_": "angle",
    "bogie_": "angle",
    "current_": "current",
    "body_v": "body_velocity",
    "body_x": "body_position",
    "body_y": "body_position",
    "body_z": "body_position",
    "body_roll": "body_attitude",
    "body_pitch": "body_attitude",
    "body_yaw": "body_attitude",
    "battery_V": "battery",
    "gyro_": "gyro",
    "accelerometer_": "accelerometer",
}
"""Beginning of a channel's name -> key of the table [noise] that states the channel's noise. If several beginnings fit
a name, the longest one applies."""


def read_declared_noise(table: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the SD of one sample that the table [noise] declares for each kind of channel, in SI units.

    The sample period [s] is one more entry of the result if the table states it.

    Parameters
    ----------
    table : mapping
        The table [noise] of drive.toml: key of `NOISE` -> number or { value, unit }.
    where : str
        The drive.toml, for error messages.

    Raises
    ------
    DataError
        A key is unknown, or a value is not a positive number.
    ParameterError
        A unit does not fit the channel, or an entry has an unknown key.
    """
    noise = {}
    for key, entry in table.items():
        if key not in NOISE:
            raise DataError(f"{where}: there is no key '{key}' in [noise]: {closest(key, NOISE)}")
        noise[key] = _number(entry, NOISE[key], f"{where}: [noise] {key}")
    return noise


def kind_of(channel: str) -> str:
    """Return the key of the table [noise] for a channel, such as "angle" for rocker_l; '' if no key applies to the
    channel.
    """
    # If several beginnings fit the name, the longest one is the most specific.
    prefixes = [start for start in STARTS if channel.startswith(start)]
    return STARTS[max(prefixes, key=len)] if prefixes else ""


def _number(entry: Any, unit: str, where: str) -> float:
    """Return one value of the table [noise] in SI units, after checking that it is a positive number."""
    # A misspelt key, such as `units`, would otherwise be ignored and the number read in the wrong unit.
    if isinstance(entry, Mapping):
        refuse_strange(entry, where)
    value, declared_unit = value_and_unit(entry, unit)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < float("inf"):
        raise DataError(f"{where} has no number above 0; write {{ value = 0.01, unit = '{unit}' }}.")
    return to_si(value, declared_unit, unit, where)


def save_trace(trace: Trace, path: str | Path) -> Path:
    """Write a trace to a Parquet file if `path` ends with `.parquet`, and otherwise to a folder as a drive log of one
    run.

    All digits are kept. A file is either written completely or not at all, and `drive.toml` is written last.

    Parameters
    ----------
    trace : Trace
        The simulated or measured run.
    path : path
        A file with the suffix .parquet, or a folder.

    Returns
    -------
    Path
        The file or folder.

    Raises
    ------
    DataError
        The path cannot be written or has the suffix .csv, or the file cannot hold an attribute of the trace.

    Examples
    --------
    >>> save_trace(trace, "climb")  # doctest: +SKIP
    """
    path = Path(path)
    if path.suffix == ".parquet":
        return write_parquet(path, trace)
    if path.suffix == ".csv":
        raise DataError(
            f"{path}: a trace is saved either to a folder, which holds a CSV file and its description, or to a "
            ".parquet file: leave out the suffix .csv to write a folder."
        )
    return write_drive_log(path, {"run": trace}, LogMetadata.of(trace, path.name))


def load_trace(path: str | Path) -> Trace:
    """Read back a trace that `save_trace` wrote, from a Parquet file or from the folder of a drive log with one run.

    Raises DataError: the path is neither a Parquet file nor a drive log, or the log has several runs.
    """
    path = Path(path)
    if path.suffix == ".parquet":
        return read_run(path)
    runs = read_drive_log(path).runs
    if len(runs) > 1:
        raise DataError(
            f"{path}: the drive log has {len(runs)} runs, but `load_trace` reads a log with one run only: read the log "
            "with `read_drive_log` and choose a run."
        )
    return runs[0]
