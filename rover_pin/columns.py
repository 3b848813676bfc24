"""Tables of numbers in files: CSV or Parquet in, CSV out, with the place of whatever is wrong."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rover_pin.bounded import MOST_TABLE, content, text
from rover_pin.errors import DataError, closest
from rover_pin.parquet import unpacked


class Columns(NamedTuple):
    """The columns of a file; an empty cell is NaN."""

    path: Path
    values: dict[str, np.ndarray]
    places: tuple[str, ...]
    "where each row stands, as 'line 7' of a text file or 'row 6'"

    def need(self, *names: str) -> tuple[np.ndarray, ...]:
        """Return these columns; the first that is missing is an error."""
        for name in names:
            if name not in self.values:
                raise DataError(f"{self.path}: there is no column '{name}': {closest(name, self.values)}")
        return tuple(self.values[name] for name in names)

    def refuse_gaps(self, *names: str) -> None:
        """Refuse a number that is missing or not finite in these columns."""
        for name in names:
            bad = np.flatnonzero(~np.isfinite(self.values[name]))
            if bad.size:
                value = self.values[name][bad[0]]
                raise DataError(
                    f"{self.path}, {self.places[bad[0]]}: column '{name}' is {value:g}; "
                    "every row needs a finite number there."
                )

    def refuse_steps_back(self, name: str) -> None:
        """Refuse a column that does not increase from row to row."""
        back = np.flatnonzero(np.diff(self.values[name]) <= 0.0)
        if back.size:
            before, value = self.values[name][back[0] : back[0] + 2]
            raise DataError(
                f"{self.path}, {self.places[back[0] + 1]}: column '{name}' must increase, but {value:.12g} follows "
                f"{before:.12g}: sort the rows and drop repeated ones."
            )


def read_columns(path: str | Path) -> Columns:
    """Return the columns of a Parquet file (`.parquet`), or of a comma-separated one with a line of names.

    Lines that are empty or start with '#' are skipped.

    Raises
    ------
    DataError
        The file is missing or unreadable, has no rows, a row of another length, or text where a number belongs.
    """
    path = Path(path)
    try:
        return _parquet(path) if path.suffix == ".parquet" else _text(path, text(path, MOST_TABLE, "utf-8-sig"))
    except UnicodeDecodeError as error:
        raise DataError(
            f"{path}: the file cannot be read as UTF-8 text: save it as CSV with commas, or as Parquet."
        ) from error
    except OSError as error:
        raise DataError(f"{path}: the file cannot be read: {error.strerror or error}.") from error


def _text(path: Path, whole: str) -> Columns:
    lines = [(at, line) for at, line in enumerate(whole.splitlines(), 1) if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        raise DataError(f"{path}: the file has no rows: give one line of column names, then one line a row.")
    for mark, word in ((";", "semicolons"), ("\t", "tabs")):
        if mark in lines[0][1] and "," not in lines[0][1]:
            raise DataError(f"{path}: the columns stand between {word}: save the file with commas, and decimal points.")
    names = [name.strip().strip('"') for name in lines[0][1].split(",")]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise DataError(f"{path}, line {lines[0][0]}: column '{twice}' stands there twice; rename one.")
    rows = [_row(path, at, line.split(","), names) for at, line in lines[1:]]
    places = tuple(f"line {at}" for at, _ in lines[1:])
    return Columns(path, dict(zip(names, np.array(rows).T.copy(), strict=True)), places)


def _row(path: Path, at: int, cells: list[str], names: list[str]) -> list[float]:
    if len(cells) != len(names):
        raise DataError(f"{path}, line {at}: {len(cells)} cells under {len(names)} column names; give one a column.")
    try:
        return [float(cell) if cell and not cell.isspace() else np.nan for cell in cells]
    except ValueError:
        return [_number(path, f"line {at}", name, cell) for name, cell in zip(names, cells, strict=True)]


def _number(path: Path, place: str, name: str, cell: Any) -> float:
    try:
        return float(cell) if cell is not None and str(cell).strip() else np.nan
    except (TypeError, ValueError):
        raise DataError(f"{path}, {place}: column '{name}' has {str(cell).strip()!r}, which is not a number.") from None


def _parquet(path: Path) -> Columns:
    import pyarrow

    table = parquet_table(path)
    places = tuple(f"row {row}" for row in range(table.num_rows))
    if not places:
        raise DataError(f"{path}: the file has no rows.")
    values = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if pyarrow.types.is_floating(column.type):
            values[name] = column.to_numpy().astype(float)
        else:
            cells = zip(places, column.to_pylist(), strict=True)
            values[name] = np.array([_number(path, place, name, cell) for place, cell in cells])
    return Columns(path, values, places)


def parquet_table(path: Path) -> Any:
    """Return a Parquet file as a pyarrow Table whose names differ.

    Raises
    ------
    DataError
        The file is missing, unpacks to more than `parquet` allows, or pyarrow cannot read it.
    """
    try:
        table = unpacked(content(path))
        table.validate(full=True)
    except Exception as error:  # whatever pyarrow raises for bytes that are no Parquet, an OSError without a reason too
        if isinstance(error, OSError) and error.strerror:
            raise DataError(f"{path}: the file cannot be read: {error.strerror}.") from error
        raise DataError(f"{path}: the file is not Parquet: {error}".rstrip(". \n") + ".") from error
    for name in table.column_names:
        if table.column_names.count(name) > 1:
            raise DataError(f"{path}: column '{name}' stands there twice; rename one.")
    return table


def columns_text(values: dict[str, np.ndarray]) -> str:
    """Return columns of one length as comma-separated text, each number with the digits that bring it back exactly."""
    rows = zip(*(np.asarray(column, dtype=float).tolist() for column in values.values()), strict=True)
    return "\n".join([",".join(values), *(",".join(map(repr, row)) for row in rows)]) + "\n"


def replace_file(path: str | Path, content: bytes | str) -> Path:
    """Write a whole file or none of it, making its folder; a reader never sees half.

    Raises
    ------
    DataError
        It cannot be written there.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)
        os.replace(temporary, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise DataError(f"{path}: the file cannot be written: {error.strerror}.") from error
    return path
