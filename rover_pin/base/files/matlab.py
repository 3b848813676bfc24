"""A reader of MATLAB's .mat files of versions 4 to 7: arrays of numbers, and structs of such arrays.

The format is read here instead of by scipy, because scipy trusts the sizes that a damaged file states, and then ends
the program.

Source: MATLAB, MAT-File Format (MathWorks, 2019), chapters 1 (version 7) and 4 (version 4).
"""

import itertools
import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import BYTES_PER_NUMBER, MAX_NUMBERS_BYTES, MIB, Allowance, content

HEADER, MATRIX, COMPRESSED = 128, 14, 15
"""Number of bytes before the first data element of a version 5 file (HEADER), and the type numbers of a matrix (MATRIX)
and of a compressed matrix (COMPRESSED). All three are fixed by the format."""
ELEMENT_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Type number of a data element in a version 5 file -> NumPy type of its numbers, without the byte order."""
STRUCT, NUMBERS, COMPLEX = 2, range(6, 16), 0x800
"""Class number of a struct (STRUCT), class numbers of the arrays of numbers (NUMBERS), and the flag that marks an array
as complex (COMPLEX). Complex arrays are not read."""
OPAQUE = 17
"""Class number of a MATLAB object, such as a datetime, duration, string, table, timetable or timeseries."""
OTHER_CLASSES = {1: "cell array", 3: "object", 4: "text", 5: "sparse matrix", 16: "function"}
"""Class number of a MATLAB variable that holds no plain numbers -> the name of its class."""
TYPES_4 = ("f8", "f4", "i4", "i2", "u2", "u1")
"""NumPy types of the numbers in a version 4 file, without the byte order. The header of an array states the type as a
digit, which is the index in this tuple."""
ELEMENT = 512
"""Number of bytes that each matrix counts in addition to its numbers. They account for the Python object of the matrix,
and they limit the number of matrices, because a file of many empty matrices would take a long time to read."""


class NotNumbers(NamedTuple):
    """Stands for a variable that holds no plain numbers. `kind` is the name of its MATLAB class, such as "cell
    array".
    """

    kind: str


Variables = dict[str, Any]
"""Name of a variable -> its value: an array of numbers, a dict of this same type for a struct, or a NotNumbers."""


def mat_variables(path: Path) -> Variables:
    """Return the variables of a .mat file in a dict from name to value. Dimensions of length 1 are removed from arrays.

    Reading takes at most about 1.2 GiB of memory, because one limit holds for the sum of all decompressed bytes, of the
    numbers as floats, and of a fixed number of bytes for each matrix.

    Raises DataError: the file cannot be read, is of version 7.3 (HDF5), or would exceed the limit.
    """
    try:
        file = content(path)
        # Version 7.3 is an HDF5 file, whose mark may follow a header of 512 bytes.
        if b"\x89HDF" in (file[:4], file[512:516]):
            raise DataError(
                f"{path}: a .mat file of version 7.3 cannot be read: save the variables with '-v7', or as CSV."
            )
        # The allowance counts decompressed bytes and numbers together, because both are in memory at the same time.
        allowance = Allowance(2 * MAX_NUMBERS_BYTES)
        return dict(_variables_4(file, allowance) if 0 in file[:4] else _variables_5(file, allowance))
    except (OSError, ValueError, struct.error, zlib.error, OverflowError, RecursionError) as error:
        why = getattr(error, "strerror", "") or "its parts do not fit together"
        raise DataError(f"{path}: the file is not a .mat file that can be read: {why}.") from error


def _variables_5(file: bytes, allowance: Allowance) -> Iterator[tuple[str, Any]]:
    """Yield the name and the value of each variable in the bytes of a .mat file of version 5, 6 or 7."""
    # The last two bytes of the header state the byte order: MI is big-endian, IM is little-endian.
    order = ">" if file[HEADER - 2 : HEADER] == b"MI" else "<"
    for kind, part in _elements(memoryview(file)[HEADER:], order):
        body = part
        if kind == COMPRESSED:
            # The stated size is not trusted: the element is inflated by pieces, each taken from the allowance.
            inflater, pieces, rest = zlib.decompressobj(), list[bytes](), bytes(part)
            while rest and not inflater.eof:
                pieces.append(inflater.decompress(rest, MIB))
                allowance.take(len(pieces[-1]))
                rest = inflater.unconsumed_tail
            body = memoryview(b"".join(pieces))[8:]  # without the tag (8 bytes), which states a matrix
        name, value = _matrix(body, order, allowance)
        if name:  # a matrix without a name holds the data of objects, which are not read
            yield name, value


def _variables_4(file: bytes, allowance: Allowance) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the name and the values of each array in the bytes of a .mat file of version 4.

    An array is stored as a header of five integers, its name, and its numbers column by column. Texts, sparse matrices
    and complex arrays are skipped.
    """
    start = 0
    while start < len(file):
        # The integers are small, so the two high bytes of the first integer are zero in the right byte order.
        order = "<" if file[start + 2 : start + 4] == b"\0\0" else ">"
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", file, start)
        # Numbers outside their possible range show that the bytes are not a header of version 4.
        if not (0 <= kind % 1000 < 60 and length > 0 and min(rows, columns) >= 0):
            raise ValueError
        dtype = np.dtype(f"{order}{TYPES_4[kind % 100 // 10]}")
        begin, count = start + 20 + length, rows * columns
        # The size is taken from the allowance before the numbers are read, so that a false size cannot fill the memory.
        allowance.take(ELEMENT + BYTES_PER_NUMBER * count)
        values = np.frombuffer(file, dtype, count, begin)
        if kind % 10 == 0 and not is_complex:
            yield file[start + 20 : begin - 1].decode("latin-1"), values.reshape(rows, columns, order="F").squeeze()
        # The imaginary parts of a complex array follow its real parts, so its data are twice as long.
        start = begin + count * dtype.itemsize * (2 if is_complex else 1)


def _matrix(body: memoryview, order: str, allowance: Allowance) -> tuple[str, Any]:
    """Return the name and the value of a matrix in a .mat file of version 5.

    The value is an array of numbers, a dict for a struct, a NotNumbers for another class, or None for an empty struct
    or an empty element. The elements of a matrix are its flags, its dimensions, its name, and then its numbers or its
    fields.

    Parameters
    ----------
    body : memoryview
        Bytes of the matrix after its tag.
    order : str
        Byte order of the file, "<" or ">".
    allowance : Allowance
        Counter of the bytes that may still be unpacked.
    """
    allowance.take(ELEMENT)
    parts = _elements(body, order)
    # A damaged element may have fewer than four parts; empty parts take the place of the missing ones.
    (_, flags), (_, shape), (_, name), (kind, first) = itertools.islice(itertools.chain(parts, 4 * [(0, body[:0])]), 4)
    if not len(flags):
        return "", None
    # The lowest byte of the flags is the class of the array.
    (flag,) = struct.unpack_from(f"{order}I", flags)
    array_class = flag & 0xFF
    if array_class == OPAQUE:
        # An object has no dimensions: its name, "MCOS" and the name of its class follow the flags.
        return bytes(shape).decode("latin-1"), NotNumbers(bytes(first).decode("latin-1") or "object")
    dimensions = struct.unpack(f"{order}{len(shape) // 4}i", shape)
    value: Any = None
    if array_class == STRUCT and math.prod(dimensions) > 0:
        # Field names have a fixed length; the fields follow record by record.
        (length,), (_, names) = struct.unpack(f"{order}i", first), next(parts, (0, body[:0]))
        keys = [bytes(names[start : start + length]).split(b"\0")[0].decode() for start in range(0, len(names), length)]
        fields = [_matrix(field, order, allowance)[1] for _, field in parts] if keys else []
        value = {}
        for index, key in enumerate(keys):
            # A field of a single record keeps its value. Over several records, a field of one number each becomes the
            # vector of these numbers, and any other field becomes None.
            in_records = fields[index :: len(keys)]
            scalars = [part for part in in_records if isinstance(part, np.ndarray) and part.size == 1]
            if len(in_records) == 1:
                value[key] = in_records[0]
            elif len(scalars) == len(in_records):
                value[key] = np.array([float(scalar.reshape(())) for scalar in scalars])
            else:
                value[key] = None
    elif array_class in NUMBERS and not flag & COMPLEX and kind in ELEMENT_TYPES:
        # The numbers are stored column by column. Dimensions of length 1 are removed, so that a column becomes a
        # vector.
        numbers = np.frombuffer(first, f"{order}{ELEMENT_TYPES[kind]}")
        allowance.take(BYTES_PER_NUMBER * numbers.size)
        value = numbers.reshape(dimensions, order="F").squeeze()
    elif array_class in OTHER_CLASSES:
        value = NotNumbers(OTHER_CLASSES[array_class])
    elif flag & COMPLEX:
        value = NotNumbers("complex array")
    return bytes(name).decode("latin-1"), value


def _elements(body: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield the type number and the bytes of each data element in a part of a version 5 file.

    An element has a tag of 8 bytes (type and size) and its data, padded to a multiple of 8 bytes. An element with at
    most four bytes of data has the data inside its tag.

    Raises ValueError: an element is longer than `body`.
    """
    start = 0
    while start + 8 <= len(body):
        kind, size = struct.unpack_from(f"{order}II", body, start)
        # A size in the upper half of the type marks the short form, whose data follow after four bytes.
        begin = start + 4 if kind >> 16 else start + 8
        kind, size = (kind & 0xFFFF, kind >> 16) if kind >> 16 else (kind, size)
        if begin + size > len(body):
            raise ValueError
        yield kind, body[begin : begin + size]
        # Compressed elements are not padded, all others are.
        start = begin + size if kind == COMPRESSED else begin + size + -(begin + size) % 8
