"""Tables in .mat files of versions 4 to 7: vectors of one length, also inside structs.

Read here: scipy takes a damaged file's word for its sizes, and the program ends without a word.
Source: MATLAB, MAT-File Format (MathWorks, 2019), chapters 1 (version 7) and 4.
"""

import itertools
import math
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import MIB, content
from rover_pin.logs.unpacking import Allowance

HEAD, MATRIX, PACKED = 128, 14, 15
"""Bytes before the elements of version 5, and the kinds of those that hold others."""
KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
RECORD, NUMBERS, COMPLEX = 2, range(6, 16), 0x800
"""Classes of a struct and of arrays of numbers, and the flag of complex ones, which no channel is."""
KINDS_4 = ("f8", "f4", "i4", "i2", "u2", "u1")
NUMBER = 8
"""Bytes that each number takes in memory."""

Variables = dict[str, Any]
"""Arrays and structs by name."""


def mat_table(path: Path) -> pd.DataFrame:
    """Return the vectors of the commonest length in a .mat file, matrices by their columns.

    Raises DataError: it cannot be read, is of version 7.3 (HDF5), or holds no vectors.
    """
    try:
        file = content(path)
        if b"\x89HDF" in (file[:4], file[512:516]):
            raise DataError(f"{path}: a .mat of version 7.3 is not read: save it with '-v7', or as CSV.")
        vectors = dict(_vectors("", _variables(file)))
    except (OSError, ValueError, struct.error, zlib.error, OverflowError, RecursionError) as error:
        why = getattr(error, "strerror", "") or "its parts do not fit together"
        raise DataError(f"{path}: the file is no .mat that can be read: {why}.") from error
    lengths = Counter(len(values) for values in vectors.values() if len(values) > 1)
    if not lengths:
        raise DataError(f"{path}: there is no vector of numbers in it: save one variable a channel.")
    length = lengths.most_common(1)[0][0]
    return pd.DataFrame({name: values for name, values in vectors.items() if len(values) == length})


def _variables(file: bytes) -> Variables:
    allowance = Allowance()
    if 0 in file[:4]:
        return dict(_of_version_4(file, allowance))
    order = ">" if file[HEAD - 2 : HEAD] == b"MI" else "<"
    elements = _elements(memoryview(file)[HEAD:], order)
    bodies = (_inflate_element(part, allowance) if kind == PACKED else part for kind, part in elements)
    return dict(_matrix(body, order, allowance) for body in bodies)


def _of_version_4(file: bytes, allowance: Allowance) -> Iterator[tuple[str, np.ndarray]]:
    at = 0
    while at < len(file):
        order = "<" if file[at + 2 : at + 4] == b"\0\0" else ">"
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", file, at)
        if not (0 <= kind % 1000 < 60 and length > 0 and min(rows, columns) >= 0):
            raise ValueError
        dtype = np.dtype(f"{order}{KINDS_4[kind % 100 // 10]}")
        begin, count = at + 20 + length, rows * columns
        allowance.take(NUMBER * count)
        values = np.frombuffer(file, dtype, count, begin)
        if kind % 10 == 0 and not is_complex:
            yield file[at + 20 : begin - 1].decode("latin-1"), values.reshape(rows, columns, order="F").squeeze()
        at = begin + count * dtype.itemsize * (2 if is_complex else 1)


def _inflate_element(part: memoryview, allowance: Allowance) -> memoryview:
    """Return a packed element without its tag, which is that of a matrix."""
    inflater, parts, rest = zlib.decompressobj(), [], bytes(part)
    while rest and not inflater.eof:
        parts.append(inflater.decompress(rest, MIB))
        allowance.take(len(parts[-1]))
        rest = inflater.unconsumed_tail
    return memoryview(b"".join(parts))[8:]


def _matrix(body: memoryview, order: str, allowance: Allowance) -> tuple[str, Any]:
    """Return the name of a matrix, and its numbers, or the fields of records; else None."""
    parts = _elements(body, order)
    (_, flags), (_, shape), (_, name), (kind, first) = itertools.islice(itertools.chain(parts, 4 * [(0, body[:0])]), 4)
    if not name and not len(flags):
        return "", None
    (flag,), dimensions = struct.unpack_from(f"{order}I", flags), struct.unpack(f"{order}{len(shape) // 4}i", shape)
    value: Any = None
    if flag & 0xFF == RECORD and math.prod(dimensions) > 0:
        (length,), (_, names) = struct.unpack(f"{order}i", first), next(parts, (0, body[:0]))
        keys = [bytes(names[at : at + length]).split(b"\0")[0].decode() for at in range(0, len(names), length)]
        fields = [_matrix(field, order, allowance)[1] for _, field in parts] if keys else []
        value = {key: _join_values(fields[at :: len(keys)]) for at, key in enumerate(keys)}
    elif flag & 0xFF in NUMBERS and not flag & COMPLEX and kind in KINDS:
        numbers = np.frombuffer(first, f"{order}{KINDS[kind]}")
        allowance.take(NUMBER * numbers.size)
        value = numbers.reshape(dimensions, order="F").squeeze()
    return bytes(name).decode("latin-1"), value


def _join_values(values: list[Any]) -> Any:
    """Return a field of one record as it is, of several, one a row, as a vector of its numbers."""
    if len(values) == 1:
        return values[0]
    numbers = [value for value in values if isinstance(value, np.ndarray) and value.size == 1]
    return np.array([float(value.reshape(())) for value in numbers]) if len(numbers) == len(values) else None


def _elements(body: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield the kind and the bytes of each element; one of four bytes or less is in its tag."""
    at = 0
    while at + 8 <= len(body):
        kind, size = struct.unpack_from(f"{order}II", body, at)
        begin = at + 4 if kind >> 16 else at + 8
        kind, size = (kind & 0xFFFF, kind >> 16) if kind >> 16 else (kind, size)
        if begin + size > len(body):
            raise ValueError
        yield kind, body[begin : begin + size]
        at = begin + size if kind == PACKED else begin + size + -(begin + size) % 8


def _vectors(prefix: str, table: Variables) -> Iterator[tuple[str, np.ndarray]]:
    for key, value in table.items():
        name = f"{prefix}.{key}" if prefix else key
        if isinstance(value, dict):
            yield from _vectors(name, value)
        elif isinstance(value, np.ndarray):
            yield from _columns(name, value)


def _columns(name: str, value: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    if value.ndim == 1:
        yield name, value.astype(float)
    elif value.ndim == 2:
        long = value if value.shape[0] >= value.shape[1] else value.T
        yield from ((f"{name} {at}", column.astype(float)) for at, column in enumerate(long.T, 1))
