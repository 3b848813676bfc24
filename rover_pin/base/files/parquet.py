"""A reader of Parquet files. A file is refused if its numbers and texts would take too much memory after unpacking."""

import errno
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError, MissingExtraError
from rover_pin.base.extras import install_command
from rover_pin.base.files.bounded import BYTES_PER_NUMBER, MAX_NUMBERS_BYTES, content, too_large

MAX_CELL = 1000
"""Maximum number of characters of a text cell. A table with a longer cell is refused. The text cells of a table of
measurements hold names, so a cell of 1000 characters is no measurement and only costs memory."""


def need_pyarrow(path: str | Path) -> None:
    """Check that pyarrow, which reads and writes Parquet, is installed; `path` is the file that needs it.

    Raises MissingExtraError: pyarrow is missing. The message has the command that installs it.
    """
    if find_spec("pyarrow") is None:
        raise MissingExtraError(f"{path}: Parquet needs the package pyarrow. Run `{install_command('parquet')}`.")


def parquet_table(path: Path) -> Any:
    """Return a Parquet file as a pyarrow Table. Its column names are unique.

    Raises DataError: the file is missing, unpacks to more than MAX_NUMBERS_BYTES, cannot be read by pyarrow, or has two
    columns with equal names. Raises MissingExtraError: pyarrow is not installed.
    """
    need_pyarrow(path)
    try:
        table = unpack_table(content(path, 2 * MAX_NUMBERS_BYTES))
        table.validate(full=True)
    except Exception as error:
        # For bytes that are not Parquet, pyarrow raises errors of many kinds, among them an OSError without a reason.
        if isinstance(error, OSError) and error.strerror:
            raise DataError(f"{path}: the file cannot be read: {error.strerror}.") from error
        raise DataError(f"{path}: the file is not Parquet: {error}".rstrip(". \n") + ".") from error
    for name in table.column_names:
        if table.column_names.count(name) > 1:
            raise DataError(f"{path}: there are two columns '{name}'; rename one.")
    return table


def unpack_table(packed: bytes, max_bytes: int = MAX_NUMBERS_BYTES) -> Any:
    """Return the pyarrow Table that the bytes of a Parquet file hold.

    Columns whose cells are bytes become columns of text, if all cells are valid UTF-8.

    Raises OSError: the cells would take more than `max_bytes`, a text cell has more than MAX_CELL characters, or a
    column holds lists, records, or bytes that are not text.
    Raises pyarrow.ArrowException: the bytes are not Parquet.
    """
    import pyarrow
    import pyarrow.compute
    import pyarrow.parquet
    from pyarrow import types

    # The types of the columns are checked first, because they are known before any cell is unpacked.
    reader = pyarrow.BufferReader(packed)
    schema = pyarrow.parquet.ParquetFile(reader).schema_arrow
    for field in schema:
        if types.is_nested(field.type):
            raise OSError(errno.EINVAL, f"column '{field.name}' holds lists or records, not numbers or names")
        if types.is_fixed_size_binary(field.type):
            raise OSError(errno.EINVAL, f"column '{field.name}' holds bytes, not numbers or names")
    # Texts are read as dictionaries, in which a repeated text takes no memory: a small file may repeat one text a
    # million times. They become plain texts only after their total length has been measured.
    texts = [field.name for field in schema if _is_text(field.type)]
    file = pyarrow.parquet.ParquetFile(reader, read_dictionary=texts)
    # A file of a few kB may state billions of equal cells, so the sizes are taken from its metadata before unpacking.
    metadata = file.metadata
    groups = [metadata.row_group(group) for group in range(metadata.num_row_groups)]
    chunks = (group.column(column) for group in groups for column in range(group.num_columns))
    cells = BYTES_PER_NUMBER * max(
        metadata.num_rows * len(schema), sum(group.num_rows * group.num_columns for group in groups)
    )
    # Pages are unpacked one column at a time next to the cells, and pages of plain numbers are as large as these.
    if cells > max_bytes or sum(chunk.total_uncompressed_size for chunk in chunks) > 2 * max_bytes:
        raise too_large(max_bytes)
    table, remaining_bytes = file.read(), max_bytes - cells
    for number, field in enumerate(table.schema):
        # Before a column of texts is expanded, the total length of its cells is subtracted from the remaining bytes.
        # Until then, each chunk holds its distinct texts once, and an index for each cell.
        if types.is_dictionary(field.type) and _is_text(field.type):
            for chunk in table.column(number).chunks:
                lengths = pyarrow.compute.binary_length(chunk.dictionary)
                # The longest text is checked first: a single huge text must not be multiplied by its cells.
                longest = pyarrow.compute.max(lengths).as_py() or 0
                if longest > MAX_CELL:
                    raise OSError(errno.EFBIG, f"it has a cell of {longest} characters, and {MAX_CELL} is the maximum")
                remaining_bytes -= pyarrow.compute.sum(lengths.take(chunk.indices)).as_py() or 0
            if remaining_bytes < 0:
                raise too_large(max_bytes)
            try:
                texts_as_cells = table.column(number).cast(field.type.value_type).cast(pyarrow.large_string())
            except pyarrow.ArrowInvalid as error:
                reason = f"column '{field.name}' holds bytes that are no text, not numbers or names"
                raise OSError(errno.EINVAL, reason) from error
            table = table.set_column(number, field.name, texts_as_cells)
    return table


def _is_text(kind: Any) -> bool:
    """Return whether a pyarrow type is text or bytes, stored plainly or as an index into a dictionary of distinct
    values.
    """
    from pyarrow import types

    kind = kind.value_type if types.is_dictionary(kind) else kind
    return any((types.is_string(kind), types.is_large_string(kind), types.is_binary(kind), types.is_large_binary(kind)))
