"""Convert the columns of a run's table to the channels of a drive log, as the table `[columns]` of drive.toml states.

Each entry of `[columns]` gives the source (a column or a formula), the unit and the scale of one channel.

In `drive.toml`::

    [columns]
    t_s = { column = "Zeit", unit = "ms" }
    body_x = "Position X"                                # a column's name, or a formula
    wheel_rate_fl = { formula = "v_left / 0.165" }
    current_fl_A = { column = "raw 1", scale = 0.01, offset = -2.5 }   # scale * raw + offset
    body_yaw = { formula = "yaw(qx, qy, qz, qw)" }
    body_x = { formula = "east(lat, lon)" }

`rover_pin.base.formula` describes the formulas, which may name columns of earlier lines. A column whose name is already
the name of a drive-log channel, for example `body_x`, needs no entry.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.table import Columns
from rover_pin.base.formula import evaluate
from rover_pin.base.quantity import to_si
from rover_pin.simulation.trace.channels import is_column, unit_of

KEYS = ("column", "formula", "unit", "scale", "offset")
"""Keys that an entry of the table [columns] in drive.toml may have. Any other key is refused."""


def map_columns(table: Columns, entries: Mapping[str, Any], where: str, wheels: Sequence[str]) -> Columns:
    """Return the channels of a drive log that a run's table holds, after conversion by the entries of [columns].

    A column whose name is already the name of a channel is taken unchanged. Every entry of [columns] adds one channel.

    Parameters
    ----------
    table : Columns
        The columns of a run's file.
    entries : mapping
        The table [columns] of drive.toml: channel -> entry.
    where : str
        The drive.toml, for error messages.
    wheels : sequence of str
        Names of the wheels, which occur in the channels' names.

    Raises
    ------
    DataError
        An entry states neither a column nor a formula, or names an unknown column, key or unit.
    """
    # A column whose name is the name of a channel needs no entry.
    direct = {name: values for name, values in table.values.items() if is_column(name, wheels)}
    derived: dict[str, np.ndarray] = {}
    for name, entry in entries.items():
        place = f"{where}: [columns] {name}, {table.path.name}"
        # Formulas may use channels of earlier entries.
        derived[name] = mapped_column(name, entry, {**table.values, **derived}, place)
    return Columns(table.path, direct | derived, table.places)


def mapped_column(name: str, entry: Any, columns: Mapping[str, np.ndarray], where: str) -> np.ndarray:
    """Return the values (rows,) of one channel in its SI unit, computed as its entry in [columns] states.

    The values are scale * column + offset, or scale * formula + offset, converted from the unit that the entry states.

    Parameters
    ----------
    name : str
        Name of the channel. The name determines the SI unit.
    entry : str or mapping
        A column's name, a formula, or a table with `column` or `formula` and optionally unit, scale and offset.
    columns : mapping
        Name -> values (rows,) of each column that the entry may use.
    where : str
        Place of the entry, for error messages.

    Raises
    ------
    DataError
        The entry states neither a column nor a formula, or names an unknown column, key or unit.
    """
    # A text is a column's name if such a column exists, else a formula.
    table = {"column" if entry in columns else "formula": entry} if isinstance(entry, str) else entry
    if not isinstance(table, Mapping) or len({"column", "formula"} & table.keys()) != 1:
        raise DataError(
            f"{where} = {table!r} does not state the source of the channel: write the name of a column, "
            "{ column = '...' } or "
            "{ formula = '...' }."
        )
    # In Python, True is also an int, so that `scale = true` needs its own check.
    for key, value in table.items():
        if key not in KEYS:
            raise DataError(f"{where} has an unknown key '{key}': {closest(key, KEYS)}")
        kind: tuple[type, ...] = (int, float) if key in ("scale", "offset") else (str,)
        if not isinstance(value, kind) or isinstance(value, bool):
            raise DataError(f"{where}: {key} = {value!r} must be {'a number' if float in kind else 'text'}.")
    if table.get("column", next(iter(columns))) not in columns:
        raise DataError(f"{where}: there is no column '{table['column']}': {closest(table['column'], columns)}")
    values = columns[table["column"]] if "column" in table else evaluate(table["formula"], columns, where)
    # Scale and offset apply in the stated unit, which is converted afterwards.
    values = float(table.get("scale", 1.0)) * values + float(table.get("offset", 0.0))
    try:
        return values * to_si(1.0, table["unit"], unit_of(name), where) if table.get("unit") else values
    except ParameterError as error:
        raise DataError(str(error)) from error
