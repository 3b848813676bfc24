"""Parquet files: read only where what they unpack to, a cell of text too, is bounded."""

import errno
from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import MOST_UNPACKED, content, too_large

MOST_CELL = 1000
"""Characters of a cell of text: a table of measurements has names there, no more."""
NUMBER = 8
"""Bytes that a value takes in memory, at most, besides its text."""


def parquet_table(path: Path) -> Any:
    """Return a Parquet file as a pyarrow Table whose names differ.

    Raises DataError: the file is missing, unpacks to more than `parquet` allows, or pyarrow cannot read it.
    """
    try:
        table = unpack_table(content(path))
        table.validate(full=True)
    except Exception as error:  # whatever pyarrow raises for bytes that are no Parquet, an OSError without a reason too
        if isinstance(error, OSError) and error.strerror:
            raise DataError(f"{path}: the file cannot be read: {error.strerror}.") from error
        raise DataError(f"{path}: the file is not Parquet: {error}".rstrip(". \n") + ".") from error
    for name in table.column_names:
        if table.column_names.count(name) > 1:
            raise DataError(f"{path}: column '{name}' stands there twice; rename one.")
    return table


def unpack_table(packed: bytes, most: int = MOST_UNPACKED) -> Any:
    """Return the pyarrow Table of a Parquet file's bytes.

    Its metadata say how much it holds; texts stay in their dictionary, where repeats take no room, until their longest
    is known.

    Raises OSError: it would unpack to more than `most` bytes, has a cell of more than MOST_CELL characters, or lists in
    a column.
    Raises pyarrow.ArrowException: it is no Parquet.
    """
    import pyarrow
    import pyarrow.parquet

    reader = pyarrow.BufferReader(packed)
    schema = pyarrow.parquet.ParquetFile(reader).schema_arrow
    for field in schema:
        if pyarrow.types.is_nested(field.type):
            raise OSError(errno.EINVAL, f"column '{field.name}' holds lists or records, not numbers or names")
    texts = [field.name for field in schema if _is_text(field.type)]
    file = pyarrow.parquet.ParquetFile(reader, read_dictionary=texts)
    if max(_size(file.metadata), file.metadata.num_rows * len(schema) * NUMBER) > most:
        raise too_large(most)
    table = file.read()
    for at, field in enumerate(table.schema):
        if pyarrow.types.is_dictionary(field.type) and _is_text(field.type):
            table = table.set_column(at, field.name, _written_out(table.column(at)))
    return table


def _size(metadata: Any) -> int:
    chunks = (
        metadata.row_group(group).column(column)
        for group in range(metadata.num_row_groups)
        for column in range(metadata.num_columns)
    )
    return sum(chunk.total_uncompressed_size + NUMBER * chunk.num_values for chunk in chunks)


def _is_text(kind: Any) -> bool:
    from pyarrow import types

    kind = kind.value_type if types.is_dictionary(kind) else kind
    return any((types.is_string(kind), types.is_large_string(kind), types.is_binary(kind), types.is_large_binary(kind)))


def _written_out(column: Any) -> Any:
    """Return a column of texts in a dictionary as plain texts."""
    import pyarrow.compute

    for chunk in column.chunks:
        longest = pyarrow.compute.max(pyarrow.compute.binary_length(chunk.dictionary)).as_py() or 0
        if longest > MOST_CELL:
            raise OSError(errno.EFBIG, f"it has a cell of {longest} characters, and {MOST_CELL} are the most")
    return column.cast(column.type.value_type)
