"""The `[columns]` of a drive log whose runs are tables: renames, units and formulas, so that files stay as they are.

In `drive.toml`, which column comes of which columns of the file::

    [columns]
    t_s = { column = "Zeit", unit = "ms" }
    body_x = "Position X"                                # a column's name, or a formula
    wheel_rate_fl = { formula = "v_left / 0.165" }
    current_fl_A = { column = "raw 1", scale = 0.01, offset = -2.5 }   # scale * raw + offset
    body_yaw = { formula = "yaw(qx, qy, qz, qw)" }
    body_x = { formula = "east(lat, lon)" }

`rover_pin.base.formula` says what a formula may hold; it may name what an earlier line made. Columns that
already have a name of a drive log need no line.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.columns import Columns
from rover_pin.base.formula import evaluate
from rover_pin.base.quantity import to_si
from rover_pin.simulation.trace.channels import is_column, unit_of

KEYS = ("column", "formula", "unit", "scale", "offset")


def map_columns(table: Columns, entries: Mapping[str, Any], where: str, wheels: Sequence[str]) -> Columns:
    """Return the columns of a drive log that a table holds: those with a log's name, and those that are mapped.

    Raises DataError: an entry that is neither a column nor a formula, an unknown column, key or unit.
    """
    direct = {name: values for name, values in table.values.items() if is_column(name, wheels)}
    derived: dict[str, np.ndarray] = {}
    for name, entry in entries.items():
        place = f"{where}: [columns] {name}, {table.path.name}"
        derived[name] = mapped_column(name, entry, {**table.values, **derived}, place)
    return Columns(table.path, direct | derived, table.places)


def mapped_column(name: str, entry: Any, columns: Mapping[str, np.ndarray], where: str) -> np.ndarray:
    """Return what an entry of [columns] makes of columns, in the SI unit that the channel's name tells.

    Raises DataError: as of `map_columns`.
    """
    table = {"column" if entry in columns else "formula": entry} if isinstance(entry, str) else entry
    _refuse_strange(table, where)
    if table.get("column", next(iter(columns))) not in columns:
        raise DataError(f"{where}: there is no column '{table['column']}': {closest(table['column'], columns)}")
    values = columns[table["column"]] if "column" in table else evaluate(table["formula"], columns, where)
    values = float(table.get("scale", 1.0)) * values + float(table.get("offset", 0.0))
    try:
        return values * to_si(1.0, table["unit"], unit_of(name), where) if table.get("unit") else values
    except ParameterError as error:
        raise DataError(str(error)) from error


def _refuse_strange(entry: Any, where: str) -> None:
    if not isinstance(entry, Mapping) or len({"column", "formula"} & entry.keys()) != 1:
        raise DataError(f"{where} = {entry!r}: give a column's name, {{ column = '...' }} or {{ formula = '...' }}.")
    for key, value in entry.items():
        if key not in KEYS:
            raise DataError(f"{where} has no key '{key}': {closest(key, KEYS)}")
        kind: tuple[type, ...] = (int, float) if key in ("scale", "offset") else (str,)
        if not isinstance(value, kind) or isinstance(value, bool):
            raise DataError(f"{where} has {key} = {value!r}: give {'a number' if float in kind else 'text'}.")
