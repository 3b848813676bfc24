"""Drive logs: a folder with `drive.toml` and one CSV, Parquet file or ROS bag a run, measured and simulated alike.

`drive.toml` as in::

    kind = "drive-log"
    name = "slope"
    source = "our test field, 2026"
    rover = "nexus6"                      # or a TOML beside its URDF
    gravity = 9.81                        # m/s^2, or { value = ..., unit = "..." }
    wheels = ["fl", "fr", "ml", "mr", "rl", "rr"]
    input = "rates"                       # hold the wheels to their measured rates; else duties, where logged
    angles = "sinkage"                    # or "fixed", Table 1's, as is usual for the paper's wheels
    [terrain]                             # see log_terrain
    polyline = "slope.csv"
    [soil]                                # what is known of it: { value, unit, sd }; so [wheel], [motor]
    phi = { value = 30.0, unit = "deg" }
    [resistance]                          # R of `MotionResistance`; else that of a flat cruised at S = 0.05
    R = { value = 0.028, unit = "" }
    [tracker]                             # error of its scale e and its delay d, as of visual odometry; the point x, y
    e = { value = 0.0, sd = 0.02 }
    [noise]                               # one SD of a sample for each kind of channel, see log_noise
    wheel_rate = { value = 0.02, unit = "rad/s" }
    [[run]]
    file = "climb.csv"
    start = { x = 0.0, y = 0.0, yaw = 0.0 }
    purpose = "climb until it stops"
    terrain = { slope = { value = 12, unit = "deg" } }   # of this run, see run_terrain
    units = { wheel_rate_fl = "rpm" }     # of columns that are not in the unit that their name tells

`column_map` says how columns of other names, units and forms are read, `bag_columns` the same of ROS bags.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.columns import Columns, columns_text, read_columns
from rover_pin.base.files.paths import exists, is_file, is_folder
from rover_pin.base.files.toml_file import read_toml, toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.jobs.time_left import telling
from rover_pin.base.public import brief
from rover_pin.base.quantity import as_float
from rover_pin.base.trust import Trust
from rover_pin.logs.column_map import map_columns
from rover_pin.logs.declared_noise import read_declared_noise
from rover_pin.logs.ros_bag import is_bag, read_bag
from rover_pin.logs.run_terrain import is_of_run, run_terrain
from rover_pin.parameters.gravity import EARTH, gravity_from
from rover_pin.rover.rover import Rover, load_named
from rover_pin.simulation.trace.channels import DUTIES, ODOMETRY, RATES, WHEELS, unit_of
from rover_pin.simulation.trace.files import run_from
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.angles import ANGLES
from rover_pin.terrain.shapes import flat
from rover_pin.terrain.terrain import Terrain
from rover_pin.terrain.toml_table import terrain_from

FILE, KIND = "drive.toml", "drive-log"
RUN_KEYS, START_KEYS = ("file", "start", "purpose", "units", "attrs", "terrain"), ("x", "y", "yaw")


@brief
@dataclass(frozen=True)
class LogMetadata:
    """What a drive log declares besides its runs; the tables stay as written."""

    name: str
    source: str = ""
    rover: str = "nexus6"
    gravity: float = EARTH
    wheels: tuple[str, ...] = WHEELS
    input: str = ""
    "duties or rates; empty: duties where they are logged"
    place: str = ""
    "odometry where the pose was computed of the wheels; empty: it was measured"
    angles: str = ""
    "fixed or sinkage, how the contact arc is found; empty: fixed for the paper's wheels"
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
        """Return what a trace's attributes tell of its log."""
        rover, gravity = trace.attrs.get("rover", "nexus6"), trace.attrs.get("gravity_mps2", EARTH)
        return cls(name, trace.attrs.get("made_by", ""), rover, gravity, trace.wheels or WHEELS)


TABLES = ("terrain", "soil", "wheel", "motor", "resistance", "tracker", "noise", "columns", "bag")
TEXTS = ("name", "source", "rover", "licence", "method", "input", "place", "angles")
WORDS = {"input": ("", DUTIES, RATES), "place": ("", ODOMETRY), "angles": ("", *ANGLES)}


@brief
@dataclass(frozen=True)
class DriveLog:
    """The runs of a drive log in its order; each trace's attributes have its file, purpose, start, rover, gravity."""

    folder: Path
    metadata: LogMetadata
    runs: tuple[Trace, ...]
    trust: Trust = Trust()
    "of the user in the log, whose files else lie in its folder"

    @property
    def file(self) -> Path:
        """What declares it."""
        return self.folder / FILE

    def run(self, name: str) -> Trace:
        """Return the run whose file is `name`, with or without its suffix."""
        stems = [Path(trace.attrs["file"]).stem for trace in self.runs]
        for trace, stem in zip(self.runs, stems, strict=True):
            if name in (stem, Path(trace.attrs["file"]).name):
                return trace
        raise ParameterError(f"{self.folder}: there is no run '{name}': {closest(name, stems)}")

    def terrain(self) -> Terrain:
        """Return the terrain that the log declares for all runs; flat ground where each run has its own."""
        if self.metadata.terrain and not is_of_run(self.metadata.terrain):
            return terrain_from(self.metadata.terrain, self.file, self.trust)
        return flat()

    def terrain_of(self, run: Trace) -> Terrain | None:
        """Return the terrain of a run that has its own: declared, a slope, or estimated; None where it has the log's.

        Where nothing is declared at all it is estimated, as far as the run tells it.
        """
        declared = run.attrs.get("terrain")
        table = declared or self.metadata.terrain or {"estimated": True}
        if is_of_run(table):
            return run_terrain(table, run, self.load_rover(), f"{self.folder}: {run.attrs.get('file', 'run')}: terrain")
        return None if declared is None else terrain_from(table, self.file, self.trust)

    def is_estimated(self, run: Trace) -> bool:
        """Return whether the ground under a run is estimated from the run itself."""
        table = run.attrs.get("terrain") or self.metadata.terrain
        return not table or bool(table.get("estimated"))

    @property
    def noise_sd(self) -> dict[str, float]:
        """What the log declares of its sensors, in SI: see `read_declared_noise`."""
        return read_declared_noise(self.metadata.noise, str(self.file))

    def load_rover(self) -> Rover:
        """Return the rover that the log names."""
        return load_named(self.metadata.rover, self.file, self.trust)

    @property
    def rover(self) -> str:
        """What `load_rover` takes: the rover's name, or the path of its file in the folder."""
        beside = self.folder / self.metadata.rover
        return str(beside) if is_file(beside) else self.metadata.rover


def read_drive_log(folder: str | Path, trust: Trust = Trust()) -> DriveLog:
    """Return the drive log in a folder; its runs and its terrain lie there, unless `trust` allows more.

    Raises DataError: no `drive.toml`, one that is not TOML or not a drive log, an unknown or missing key, a run file
    that is missing or lies elsewhere, or that `read_run` refuses.
    """
    folder = Path(folder)
    file = folder / FILE
    if not is_file(file):
        raise DataError(
            f"{folder}: there is no {FILE}: give the folder of a drive log, or write one with `write_drive_log`."
        )
    table = read_toml(file)
    if table.get("kind") != KIND:
        raise DataError(f"{file}: kind = {table.get('kind')!r}, but a drive log has kind = '{KIND}'.")
    entries = table.get("run")
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        raise DataError(f"{file}: there is no run: add a [[run]] with file = '...' for each.")
    metadata = _checked_metadata(file, {key: value for key, value in table.items() if key not in ("kind", "run")})
    _refuse_twice(file, [entry.get("file") for entry in entries])
    runs = (_run(file, metadata, at, entry, trust) for at, entry in enumerate(entries, 1))
    return DriveLog(folder, metadata, tuple(telling(runs, len(entries), "runs read")), trust)


def write_drive_log(folder: str | Path, traces: Mapping[str, Trace], metadata: LogMetadata) -> Path:
    """Write traces, each to `NAME.csv` with every digit, then `drive.toml`; return the folder.

    Raises DataError: no trace, one without rows, a name that is no file name, or a value that TOML cannot hold.
    """
    folder = Path(folder)
    for name, trace in traces.items():
        if Path(name).name != name or name.startswith("."):
            raise DataError(f"{folder}: '{name}' is not a file name for a run: leave out folders and leading dots.")
        if not len(trace.t):
            raise DataError(f"{folder}: run '{name}' has no rows, so there is nothing to write.")
    if not traces:
        raise DataError(f"{folder}: a drive log needs one run at least.")
    declared = {key: value for key, value in dataclasses.asdict(metadata).items() if value not in ("", {})}
    entries = [_entry(name, trace) for name, trace in traces.items()]
    text = toml_text({"kind": KIND, **declared, "run": entries})
    for name, trace in traces.items():
        replace_file(folder / f"{name}.csv", columns_text(trace.channels))
    replace_file(folder / FILE, text)
    return folder


def _entry(name: str, trace: Trace) -> dict[str, Any]:
    """Return a run's entry; units that a channel's name tells are left out."""
    head: dict[str, Any] = {key: trace.attrs[key] for key in ("start", "purpose") if key in trace.attrs}
    units = {channel: unit for channel, unit in trace.units.items() if unit != unit_of(channel)}
    attrs = {key: value for key, value in trace.attrs.items() if key not in ("file", *head)}
    return {"file": f"{name}.csv", **head, **({"units": units} if units else {}), **({"attrs": attrs} if attrs else {})}


def _checked_metadata(file: Path, table: dict[str, Any]) -> LogMetadata:
    keys = [entry.name for entry in dataclasses.fields(LogMetadata)]
    for key, value in table.items():
        if key not in keys:
            raise DataError(f"{file}: there is no key '{key}' in a drive log: {closest(key, keys)}")
        kind, word = (dict, "a table") if key in TABLES else (str, "text")
        if key in (*TABLES, *TEXTS) and not isinstance(value, kind):
            raise DataError(f"{file}: {key} = {value!r} must be {word}.")
    for key, words in WORDS.items():
        if table.get(key, "") not in words:
            raise DataError(f"{file}: {key} = {table[key]!r}: write {' or '.join(map(repr, words[1:]))}.")
    read_declared_noise(table.get("noise", {}), str(file))
    if not table.get("name"):
        raise DataError(f"{file}: there is no name: add name = '...'.")
    wheels = table.get("wheels", list(WHEELS))
    if not isinstance(wheels, list) or not all(isinstance(wheel, str) for wheel in wheels):
        raise DataError(f"{file}: wheels = {wheels!r} must be a list of names, as ['fl', 'fr'].")
    gravity = gravity_from(table.get("gravity", EARTH), str(file))
    return LogMetadata(**{**table, "wheels": tuple(wheels), "gravity": gravity})


def _refuse_twice(file: Path, names: list[Any]) -> None:
    for at, name in enumerate(names, 1):
        if name in names[: at - 1]:
            first = names.index(name) + 1
            raise DataError(f"{file}: run {at} names the file {name!r}, as run {first} does: leave one of them out.")


def _run(file: Path, metadata: LogMetadata, at: int, entry: dict[str, Any], trust: Trust) -> Trace:
    for key in entry:
        if key not in RUN_KEYS:
            raise DataError(f"{file}: run {at} has an unknown key '{key}': {closest(key, RUN_KEYS)}")
    for key in ("units", "attrs", "terrain"):
        if not isinstance(entry.get(key, {}), dict):
            raise DataError(f"{file}: run {at} has {key} = {entry[key]!r}: give a table.")
    name = entry.get("file")
    path = trust.within(file.parent, name, f"{file}: run {at}") if name and isinstance(name, str) else None
    if path is None or not exists(path):
        raise DataError(
            f"{file}: run {at} names the file {name!r}, which is not in {file.parent}: add it, or mend its name."
        )
    attrs = {"file": name, "rover": metadata.rover, "gravity_mps2": metadata.gravity, "wheels": list(metadata.wheels)}
    attrs |= {"start": _start(file, at, entry["start"])} if "start" in entry else {}
    attrs |= {key: getattr(metadata, key) for key in ("input", "place") if getattr(metadata, key)}
    attrs |= {"terrain": entry["terrain"]} if "terrain" in entry else {}
    attrs |= {"purpose": str(entry["purpose"])} if "purpose" in entry else {}
    trace = run_from(_table(file, metadata, path, trust), metadata.wheels, units=entry.get("units", {}))
    return Trace(trace.channels, trace.units, {**attrs, **trace.attrs, **entry.get("attrs", {})})


def _table(file: Path, metadata: LogMetadata, run: Path, trust: Trust) -> Columns:
    if not is_bag(run):
        table = read_columns(run)
        return map_columns(table, metadata.columns, str(file), metadata.wheels) if metadata.columns else table
    for part in run.iterdir() if is_folder(run) else [run]:
        trust.within(file.parent, str(part.relative_to(file.parent)), str(file))
    return read_bag(run, metadata.columns, metadata.bag, str(file))


def _start(file: Path, at: int, start: Any) -> dict[str, float]:
    if not isinstance(start, dict) or not set(start) <= set(START_KEYS):
        raise DataError(f"{file}: run {at} has start = {start!r}: give {{ x = [m], y = [m], yaw = [rad] }}.")
    try:
        place = {key: as_float(start.get(key, 0.0)) for key in START_KEYS}
    except (TypeError, ValueError):
        raise DataError(f"{file}: run {at} has start = {start!r}: x, y [m] and yaw [rad] must be numbers.") from None
    if not all(map(math.isfinite, place.values())) or abs(place["yaw"]) > 2.0 * math.pi:
        raise DataError(f"{file}: run {at} has start = {start!r}: give finite x, y [m], and yaw in rad, not degrees.")
    return place
