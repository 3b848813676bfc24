"""One run in a file: read from CSV or Parquet with its checks, written to Parquet with its attributes."""

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.columns import Columns, read_columns
from rover_pin.base.files.parquet import parquet_table
from rover_pin.base.files.toml_file import table_in
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.quantity import to_si
from rover_pin.simulation.trace.channels import unit_of, wheel_of
from rover_pin.simulation.trace.trace import Trace

METADATA = b"rover_pin"


def read_run(path: str | Path, wheels: Sequence[str] = (), attrs: Mapping[str, Any] | None = None) -> Trace:
    """Return the run in a CSV or Parquet file; `attrs` are added to those that the file holds.

    Raises DataError: a file that cannot be read, or what `run_from` refuses.
    """
    return run_from(read_columns(path), wheels, attrs)


def run_from(
    table: Columns,
    wheels: Sequence[str] = (),
    attrs: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
) -> Trace:
    """Return the run of a table in SI; `units` are those of its columns where their names tell others.

    Raises DataError: no `t_s`, text where a number belongs, a time that is missing or does not increase, a duty outside
    [-1, 1], a unit that is of another kind than the channel, or channels of a wheel that is not among `wheels`, where
    any are given.
    """
    table.need("t_s")
    table.refuse_gaps("t_s")
    table.refuse_steps_back("t_s")
    _refuse_percent(table)
    _refuse_strange_wheels(table, wheels)
    for name in units or {}:
        if name not in table.values:
            raise DataError(
                f"{table.path}: units name a column '{name}' that is not there: {closest(name, table.values)}"
            )
    metadata = _metadata(table.path) if table.path.suffix == ".parquet" else {}
    declared_units = {**metadata.get("units", {}), **(units or {})}
    channels = {name: _si(table, name, declared_units.get(name, unit_of(name))) for name in table.values}
    units = {name: unit_of(name) or declared_units.get(name, "") for name in channels}
    return Trace(channels, units, {**metadata.get("attrs", {}), **(attrs or {})})


def _si(table: Columns, name: str, unit: Any) -> np.ndarray:
    """Return a column in the unit that its name tells, if it does."""
    try:
        factor = to_si(1.0, unit, unit_of(name) or unit, f"{table.path}: column '{name}'")
    except ParameterError as error:
        raise DataError(str(error)) from error
    return factor * table.values[name]


def write_parquet(path: str | Path, trace: Trace) -> Path:
    """Write a trace to one Parquet file that `read_run` reads; return its path."""
    import pyarrow
    import pyarrow.parquet

    try:
        metadata = json.dumps({"units": trace.units, "attrs": trace.attrs}, default=_plain)
    except TypeError as error:
        raise DataError(f"{path}: an attribute of the trace is not a plain value: {error}.") from error
    table = pyarrow.table(trace.channels).replace_schema_metadata({METADATA: metadata.encode()})
    content = io.BytesIO()
    pyarrow.parquet.write_table(table, content)
    return replace_file(path, content.getvalue())


def _plain(value: Any) -> Any:
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{value!r}")


def _metadata(path: Path) -> dict[str, Any]:
    raw = (parquet_table(path).schema.metadata or {}).get(METADATA)
    try:
        metadata = json.loads(raw) if raw else {}
    except (ValueError, RecursionError) as error:
        raise DataError(
            f"{path}: what the file says of its columns is not JSON: write it with `write_parquet`."
        ) from error
    if not isinstance(metadata, dict):
        raise DataError(f"{path}: what the file says of its columns is {metadata!r}, not a table of units and attrs.")
    return {name: table_in(metadata, name, path) for name in ("units", "attrs")}


def _refuse_percent(table: Columns) -> None:
    for name, values in table.values.items():
        wrong = np.flatnonzero(np.abs(values) > 1.0) if name.startswith("duty_") else np.zeros(0, dtype=int)
        if wrong.size:
            raise DataError(
                f"{table.path}, {table.places[wrong[0]]}: {name} = {values[wrong[0]]:g} is outside [-1, 1]: "
                "give the duty as a signed share, not in percent."
            )


def _refuse_strange_wheels(table: Columns, wheels: Sequence[str]) -> None:
    for name in table.values:
        wheel = wheel_of(name)
        if wheels and wheel is not None and wheel not in wheels:
            raise DataError(
                f"{table.path}: column '{name}' is of a wheel '{wheel}' that is not declared: {closest(wheel, wheels)} "
                "Rename the column, or name all wheels as wheels = [...] in the log."
            )
