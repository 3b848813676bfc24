"""Tables in .mat files: vectors of one length, also inside structs; read by scipy, h5py not needed for version 5."""

from __future__ import annotations

import io
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
NUMBER, RECORD, RECORDS = 8, 256, (1, 2, 3)
"""Bytes that an entry takes in memory, as a number and as a record or cell, and the classes of the latter."""


def mat_table(path: Path) -> pd.DataFrame:
    """Return the vectors of the commonest length in a .mat file, matrices by their columns.

    Raises
    ------
    DataError
        It cannot be read, is of version 7.3 (HDF5), or holds no vectors.
    """
    from scipy.io import loadmat

    try:
        variables = loadmat(io.BytesIO(_bounded(content(path))), squeeze_me=True, struct_as_record=False)
    except NotImplementedError as error:
        raise DataError(f"{path}: a .mat of version 7.3 is not read: save it with '-v7', or as CSV.") from error
    except Exception as error:  # whatever scipy raises for bytes that are no .mat
        why = getattr(error, "strerror", "") or str(error)
        raise DataError(f"{path}: the file is no .mat that can be read: {why}".rstrip(". \n") + ".") from error
    vectors = dict(_vectors("", {name: value for name, value in variables.items() if not name.startswith("__")}))
    lengths = Counter(len(values) for values in vectors.values() if len(values) > 1)
    if not lengths:
        raise DataError(f"{path}: there is no vector of numbers in it: save one variable a channel.")
    length = lengths.most_common(1)[0][0]
    return pd.DataFrame({name: values for name, values in vectors.items() if len(values) == length})


def _bounded(file: bytes) -> bytes:
    """Return a file if neither what it unpacks to nor the entries that it declares are beyond `bounded`."""
    unpacked, entries = Allowance(), Allowance()
    order = ">" if file[HEAD - 2 : HEAD] == b"MI" else "<"
    for kind, part in _elements(memoryview(file)[HEAD:], order):
        _count(kind, part if kind != PACKED else _inflated(part, unpacked), order, entries)
    return file


def _inflated(part: memoryview, allowance: Allowance) -> memoryview:
    """Return a packed element without its tag, which is that of a matrix."""
    inflater, parts, rest = zlib.decompressobj(), [], bytes(part)
    while rest and not inflater.eof:
        parts.append(inflater.decompress(rest, MIB))
        allowance.take(len(parts[-1]))
        rest = inflater.unconsumed_tail
    return memoryview(b"".join(parts))[8:]


def _count(kind: int, body: memoryview, order: str, entries: Allowance) -> None:
    """Take the entries that a matrix declares, the second of its parts, and those of the matrices in it."""
    size = NUMBER
    for place, (inner, part) in enumerate(_elements(body, order) if kind in (MATRIX, PACKED) else ()):
        if place == 0 and len(part) >= 4:
            size = RECORD if struct.unpack_from(f"{order}I", part)[0] & 0xFF in RECORDS else NUMBER
        elif place == 1:
            dimensions = struct.unpack_from(f"{order}{len(part) // 4}i", part)
            entries.take(size * abs(math.prod(dimensions)))
        else:
            _count(inner, part, order, entries)


def _elements(body: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield the kind and the bytes of each element; one of four bytes or less is in its tag."""
    at = 0
    while at + 8 <= len(body):
        kind, size = struct.unpack_from(f"{order}II", body, at)
        begin = at + 4 if kind >> 16 else at + 8
        kind, size = (kind & 0xFFFF, kind >> 16) if kind >> 16 else (kind, size)
        yield kind, body[begin : begin + size]
        at = begin + size if kind == PACKED else begin + size + -(begin + size) % 8


def _vectors(prefix: str, table: dict[str, Any]) -> Iterator[tuple[str, np.ndarray]]:
    for key, value in table.items():
        name = f"{prefix}.{key}" if prefix else key
        if hasattr(value, "_fieldnames"):
            yield from _vectors(name, {field: getattr(value, field) for field in value._fieldnames})
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            yield from _columns(name, value)


def _columns(name: str, value: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    if value.ndim == 1:
        yield name, value.astype(float)
    elif value.ndim == 2:
        long = value if value.shape[0] >= value.shape[1] else value.T
        yield from ((f"{name} {at}", column.astype(float)) for at, column in enumerate(long.T, 1))
