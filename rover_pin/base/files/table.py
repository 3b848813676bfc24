"""A reader of tables in text files of any layout or in Parquet files, and a writer of tables as plain CSV.

A text file may have any delimiter, a decimal comma, a byte-order mark, lines before its header, a line of units, cells
such as `80 N`, and marks for missing numbers. `read_table` reads numbers and texts, and `read_columns` numbers only.
"""

from __future__ import annotations

import contextlib
import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rover_pin.base.encode import csv_cell
from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.bounded import MAX_TABLE_BYTES, content
from rover_pin.base.files.parquet import parquet_table
from rover_pin.base.files.table_layout import (
    COMMENTS,
    DELIMITERS,
    MISSING,
    NUMBERS,
    SAMPLED_LINES,
    Layout,
    cells,
    fit_row,
    layout_of,
)
from rover_pin.base.units import name_and_unit, readings

if TYPE_CHECKING:
    import pandas as pd

ENCODINGS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
"""Byte-order mark at the beginning of a text file, and the text encoding that the mark announces."""
SPREADSHEETS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0", b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"(\xb5/\xfd")
"""First bytes of files that are not text: .xlsx and .ods (archives), .xls, gzip, bzip2, xz and zstd. Such a file is
refused as a table."""


MAX_COLUMNS = 10_000
"""Maximum number of columns of a table in a text file. A wider table is refused; the widest recordings have some
hundreds."""
MAX_CELLS = 10_000_000
"""Maximum number of cells of a table in a text file. A larger table is refused. Reading this number of cells takes
about 1 GiB of memory and one minute."""


class Table(NamedTuple):
    """A table that was read from a file: a dict from column name to the values of the column.

    A column holds numbers, with NaN for a missing cell, or texts if at least one of its cells is text.
    """

    path: Path
    columns: dict[str, np.ndarray]
    places: tuple[str, ...]
    """position of each row in the file, as 'line 7' of a text file or 'row 6' of a Parquet file"""
    notes: tuple[str, ...] = ()
    """remarks about how the file was read, such as the recognised delimiter"""
    faults: tuple[str, ...] = ()
    """sentences on omitted rows, which have too many or too few cells, and on repeated column names"""

    def numbers(self, name: str) -> np.ndarray:
        """Return the values of a column as an array of floats (rows,), with NaN for a missing cell.

        Raises DataError: a cell is not a number; the message names the line and the column.
        """
        values = self.columns[name]
        # A column of numbers needs no conversion of single cells.
        if values.dtype.kind in "fiub":
            return values.astype(float)
        numbers = []
        for row, cell in enumerate(values):
            text = "" if cell is None else str(cell).strip()
            try:
                numbers.append(np.nan if text.lower() in MISSING else float(cell))
            except (TypeError, ValueError):
                # A decimal comma in a file with decimal points is the most frequent cause, so the message names it.
                has_comma = NUMBERS[","].fullmatch(text) and not NUMBERS["."].fullmatch(text)
                comma = f" Write {text.replace(',', '.')}: the other cells have a decimal point." if has_comma else ""
                raise DataError(
                    f"{self.path}, {self.places[row]}: column '{name}' has {text!r}, which is not a number.{comma}"
                ) from None
        return np.array(numbers)

    def refuse_faults(self) -> None:
        """Check that the file has no fault: no row of a wrong length and no repeated column name.

        Raises DataError: a row has too many or too few cells, or two columns have equal names.
        """
        if self.faults:
            raise DataError(f"{self.path}, {self.faults[0]}")

    def frame(self) -> pd.DataFrame:
        """Return the columns as a pandas DataFrame; the index counts the rows from 0."""
        import pandas as pd

        return pd.DataFrame(self.columns, index=pd.RangeIndex(len(self.places)))


def measured_points(path: Path, required: Sequence[str] = (), texts: Sequence[str] = ()) -> pd.DataFrame:
    """Return a table of measured points from a file as a DataFrame with at least one row.

    `required` lists columns that the table must have. The required columns that are also listed in `texts` may hold
    names; all other required columns must hold numbers.

    Raises DataError: the file cannot be read as a table, a column is missing, or a cell holds text instead of a number.
    """
    table = read_table(path)
    table.refuse_faults()
    for name in required:
        if name not in table.columns:
            # Columns of standard deviations are no suggestion for a missing column of values.
            meant = [column for column in table.columns if "_sd_" not in column]
            hint = closest(name, meant).replace("? ", f"? then call it '{name}' there. ", 1)
            raise DataError(f"{path} has no column '{name}': {hint}")
        if name not in texts:
            table.columns[name] = table.numbers(name)
    return table.frame()


def read_table(path: Path) -> Table:
    """Return the table in a Parquet file (.parquet, .pq) or in a text file of any layout (any other suffix).

    Rows with too many or too few cells are omitted, and `faults` of the returned table lists them.

    Raises DataError: the file is missing, is a spreadsheet or an archive, cannot be read, or has no rows.
    """
    # Parquet files are read by pyarrow, which opens the file itself; all other files are read as bytes here.
    try:
        raw = content(path, MAX_TABLE_BYTES) if path.suffix not in (".parquet", ".pq") else b""
    except OSError as error:
        raise DataError(f"{path}: the file cannot be read: {error.strerror or error}.") from error
    if raw.startswith(SPREADSHEETS):
        raise DataError(
            f"{path}: this is a spreadsheet or an archive: save the sheet as CSV, or unpack the archive, and give the "
            "new file."
        )
    if raw or path.suffix not in (".parquet", ".pq"):
        table = _text_table(path, raw)
    else:
        packed = parquet_table(path)
        try:
            frame = packed.replace_schema_metadata(None).to_pandas()
        except Exception as error:  # pyarrow raises errors of many kinds for values that no column of pandas can have
            raise DataError(f"{path}: the file cannot be read as a table: {error}.") from error
        columns = {str(name): frame[name].to_numpy() for name in frame}
        table = Table(path, columns, tuple(f"row {row}" for row in range(packed.num_rows)))
    if not table.places:
        # If every row was omitted, the error names the first omitted row instead of calling the file empty.
        table.refuse_faults()
        raise DataError(
            f"{path}: the file has no rows of data: write one line of column names, then one line for each row."
        )
    return table


def _text_table(path: Path, raw: bytes) -> Table:
    """Return the table in `raw`, the bytes of a text file. Delimiter, decimal mark and header are recognised from its
    lines.
    """
    text, encoding = decode(raw)
    lines = text.splitlines()
    # Both limits are checked before any line is split, because a cell of two bytes takes about 100 bytes in Python.
    widest = max((line.count(delimiter) for line in lines[:SAMPLED_LINES] for delimiter in DELIMITERS), default=0)
    if widest >= MAX_COLUMNS:
        raise DataError(
            f"{path}: a line has {widest + 1} cells, but a table may have at most {MAX_COLUMNS} columns: transpose the "
            "table, or give a matrix of heights as .npy."
        )
    try:
        layout = layout_of(lines)
        if (cell_count := text.count(layout.delimiter) + len(lines)) > MAX_CELLS:
            raise DataError(
                f"{path}: the table has {cell_count} cells, but a text file may have at most {MAX_CELLS}: save the "
                "table as Parquet, or leave out rows and columns that are not needed."
            )
        names, faults = _names(lines, layout)
        columns: list[list[str]] = [[] for _ in names]
        line_numbers: list[int] = []
        # Tables that were printed on pages repeat their header; these lines are not data.
        dropped, repeated = _repeated_headers(lines, layout)
        for index in _data_lines(lines, layout):
            if index in dropped:
                continue
            row = fit_row(cells(lines[index], layout.delimiter), layout.width)
            if len(row) == len(names) and any(row):
                line_numbers.append(index + 1)
                for column, cell in zip(columns, row, strict=True):
                    column.append(cell)
            elif any(row):
                # A row of another length is left out and reported; the caller decides whether that is acceptable.
                faults.append(
                    f"line {index + 1}: {len(row)} cells under {len(names)} column names; give each column one cell."
                )
    except csv.Error as error:
        raise DataError(f"{path}: the file cannot be read as a table: {error}.") from error
    converted: dict[str, np.ndarray] = {}
    for number, name in enumerate(names, 1):
        column, columns[number - 1] = columns[number - 1], []  # each column of texts is freed once it is converted
        # A column without a name and without any content comes from a delimiter at the end of each line.
        if line_numbers and (name or any(column)):
            key, values = _column(name or f"column {number}", tuple(column), layout.decimal)
            converted[key] = values
    notes = (
        layout.description,
        *([f"text in {encoding}"] if encoding not in ("utf-8", "utf-8-sig") else []),
        *repeated,
    )
    return Table(path, converted, tuple(f"line {number}" for number in line_numbers), notes, tuple(faults))


def _repeated_headers(lines: list[str], layout: Layout) -> tuple[set[int], list[str]]:
    """Return the indices of the lines that repeat the header of a table, and a note on each repetition.

    Tables that were printed on pages or joined from several sheets repeat their headers. A line of units below a
    repeated header, and a title (a line with a single filled cell) above it, count as part of the repetition.
    """
    dropped: set[int] = set()
    if layout.header < 0:
        return dropped, []

    def row_of(index: int, names: bool = False) -> list[str]:
        return fit_row(cells(lines[index], layout.delimiter), layout.width, names=names)

    header = row_of(layout.header, names=True)
    units = row_of(min(layout.header + 1, len(lines) - 1), names=True)
    # A line without the first name of the header is no copy of it. Splitting every line again would double the time.
    first, notes = header[0], list[str]()
    filled = [index for index in _data_lines(lines, layout) if lines[index].strip(f"{layout.delimiter} ")]
    for place, index in enumerate(filled):
        if first not in lines[index] or row_of(index) != header:
            continue
        dropped.add(index)
        # The line of units below the repeated header, and the title above it, are parts of the repetition.
        if layout.units and place + 1 < len(filled) and row_of(filled[place + 1]) == units:
            dropped.add(filled[place + 1])
        title = [cell for cell in row_of(filled[place - 1]) if cell] if place else []
        if len(title) == 1 and not NUMBERS[layout.decimal].fullmatch(title[0]):
            dropped.add(filled[place - 1])
            notes.append(f"line {index + 1} repeats the column names, after the title {title[0]!r}: both are left out")
        else:
            notes.append(f"line {index + 1} repeats the column names: it is left out")
    return dropped, notes


def decode(raw: bytes) -> tuple[str, str]:
    """Return the text in a file's bytes, and the name of its encoding.

    The byte-order mark decides. Without a mark, the encoding is UTF-16 if every second byte is zero, UTF-8 if the bytes
    are valid UTF-8, and cp1252 (Windows, western Europe) otherwise.
    """
    # A byte-order mark is the only certain statement about the encoding.
    for mark, encoding in ENCODINGS:
        if raw.startswith(mark):
            return raw.decode(encoding, errors="replace"), encoding
    zeros = [raw[first:400:2].count(0) for first in (0, 1)]
    if max(zeros) > 100 > 10 * min(zeros):  # every second byte of plain text in UTF-16, here without its mark
        encoding = "utf-16-le" if zeros[1] else "utf-16-be"
        return raw.decode(encoding, errors="replace"), encoding
    try:
        return raw.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace"), "cp1252"


def _data_lines(lines: list[str], layout: Layout) -> list[int]:
    """Return the indices of the lines below a table's header that are neither empty nor comments."""
    begin = layout.header + 1 + layout.units if layout.header >= 0 else 0
    return [
        index
        for index in range(begin, len(lines))
        if lines[index].strip() and not lines[index].lstrip().startswith(COMMENTS)
    ]


def _names(lines: list[str], layout: Layout) -> tuple[list[str], list[str]]:
    """Return the column names with their units, and a sentence on each name that occurs twice.

    A second column with an equal name is renamed to "name (2)", so that no column is lost. If the file has no header,
    the columns are called "column 1", "column 2" and so on.
    """
    if layout.header < 0:
        return [f"column {number}" for number in range(1, 1 + layout.width)], []
    names = fit_row(cells(lines[layout.header], layout.delimiter), layout.width, names=True)
    # The line below the names holds the units, so each unit is appended to its name.
    if layout.units:
        units = fit_row(cells(lines[layout.header + 1], layout.delimiter), layout.width, names=True)
        names = [_with_unit(name, unit.strip("[]() ")) for name, unit in zip(names, units, strict=False)]
    faults: list[str] = []
    for index, name in enumerate(names):
        if name and name in names[:index]:
            faults.append(f"line {layout.header + 1}: there are two columns '{name}'; rename one.")
            names[index] = next(
                unique_name for count in range(2, index + 3) if (unique_name := f"{name} ({count})") not in names
            )
    return names, faults


def _with_unit(name: str, unit: str) -> str:
    """Return a column's name followed by its unit in brackets, unless the unit is empty or already in the name."""
    name_unit = name_and_unit(name)[1]
    redundant = not name or unit in ("", "-", "1") or bool(name_unit and set(readings(name_unit)) & set(readings(unit)))
    return name if redundant else f"{name} [{unit}]"


def _column(name: str, column: tuple[str, ...], decimal: str) -> tuple[str, np.ndarray]:
    """Return the name and the values of a column: an array of numbers if every cell is a number, else an array of
    texts.

    `column` holds the cells as texts, and `decimal` is the decimal mark of the file. If all cells have one common unit,
    as in `80 N`, the unit is moved from the cells into the returned name, as in `load [N]`.
    """
    # First attempt: NumPy converts plain numbers fast. Cells with an underscore are left to the patterns below, since
    # Python would read 2024_04_23 as the number 20240423.
    for kind in () if "_" in "".join(column) else (np.int64, float):
        with contextlib.suppress(ValueError, OverflowError):
            return name, np.array(column, dtype=kind)
    # Second attempt: numbers with a unit in the cell, with a decimal comma, or with marks for missing numbers.
    filled = [cell for cell in column if cell.lower() not in MISSING]
    split = [NUMBERS[decimal].fullmatch(cell) for cell in filled]
    units = {match[2] or "" for match in split if match}
    named = _with_unit(name, max(units, default=""))
    # One unit in all cells, or one unit that the name states already and some cells leave out.
    if all(split) and (len(units) < 2 or (len(units) == 2 and "" in units and named == name)):
        numbers = iter(match[1] for match in split if match)
        column, name = tuple("" if cell.lower() in MISSING else next(numbers) for cell in column), named
    try:
        plain = ["nan" if cell.lower() in MISSING else cell.replace(decimal, ".").replace("_", " ") for cell in column]
        return name, np.array(plain, dtype=float)
    except ValueError:
        return name, np.array(["" if cell.lower() in MISSING else cell for cell in column], dtype=object)


class Columns(NamedTuple):
    """The columns of a table of numbers, which are found by their names. An empty cell is NaN."""

    path: Path
    values: dict[str, np.ndarray]
    places: tuple[str, ...]
    """position of each row in the file, as 'line 7' of a text file or 'row 6' of a Parquet file"""

    def need(self, *names: str) -> tuple[np.ndarray, ...]:
        """Return the values (rows,) of several columns, one array for each name.

        Raises DataError: a column is missing.
        """
        for name in names:
            if name not in self.values:
                raise DataError(f"{self.path}: there is no column '{name}': {closest(name, self.values)}")
        return tuple(self.values[name] for name in names)

    def refuse_gaps(self, *names: str) -> None:
        """Check that every row has a finite number in each of these columns.

        Raises DataError: a number is missing or not finite; the message names its line and column.
        """
        for name in names:
            bad = np.flatnonzero(~np.isfinite(self.values[name]))
            if bad.size:
                value = self.values[name][bad[0]]
                raise DataError(
                    f"{self.path}, {self.places[bad[0]]}: column '{name}' is {value:g}; "
                    "every row needs a finite number there."
                )

    def refuse_steps_back(self, name: str) -> None:
        """Check that the values of a column increase from row to row, as times and distances must.

        Raises DataError: a value is smaller than or equal to the value in the row before.
        """
        back = np.flatnonzero(np.diff(self.values[name]) <= 0.0)
        if back.size:
            before, value = self.values[name][back[0] : back[0] + 2]
            raise DataError(
                f"{self.path}, {self.places[back[0] + 1]}: column '{name}' must increase, but {value:.12g} follows "
                f"{before:.12g}: sort the rows by this column and remove repeated rows."
            )


def read_columns(path: str | Path) -> Columns:
    """Return the columns of a table of numbers, from a text file of any layout or from Parquet.

    Raises DataError: the file cannot be read as a table, a row has another number of cells than the header, two columns
    have equal names, or a cell holds text instead of a number.
    """
    table = read_table(Path(path))
    table.refuse_faults()
    return Columns(table.path, {name: table.numbers(name) for name in table.columns}, table.places)


def columns_text(values: dict[str, np.ndarray]) -> str:
    """Return the text of a CSV file with one column for each of the arrays (rows,). All arrays have equal lengths.

    `values` maps column names to arrays. Each number is written with all digits that its exact value needs. A name with
    a comma or a quotation mark, such as "x, m", is quoted.

    Examples
    --------
    >>> print(columns_text({"t_s": np.array([0.0, 0.1]), "x, m": np.array([0.0, 0.25])}), end="")
    t_s,"x, m"
    0.0,0.0
    0.1,0.25
    """
    names = map(csv_cell, values)
    rows = zip(*(np.asarray(column, dtype=float).tolist() for column in values.values()), strict=True)
    return "\n".join([",".join(names), *(",".join(map(repr, row)) for row in rows)]) + "\n"
