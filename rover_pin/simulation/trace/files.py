"""Files with one run of a rover: read from CSV or Parquet with checks, and written to Parquet with units and
attributes.
"""

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.parquet import need_pyarrow, parquet_table
from rover_pin.base.files.table import Columns, read_columns
from rover_pin.base.files.toml_file import table_in
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.quantity import to_si
from rover_pin.simulation.trace.channels import unit_of, wheel_of
from rover_pin.simulation.trace.trace import Trace

METADATA = b"rover_pin"
"""Key of the units and attributes of a trace in the metadata of a Parquet file."""
MAX_READING = 1e36
"""Largest absolute value that a channel may have, in its unit; a larger one is refused as an error in the file. The
largest usual value, a time in nanoseconds, is near 2e18."""


def read_run(path: str | Path, wheels: Sequence[str] = (), attrs: Mapping[str, Any] | None = None) -> Trace:
    """Return the run in a CSV or Parquet file as a trace, in SI units.

    Parameters
    ----------
    path : str or Path
        The file.
    wheels : sequence of str
        Names of the wheels. A channel of a wheel that is not among them raises an error. If empty, all names are
        allowed.
    attrs : mapping, optional
        Attributes to add to those in the file.

    Raises
    ------
    DataError
        The file cannot be read, or `run_from` refuses its table.
    """
    return run_from(read_columns(path), wheels, attrs)


def run_from(
    table: Columns,
    wheels: Sequence[str] = (),
    attrs: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
) -> Trace:
    """Return the run in a table of channels as a trace, in SI units, after a check of the columns.

    Parameters
    ----------
    table : Columns
        The table that was read from a file.
    wheels, attrs
        See `read_run`.
    units : mapping of name -> str, optional
        Units of the columns that differ from the channel's usual unit; these columns are converted.

    Raises
    ------
    DataError
        There is no `t_s`; a time is missing or does not increase; a cell holds text instead of a number, or a number
        beyond MAX_READING; a duty lies outside [-1, 1]; a unit does not fit its channel; or a channel belongs to a
        wheel that is not among `wheels`.
    """
    # The times are checked first: the other checks need complete and increasing times.
    table.need("t_s")
    table.refuse_gaps("t_s")
    table.refuse_steps_back("t_s")
    for name, values in table.values.items():
        # No sensor gives so large a number, and its products leave the range of floats.
        huge = np.flatnonzero(np.isfinite(values) & (np.abs(values) > MAX_READING))
        if huge.size:
            raise DataError(
                f"{table.path}, {table.places[huge[0]]}: {name} = {values[huge[0]]:g} is too large: at most "
                f"{MAX_READING:g} is allowed; leave the cell empty if nothing was measured."
            )
        # A duty beyond 1 is probably in percent.
        wrong = np.flatnonzero(np.abs(values) > 1.0) if name.startswith("duty_") else np.zeros(0, dtype=int)
        if wrong.size:
            raise DataError(
                f"{table.path}, {table.places[wrong[0]]}: {name} = {values[wrong[0]]:g} is outside [-1, 1]: "
                "give the duty as a signed share, not in percent."
            )
        wheel = wheel_of(name)
        if wheels and wheel is not None and wheel not in wheels:
            raise DataError(
                f"{table.path}: column '{name}' belongs to the wheel '{wheel}', which is not declared: "
                f"{closest(wheel, wheels)} Rename the column, or name all wheels as wheels = [...] in the log."
            )
    # A unit for a column that is missing is a misspelt name.
    for name in units or {}:
        if name not in table.values:
            raise DataError(
                f"{table.path}: a unit is given for the column '{name}', which the file does not have: "
                f"{closest(name, table.values)}"
            )
    # A Parquet file holds units and attributes of the trace in its metadata. Both are empty if another program wrote
    # the file, unless this program used the same key for other metadata.
    metadata: Any = {}
    if table.path.suffix == ".parquet":
        raw = (parquet_table(table.path).schema.metadata or {}).get(METADATA)
        try:
            metadata = json.loads(raw) if raw else {}
        except (ValueError, RecursionError) as error:
            raise DataError(
                f"{table.path}: the metadata of its columns is not JSON: write the file with `write_parquet`."
            ) from error
        if not isinstance(metadata, dict):
            raise DataError(
                f"{table.path}: the metadata of its columns is {metadata!r}, not a table of units and attrs: write the "
                "file with `write_parquet`."
            )
    stored_units, stored_attrs = (table_in(metadata, name, table.path) for name in ("units", "attrs"))
    # Units of the caller replace those in the file's metadata.
    declared_units = {**stored_units, **(units or {})}
    channels = {name: _si(table, name, declared_units.get(name, unit_of(name))) for name in table.values}
    units = {name: unit_of(name) or declared_units.get(name, "") for name in channels}
    return Trace(channels, units, {**stored_attrs, **(attrs or {})})


def _si(table: Columns, name: str, unit: Any) -> np.ndarray:
    """Return a column of a table, converted from `unit` to the SI unit of its channel. A column whose name is no known
    channel is not converted.
    """
    try:
        factor = to_si(1.0, unit, unit_of(name) or unit, f"{table.path}: column '{name}'")
    except ParameterError as error:
        raise DataError(str(error)) from error
    return factor * table.values[name]


def write_parquet(path: str | Path, trace: Trace) -> Path:
    """Write a trace to one Parquet file, which `read_run` reads, and return its path.

    Raises DataError: an attribute of the trace is not a plain value, or the file cannot be written.
    Raises MissingExtraError: pyarrow is not installed.
    """
    need_pyarrow(path)
    import pyarrow
    import pyarrow.parquet

    try:
        metadata = json.dumps({"units": trace.units, "attrs": trace.attrs}, default=_plain)
    except TypeError as error:
        raise DataError(f"{path}: an attribute of the trace is not a plain value: {error}.") from error
    table = pyarrow.table(trace.channels).replace_schema_metadata({METADATA: metadata.encode()})
    # Written to memory first, so that the file is replaced in one step.
    content = io.BytesIO()
    pyarrow.parquet.write_table(table, content)
    return replace_file(path, content.getvalue())


def _plain(value: Any) -> Any:
    """Return a NumPy value as a plain Python value, which JSON can store; raise TypeError for every other value."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{value!r}")
