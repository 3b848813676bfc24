"""A wheel-rig set out of a table of one's own: its columns known by their names and units, written in SI."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.table import measured_points
from rover_pin.base.files.toml_file import toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.quantity import to_si
from rover_pin.base.units import name_and_unit
from rover_pin.contact import Wheel
from rover_pin.measurements.channel import RIG_CHANNELS
from rover_pin.measurements.checks import column
from rover_pin.measurements.rig_file import ANGLE
from rover_pin.measurements.rig_set import STRAIGHT


class RigColumn(NamedTuple):
    """A column of a set, its SI unit, and what others call it."""

    column: str
    unit: str
    names: tuple[str, ...]


RIG_COLUMNS = (
    RigColumn("slip", "", ("slip", "slip ratio", "s", "i")),
    RigColumn("load_N", "N", ("load", "vertical load", "normal load", "w", "fz")),
    RigColumn("drawbar_pull_N", "N", ("drawbar pull", "drawbar", "dp", "fx", "pull")),
    RigColumn("torque_Nm", "N m", ("torque", "wheel torque", "driving torque", "my", "t")),
    RigColumn("sinkage_m", "m", ("sinkage", "wheel sinkage", "z", "h")),
    RigColumn("lateral_N", "N", ("lateral", "lateral force", "side force", "fy")),
    RigColumn("moment_z_Nm", "N m", ("moment z", "mz", "vertical moment", "yaw moment", "steering moment")),
    RigColumn("drawbar_pull_sd_N", "N", ("drawbar pull sd", "dp sd")),
    RigColumn("torque_sd_Nm", "N m", ("torque sd",)),
    RigColumn("sinkage_sd_m", "m", ("sinkage sd",)),
    RigColumn("lateral_sd_N", "N", ("lateral sd", "side force sd")),
    RigColumn("moment_z_sd_Nm", "N m", ("mz sd",)),
    RigColumn("travel_speed_mps", "m/s", ("travel speed", "carriage speed", "v", "vx")),
    RigColumn("rim_speed_mps", "m/s", ("rim speed", "circumferential speed")),
    RigColumn("slope_rad", "rad", ("slope", "slope angle", "incline")),
    RigColumn("slip_angle_rad", "rad", ("slip angle", "beta")),
    RigColumn("run", "text", ("run", "test", "trial", "id")),
    RigColumn("level", "text", ("level", "slip level")),
)
NEEDED = ("slip", "load_N")


class Read(NamedTuple):
    """A table's columns as those of a set, and what was understood of them."""

    table: pd.DataFrame
    notes: tuple[str, ...]

    def refuse_without_noise(self, file: Path, noise_names: Iterable[str]) -> None:
        """Refuse a channel whose scatter nobody states: without it no fit can be judged.

        Raises DataError: a channel without a column of its SD and without a stated one.
        """
        for kind in RIG_CHANNELS:
            name, _, unit = kind.column.rpartition("_")
            if kind.column in self.table and name not in noise_names and f"{name}_sd_{unit}" not in self.table:
                raise DataError(
                    f"{file}: how much {name} scatters is not said: add a column {name}_sd_{unit}, or say "
                    f"--noise {name}=1{kind.unit.replace(' ', '')} with the SD of repeats."
                )


def read_foreign(file: Path) -> Read:
    """Return a table with the columns of a wheel-rig set, in SI.

    A unit is in brackets or at the end of a name: `Sinkage [mm]`, `sinkage_mm`, `Slip (%)`; without one it is SI.

    Raises DataError: the file cannot be read, has two columns for one, a unit of another kind, or neither slip nor
    load.
    """
    table = measured_points(file)
    columns: dict[str, Any] = {}
    notes = []
    for name in map(str, table.columns):
        stem, unit = name_and_unit(name)
        rig_column = next(
            (candidate for candidate in RIG_COLUMNS if _plain(stem) in (*candidate.names, _plain(candidate.column))),
            None,
        )
        if rig_column is None:
            notes.append(f"'{name}' is not used: no column of a wheel-rig set is known by it")
            continue
        if rig_column.column in columns:
            raise DataError(
                f"{file}: two columns are {rig_column.column}, '{name}' is the second: leave one of them out."
            )
        columns[rig_column.column] = _in_si(table[name], unit, rig_column, f"{file}: '{name}'")
        guessed = "" if unit or rig_column.unit in ("", "text") else f", taken as {rig_column.unit}"
        notes.append(f"'{name}' is {rig_column.column}{guessed}")
    askew = ANGLE in columns and bool((abs(columns[ANGLE]) > STRAIGHT).any())
    for kind in RIG_CHANNELS:
        if kind.is_sideways and not askew and kind.column in columns:
            del columns[kind.column]
            notes.append(
                f"{kind.column} is not used: a {kind.name} is looked at in runs with {ANGLE} above {STRAIGHT} only; "
                "add that column, positive where the wheel travels to its right"
            )
    if not any(kind.column in columns for kind in RIG_CHANNELS):
        raise DataError(f"{file}: nothing that was measured is known: name it drawbar_pull_N, torque_Nm or sinkage_m.")
    missing = [name for name in NEEDED if name not in columns]
    if missing:
        raise DataError(
            f"{file}: no column is known as {' or '.join(missing)}: name it so, as in slip, load_N, drawbar_pull_N, "
            f"torque_Nm, sinkage_m. It has {', '.join(map(str, table.columns))}."
        )
    return Read(pd.DataFrame(columns), tuple(notes))


def _plain(name: str) -> str:
    return re.sub(r"[\s_\-]+", " ", name).strip().lower()


def _in_si(values: Any, unit: str, rig_column: RigColumn, where: str) -> Any:
    if rig_column.unit == "text":
        return values.astype(str)
    values = column(values, "the column", where, gaps=True)
    try:
        return values * (to_si(1.0, unit, rig_column.unit, where) if unit else 1.0)
    except ParameterError as error:
        raise DataError(str(error)) from error


def channel_unit(name: str) -> str:
    """Return the unit of a channel that can have noise: drawbar_pull, torque, sinkage, lateral."""
    units = {kind.column.rpartition("_")[0]: kind.unit for kind in RIG_CHANNELS}
    if name not in units:
        raise ParameterError(f"--noise {name}: there is no such channel: {closest(name, units)}")
    return units[name]


def write_rig_set(
    folder: Path, name: str, read: Read, wheel: Wheel, noise: Mapping[str, tuple[float, str]]
) -> list[Path]:
    """Write points.csv and rig.toml of a set, with the noise of each channel (number, unit); return their paths.

    Raises DataError: there is a rig.toml already, or it cannot be written.
    """
    toml = folder / "rig.toml"
    if is_file(toml):
        raise DataError(f"{toml}: there is one already: name another folder, or take it away first.")
    document = {
        "kind": "wheel-rig",
        "name": name,
        "source": "who measured this, where, when: write it here",
        "files": {"points": "points.csv"},
        "wheel": {field: {"value": value, "unit": "m"} for field, value in wheel.values().items()},
        **({"noise": {key: {"value": value, "unit": unit} for key, (value, unit) in noise.items()}} if noise else {}),
    }
    points = replace_file(folder / "points.csv", read.table.to_csv(index=False))
    return [points, replace_file(toml, toml_text(document))]
