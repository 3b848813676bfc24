"""Make a wheel-rig data set from a researcher's own table: recognise its columns, and estimate the noise from repeated
runs.

`RigTable` reads a table and recognises its columns. `write_rig_set` writes the files of the data set, which
`rig_reading.read_rig_set` reads.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.table import Table, read_table
from rover_pin.base.files.toml_file import toml_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.formula import evaluate, names_in, quote
from rover_pin.contact import Wheel
from rover_pin.measurements.channel import RIG_CHANNELS, sd_column
from rover_pin.measurements.checks import PAPER_DEFINITION, definition_advice, depths, slip_by_definition
from rover_pin.measurements.repeats import MIN_FREEDOM, level_numbers, repeat_groups, repeat_noise
from rover_pin.measurements.rig_columns import (
    CHANNEL_COLUMNS,
    KILOPOND,
    RIG_COLUMNS,
    Match,
    matches,
    scale_to,
    stated_unit,
    unit_of_wrong_kind,
)
from rover_pin.measurements.rig_file import ANGLE, GRAVITY, LOAD_MASS, SLIP_DEFINITION, SLOPE, SPEEDS
from rover_pin.measurements.rig_set import STRAIGHT
from rover_pin.parameters.gravity import EARTH
from rover_pin.soil.slip import slip_ratios

WHEEL_RATE = "wheel_rate_radps"
"""Name of the column with the angular rate omega of the wheel, for the computation of the rim speed r omega."""
UNITS = {column.column: column.unit for column in RIG_COLUMNS}
"""SI unit of each column of a data set, by the column's name; "text" for columns of text."""
TEXTS = tuple(name for name, unit in UNITS.items() if unit == "text")
"""Columns of a data set that hold text."""
PER_CENT = 1.5
"""Largest absolute slip that is accepted as a fraction although the table states no unit. If a slip is larger, the user
must state the unit (percent) or the definition of slip. The value allows for sensor errors at a slip of 1; a table in
percent has larger slips."""


class ColumnOrigin(NamedTuple):
    """Origin of one column of the new data set: a column of the researcher's table with its unit, or a formula in SI
    units.
    """

    name: str
    unit: str = ""
    formula: str = ""


class RigTable:
    """A researcher's table of rig runs, with the recognised meaning of its columns.

    The attribute `notes` describes how the columns were read, even if the table is refused afterwards.

    Parameters
    ----------
    file : Path
        A text table of any layout or a Parquet file, with one row for each steady run.
    formulas : mapping
        For a column of the new data set, a formula of the table's columns in SI, or the name of one column, which is
        read in the unit that its name states. A formula precedes every guess.

    Raises
    ------
    DataError
        The file is no table.
    """

    def __init__(self, file: Path, formulas: Mapping[str, str] = {}):
        self.file = file
        self.table: Table = read_table(file)
        self.table.refuse_faults()
        self.notes: list[str] = [note for note in self.table.notes if "repeats the column names" in note]
        self.sources: dict[str, ColumnOrigin] = {}
        self._ambiguous: dict[str, list[str]] = {}
        allowed = [*UNITS, *(sd_column(kind.column) for kind in RIG_CHANNELS)]
        for name, formula in formulas.items():
            if name not in allowed:
                raise ParameterError(f"--column {name}: there is no such column of a rig set: {closest(name, allowed)}")
            formula = formula.strip()
            if formula not in self.table.columns:
                names_in(formula, f"--column {name}")
                self.notes.append(f"{name} is {formula}, as --column states")
                self.sources[name] = ColumnOrigin(formula, formula=formula)
                continue
            # The name of one column of the table is no formula: the column is read in the unit that its name states. A
            # column of an SD has the unit of its channel.
            unit = stated_unit(formula, UNITS.get(name.replace("_sd_", "_"), ""))
            self.notes.append(f"{name} is '{formula}'{f' in {unit}' if unit else ''}, as --column states")
            self.sources[name] = ColumnOrigin(formula, unit)
        self._match_columns()

    def _match_columns(self) -> None:
        """Find, for each column of the researcher's table, the column of the new data set that it means, and store the
        result.

        Exact names precede guesses, and measured values precede commanded values.
        """
        declared = {source.name for source in self.sources.values()}
        candidates: dict[str, list[tuple[str, Match]]] = {}
        for name in self.table.columns:
            if name in declared:
                continue
            found = matches(name)
            if not found:
                wrong = unit_of_wrong_kind(name)
                why = (
                    f"its unit '{wrong}' does not fit this quantity"
                    if wrong
                    else "no column of a rig set has this name"
                )
                self.notes.append(f"'{name}' is not used: {why}")
                continue
            candidates.setdefault(found[0].column, []).append((name, found[0]))
        # A load in newtons and a mass in kilograms state the same quantity; newtons need no gravity.
        if "load_N" in candidates or "load_N" in self.sources:
            for name, _ in candidates.pop(LOAD_MASS, []):
                self.notes.append(f"'{name}' is not used: the load is given in newtons too")
        for column, rows in candidates.items():
            if column in self.sources:
                self.notes += [f"'{name}' is not used: --column states {column}" for name, _ in rows]
                continue
            # Exact names precede guesses, and measured values precede commanded ones.
            best = min((match.is_guess, match.is_set_point) for _, match in rows)
            chosen = [(name, match) for name, match in rows if (match.is_guess, match.is_set_point) == best]
            if len(chosen) > 1:
                self._ambiguous[column] = [name for name, _ in chosen]
                self.notes += [f"'{name}' may mean {column}, but another column may mean it too" for name, _ in chosen]
                continue
            ((name, match),) = chosen
            self.sources[column] = ColumnOrigin(name, match.unit)
            # The note states the unit only where it was converted or had to be assumed.
            unit = UNITS.get(column.replace("_sd_", "_"), "")
            has_unit = unit not in ("", "text")
            reading = []
            if match.unit and has_unit:
                reading.append(f"in {match.unit}")
                if "kg" in match.unit and column != LOAD_MASS:
                    reading.append(f"as kilopond of {KILOPOND:g} N")
            elif has_unit and (match.unit == "" or not column.endswith(f"_{unit.replace(' ', '')}")):
                reading.append(f"taken as {unit}")
            if match.is_guess:
                reading.append("a guess from part of its name")
            if match.is_set_point:
                reading.append("commanded values, because the table has no measured column of it")
            self.notes.append(", ".join([f"'{name}' is {column}", *reading]))
            for other, _ in rows:
                if other != name:
                    self.notes.append(f"'{other}' is not used: '{name}' already is {column}")

    def points(self, wheel: Wheel, slip_definition: str = PAPER_DEFINITION) -> pd.DataFrame:
        """Return the columns of the new data set in SI, one row for each run.

        Slips keep the definition that the researcher's table uses; the reader of the data set converts them.

        Parameters
        ----------
        wheel : Wheel
            Radius r [m], which converts a wheel rate to a rim speed.
        slip_definition : str
            The definition of slip that the user states, a name in `checks.SLIP_DEFINITIONS`.

        Raises
        ------
        DataError
            Two columns fit one column of the data set; a cell is no number; or the slip, the load or every measured
            channel is missing.
        """
        for column, names in self._ambiguous.items():
            raise DataError(
                f"{self.file}: {' and '.join(map(repr, names))} may both be {column}: give --column "
                f"{column}='{quote(names[0])}', or a mean such as '({quote(names[0])} + {quote(names[1])}) / 2'."
            )
        # All columns are converted to SI first, so that derived columns need no units.
        columns = {column: self._values(column, source) for column, source in self.sources.items()}
        # A wheel rate is no column of a set; its product with the radius is the rim speed.
        rate = columns.pop(WHEEL_RATE, None)
        if rate is not None and "rim_speed_mps" not in columns:
            columns["rim_speed_mps"] = rate * float(wheel.r)
            self.notes.append(f"rim_speed_mps is '{self.sources[WHEEL_RATE].name}' times r = {float(wheel.r):g} m")
        # The slip of a wheel at a slip angle is that of its travel along its own plane.
        if "slip" not in columns and set(SPEEDS) <= columns.keys():
            travel, rim = (columns[name] for name in SPEEDS)
            columns["slip"] = slip_ratios(rim, travel * np.cos(columns.get(ANGLE, 0.0)))
            self.notes.append("slip follows from travel and rim speed by Eq (1)")
        # Predictions of side force and vertical moment are compared only in runs with a slip angle. If no run has one,
        # both channels are left out.
        if ANGLE not in columns or not bool((np.abs(columns[ANGLE]) > STRAIGHT).any()):
            for kind in (kind for kind in RIG_CHANNELS if kind.is_sideways and kind.column in columns):
                del columns[kind.column]
                columns.pop(sd_column(kind.column), None)
                self.notes.append(
                    f"{kind.column} is not used: the {kind.name} is compared only in runs with {ANGLE} above "
                    f"{STRAIGHT}; add the column {ANGLE}, positive if the wheel travels to its right"
                )
        # A set needs a slip, a load and a measured channel. On a slope, the pull is the component of the weight along
        # the slope, and a mass gives the load.
        if SLOPE not in columns and not any(kind.column in columns for kind in RIG_CHANNELS):
            raise DataError(
                f"{self.file}: no column is recognised as a measured channel: name a column drawbar_pull_N, "
                f"torque_Nm or sinkage_m, or give --column drawbar_pull_N='FORMULA'. {self._names()}"
            )
        missing = [name for name in ("slip", "load_N") if name not in columns]
        if "load_N" in missing and LOAD_MASS in columns:
            missing.remove("load_N")
        if missing:
            constant = " If all runs have one load, give --column load_N=50." if "load_N" in missing else ""
            raise DataError(
                f"{self.file}: no column is recognised as {' or '.join(missing)}: rename a column of the table, or "
                f"give --column {missing[0]}='FORMULA' with columns of the table.{constant} {self._names()}"
            )
        self._refuse_other_slips(columns["slip"], slip_definition)
        if "sinkage_m" in columns:
            depths(columns["sinkage_m"], float(wheel.r), f"'{self.sources['sinkage_m'].name}'", str(self.file))
        # Columns are written in a fixed order, each once.
        order = [name for name in (*UNITS, *(sd_column(kind.column) for kind in RIG_CHANNELS)) if name in columns]
        return pd.DataFrame({name: columns[name] for name in dict.fromkeys(order)})

    def _values(self, column: str, source: ColumnOrigin) -> np.ndarray:
        """Return the values of one column of the new data set in SI (runs,), or as text for a column of text.

        `source` is the origin of the column: a column of the researcher's table, or a formula.
        """
        if column in TEXTS:
            return np.array([str(cell) for cell in self.table.columns[source.name]])
        if source.formula:
            used = {
                name: self.table.numbers(name)
                for name in names_in(source.formula, column)
                if name in self.table.columns
            }
            absent = [name for name in names_in(source.formula, column) if name not in self.table.columns]
            if absent:
                raise DataError(
                    f"--column {column}: there is no column '{absent[0]}': {closest(absent[0], self.table.columns)}"
                )
            # A formula without columns is a constant, which needs a column for its number of rows.
            rows = used or {"row": np.zeros(len(self.table.places))}
            return evaluate(source.formula, rows, f"--column {column}")
        # A column without a unit in its name is taken as SI.
        values = self.table.numbers(source.name)
        return values * (scale_to(source.unit, UNITS[column.replace("_sd_", "_")]) if source.unit else 1.0)

    def _names(self) -> str:
        """Return a sentence that lists the column names of the researcher's table, for error messages."""
        return f"The table has {', '.join(map(quote, self.table.columns))}."

    def _refuse_other_slips(self, slip: np.ndarray, definition: str) -> None:
        """Raise DataError if slips look like percent or like slips of another definition, unless the user has stated
        unit or definition.
        """
        if definition != PAPER_DEFINITION:
            slip_by_definition(slip, definition, str(self.file))
            return
        # A slip of Eq (1) lies in [-1, 1]; the tolerance admits sensor errors.
        known = slip[np.isfinite(slip)]
        if not known.size or np.abs(known).max() <= PER_CENT:
            return
        source = self.sources.get("slip", ColumnOrigin("slip"))
        farthest = float(known[np.abs(known).argmax()])
        other = "over-travel-speed" if farthest > 0.0 else "over-rim-speed"
        divisor = other[5:].replace("-", " ")
        definition_text = f"If the difference r omega - v was divided by the {divisor}, {definition_advice(other)}."
        formula = f"{quote(source.name)} / 100"
        percent = f" If the slip is in percent, name the column '{source.name} (%)', or give --column slip='{formula}'."
        percent = "" if source.unit else percent
        raise DataError(
            f"{self.file}: '{source.name}' reaches {farthest:g} as a fraction, but the slip of Eq (1), "
            f"(r omega - v) / max(r omega, v), lies in [-1, 1].{percent} {definition_text}"
        )

    def noise(
        self, points: pd.DataFrame, stated: Mapping[str, float], slip_definition: str = PAPER_DEFINITION
    ) -> dict[str, dict[str, Any]]:
        """Return the entries of the table [noise] in rig.toml: the SD of each channel, as stated by the user or as
        estimated from repeated runs.

        A channel whose SD is a column of the points needs no entry.

        Parameters
        ----------
        points : DataFrame
            The result of `points`.
        stated : mapping
            SD [SI] that the user states, by name of the channel, such as "drawbar_pull".
        slip_definition : str
            The definition of slip in `points`.

        Returns
        -------
        dict
            For each channel, a table with value, unit and source.

        Raises
        ------
        DataError
            A channel has no stated SD and too few repeats to estimate one.
        """
        # Repeats are found by the slip of Eq (1), in which slips of all definitions are comparable.
        slip = slip_by_definition(points["slip"].to_numpy(), slip_definition, str(self.file))
        load = points["load_N" if "load_N" in points else LOAD_MASS].to_numpy()
        angle = points[ANGLE].to_numpy() if ANGLE in points else np.zeros(len(slip))
        # Runs of one slip level, load and slip angle repeat one another.
        levels = level_numbers(slip, points["level"].to_numpy() if "level" in points else None)
        group = repeat_groups(levels, load, angle)
        entries: dict[str, dict[str, Any]] = {}
        silent = []
        for kind in RIG_CHANNELS:
            name = kind.column.rpartition("_")[0]
            if kind.column not in points:
                continue
            if name in stated:
                entries[name] = {"value": stated[name], "unit": kind.unit, "source": f"stated with --noise {name}"}
            elif sd_column(kind.column) not in points:
                scatter = repeat_noise(points[kind.column].to_numpy(), slip, group)
                if scatter is None:
                    silent.append(kind)
                    continue
                rows = ", ".join(str(run + 1) for run in scatter.outlying)
                without = f", without the outlying repeats in rows {rows}" if rows else ""
                source = f"scatter of repeats in this table, {scatter.freedom} degrees of freedom{without}"
                # Three digits are more than the scatter of a few repeats determines.
                entries[name] = {"value": float(f"{scatter.sd:.3g}"), "unit": kind.unit, "source": source}
                self.notes.append(f"noise of {name}: {entries[name]['value']:g} {kind.unit}, {entries[name]['source']}")
        if silent:
            names = [kind.column.rpartition("_")[0] for kind in silent]
            options = " ".join(
                f"--noise {name}=1{kind.unit.replace(' ', '')}" for name, kind in zip(names, silent, strict=True)
            )
            raise DataError(
                f"{self.file}: the noise of {', '.join(names)} is not stated, and it cannot be estimated, because "
                f"fewer than {MIN_FREEDOM} values repeat others at the same slip and load. Give {options} with the SD "
                f"of one run, or add a column {sd_column(silent[0].column)}."
            )
        return entries


def channel_unit(name: str) -> str:
    """Return the SI unit of a channel whose noise a user can state: drawbar_pull, torque, sinkage, lateral or moment_z.

    Raises ParameterError if there is no such channel.
    """
    units = {column.rpartition("_")[0]: UNITS[column] for column in UNITS if column in CHANNEL_COLUMNS}
    if name not in units:
        raise ParameterError(f"--noise {name}: there is no such channel: {closest(name, units)}")
    return units[name]


def write_rig_set(
    folder: Path,
    name: str,
    points: pd.DataFrame,
    wheel: Wheel,
    noise: Mapping[str, Mapping[str, Any]],
    gravity: float | None = None,
    slip_definition: str = PAPER_DEFINITION,
) -> list[Path]:
    """Write the files points.csv and rig.toml of a wheel-rig data set, and return the paths of both files.

    Parameters
    ----------
    folder : Path
        The folder of the data set.
    name : str
        Name of the data set.
    points : DataFrame
        The runs, from `RigTable.points`.
    wheel : Wheel
        Sizes of the wheel [m].
    noise : mapping
        For each channel, its entry in [noise]: value, unit and source.
    gravity : float or None
        Gravity at the test [m/s^2]; written only if the user states it.
    slip_definition : str
        The definition of slip in `points`; `read_rig_set` converts these slips to Eq (1).

    Raises
    ------
    DataError
        The folder already holds a data set, or the files cannot be written.
    """
    toml = folder / "rig.toml"
    # Nothing is overwritten.
    for file in (toml, folder / "points.csv"):
        if is_file(file):
            raise DataError(f"{file} already exists: give another folder, or remove this file first.")
    # A gravity that was only assumed is not written, so that reading the file reports the assumption.
    document: dict[str, Any] = {
        "kind": "wheel-rig",
        "name": name,
        "source": "who measured this, where, when: write it here",
    }
    if gravity is not None:
        document[GRAVITY] = {"value": gravity, "unit": "m/s^2", "source": "stated with --gravity"}
    if slip_definition != PAPER_DEFINITION:
        document[SLIP_DEFINITION] = slip_definition
    document |= {
        "files": {"points": "points.csv"},
        "wheel": {field: {"value": value, "unit": "m"} for field, value in wheel.values().items()},
    }
    if noise:
        document["noise"] = {key: dict(entry) for key, entry in noise.items()}
    # rig.toml comes last: a folder with rig.toml holds complete points.
    written = replace_file(folder / "points.csv", points.to_csv(index=False))
    return [written, replace_file(toml, toml_text(document))]


def gravity_note(points: pd.DataFrame, gravity: float | None) -> str:
    """Return a note that states the gravity in the conversion of masses on the wheel to loads; empty if the table has
    no masses.
    """
    if LOAD_MASS not in points or "load_N" in points:
        return ""
    source = "the Earth's, assumed: give --gravity if the test was elsewhere" if gravity is None else "from --gravity"
    return f"{LOAD_MASS} becomes load_N with g = {EARTH if gravity is None else gravity:g} m/s^2, {source}"
