"""Tables in files as programs write them: text of any layout, or Parquet; the one reader of every table.

Text may have any delimiter, a decimal comma, a byte-order mark, lines before its header, a row of units, cells as
`80 N`, and marks for what is missing.
"""

from __future__ import annotations

import contextlib
import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.bounded import MOST_TABLE, content
from rover_pin.base.files.parquet import parquet_table
from rover_pin.base.files.table_layout import COMMENTS, MISSING, NUMBERS, Layout, cells, fit_row, layout_of
from rover_pin.base.units import name_and_unit, readings

if TYPE_CHECKING:
    import pandas as pd

ENCODINGS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
"""Byte-order marks."""
SPREADSHEETS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0", b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"(\xb5/\xfd")
"""How .xlsx and .ods, which are archives, .xls, and what gzip, bzip2, xz and zstd pack begin."""


class Table(NamedTuple):
    """The columns of a file as they stand there: numbers, NaN where a cell is missing, or what else the cells hold."""

    path: Path
    columns: dict[str, np.ndarray]
    places: tuple[str, ...]
    "where each row stands, as 'line 7' of a text file or 'row 6'"
    notes: tuple[str, ...] = ()
    "how the file was read"
    faults: tuple[str, ...] = ()
    "rows left out since they have too many or too few cells, and names that stood there twice"

    def numbers(self, name: str) -> np.ndarray:
        """Return a column of numbers; what else it holds is a `DataError` with the place."""
        values = self.columns[name]
        if values.dtype.kind in "fiub":
            return values.astype(float)
        return np.array([self._number(name, row, cell) for row, cell in enumerate(values)])

    def _number(self, name: str, row: int, cell: Any) -> float:
        try:
            return np.nan if cell is None or str(cell).strip().lower() in MISSING else float(cell)
        except (TypeError, ValueError):
            raise DataError(
                f"{self.path}, {self.places[row]}: column '{name}' has {str(cell).strip()!r}, which is not a number."
            ) from None

    def refuse_faults(self) -> None:
        """Refuse a file of which something would be left out."""
        if self.faults:
            raise DataError(f"{self.path}, {self.faults[0]}")

    def frame(self) -> pd.DataFrame:
        """Return the columns for pandas; a row's label is its place."""
        import pandas as pd

        return pd.DataFrame(self.columns, index=pd.RangeIndex(len(self.places)))


def measured_points(path: Path, required: Sequence[str] = (), texts: Sequence[str] = ()) -> pd.DataFrame:
    """Return a table of measured points with at least one row and the `required` columns; of those, `texts` hold names.

    Raises DataError: what `read_table` refuses, a missing column, or text where a number belongs.
    """
    table = read_table(path)
    table.refuse_faults()
    for name in required:
        if name not in table.columns:
            meant = [column for column in table.columns if "_sd_" not in column]
            hint = closest(name, meant).replace("? ", f"? then call it '{name}' there. ", 1)
            raise DataError(f"{path} has no column '{name}': {hint}")
        if name not in texts:
            table.columns[name] = table.numbers(name)
    return table.frame()


def read_table(path: Path) -> Table:
    """Return the table of a Parquet file or of a text file of any layout.

    Raises DataError: the file is missing, a spreadsheet, cannot be read, or has no rows.
    """
    try:
        raw = content(path, MOST_TABLE) if path.suffix not in (".parquet", ".pq") else b""
    except OSError as error:
        raise DataError(f"{path}: the file cannot be read: {error.strerror or error}.") from error
    if raw.startswith(SPREADSHEETS):
        raise DataError(
            f"{path}: this is a spreadsheet or an archive: save the sheet as CSV, or unpack it, and give that file."
        )
    table = _text(path, raw) if raw or path.suffix not in (".parquet", ".pq") else _parquet(path)
    if not table.places:
        table.refuse_faults()
        raise DataError(f"{path}: the file has no rows: give one line of column names, then one line a row.")
    return table


def _parquet(path: Path) -> Table:
    table = parquet_table(path)
    try:
        frame = table.replace_schema_metadata(None).to_pandas()
    except Exception as error:  # whatever pyarrow raises for values that no column of pandas can have
        raise DataError(f"{path}: the file cannot be read as a table: {error}.") from error
    columns = {str(name): frame[name].to_numpy() for name in frame}
    return Table(path, columns, tuple(f"row {row}" for row in range(table.num_rows)))


def _text(path: Path, raw: bytes) -> Table:
    text, encoding = decode(raw)
    lines = text.splitlines()
    try:
        layout = layout_of(lines)
        rows = [(at, fit_row(cells(lines[at], layout.delimiter), layout.width)) for at in _data(lines, layout)]
        names, faults = _names(lines, layout)
    except csv.Error as error:
        raise DataError(f"{path}: the file cannot be read as a table: {error}.") from error
    rows = [(at, row) for at, row in rows if any(row)]
    faults += [
        f"line {at + 1}: {len(row)} cells under {len(names)} column names; give one a column."
        for at, row in rows
        if len(row) != len(names)
    ]
    complete = [(at, row) for at, row in rows if len(row) == len(names)]
    filled = zip(names, zip(*(row for _, row in complete), strict=True), strict=False)
    columns = dict(
        _column(name or f"column {at}", column, layout.decimal)
        for at, (name, column) in enumerate(filled, 1)
        if name or any(column)
    )
    notes = (layout.description, *([f"text in {encoding}"] if encoding not in ("utf-8", "utf-8-sig") else []))
    return Table(path, columns, tuple(f"line {at + 1}" for at, _ in complete), notes, tuple(faults))


def decode(raw: bytes) -> tuple[str, str]:
    """Return a file's text, and its encoding."""
    for mark, encoding in ENCODINGS:
        if raw.startswith(mark):
            return raw.decode(encoding, errors="replace"), encoding
    try:
        return raw.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace"), "cp1252"


def _data(lines: list[str], layout: Layout) -> list[int]:
    begin = layout.header + 1 + layout.units if layout.header >= 0 else 0
    return [at for at in range(begin, len(lines)) if lines[at].strip() and not lines[at].lstrip().startswith(COMMENTS)]


def _names(lines: list[str], layout: Layout) -> tuple[list[str], list[str]]:
    """Return the names of the columns, all different, with their units; and which stood there twice."""
    if layout.header < 0:
        return [f"column {at}" for at in range(1, 1 + layout.width)], []
    names = fit_row(cells(lines[layout.header], layout.delimiter), layout.width, names=True)
    if layout.units:
        units = fit_row(cells(lines[layout.header + 1], layout.delimiter), layout.width, names=True)
        names = [_with_unit(name, unit.strip("[]() ")) for name, unit in zip(names, units, strict=False)]
    faults: list[str] = []
    for at, name in enumerate(names):
        if name and name in names[:at]:
            faults.append(f"line {layout.header + 1}: column '{name}' stands there twice; rename one.")
            names[at] = next(
                unique_name for count in range(2, at + 3) if (unique_name := f"{name} ({count})") not in names
            )
    return names, faults


def _with_unit(name: str, unit: str) -> str:
    """Return a column's name with its unit in brackets, unless it has none or the name tells the same."""
    name_unit = name_and_unit(name)[1]
    redundant = not name or unit in ("", "-", "1") or bool(name_unit and set(readings(name_unit)) & set(readings(unit)))
    return name if redundant else f"{name} [{unit}]"


def _column(name: str, column: tuple[str, ...], decimal: str) -> tuple[str, np.ndarray]:
    """Return a column's name and its numbers; the unit that all its cells tell moves into the name."""
    for kind in () if "_" in "".join(column) else (np.int64, float):  # Python reads 2024_04_23 as a number
        with contextlib.suppress(ValueError, OverflowError):
            return name, np.array(column, dtype=kind)
    full = [cell for cell in column if cell.lower() not in MISSING]
    split = [NUMBERS[decimal].fullmatch(cell) for cell in full]
    units = {match[2] or "" for match in split if match}
    named = _with_unit(name, max(units, default=""))
    if all(split) and (len(units) < 2 or (len(units) == 2 and "" in units and named == name)):
        numbers = iter(match[1] for match in split if match)
        column, name = tuple("" if cell.lower() in MISSING else next(numbers) for cell in column), named
    try:
        plain = ["nan" if cell.lower() in MISSING else cell.replace(decimal, ".").replace("_", " ") for cell in column]
        return name, np.array(plain, dtype=float)
    except ValueError:
        return name, np.array(["" if cell.lower() in MISSING else cell for cell in column], dtype=object)
