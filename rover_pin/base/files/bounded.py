"""Reading files within limits: only regular files are opened, and only files that are not larger than a maximum size.

A user's file may be a device, a pipe, or far larger in memory than on the disk. A refused file raises an `OSError`
whose `strerror` is the reason, so that each reader can report the reason in its own error, like any other error of the
file system.
"""

import errno
import io
import math
import os
import stat
import zipfile
import zlib
from pathlib import Path

import numpy as np

MIB = 1 << 20
"""Number of bytes in one mebibyte."""
MAX_TEXT_BYTES = 16 * MIB
"""Maximum size of a TOML, URDF or similar text file [bytes]. A larger file is refused. Files that people or programs
write for a rover have at most some hundred kB."""
MAX_TABLE_BYTES = 256 * MIB
"""Maximum size of a table in a text file [bytes], about ten million numbers. A larger text file is refused; such a
table must be given as Parquet."""
MAX_UNPACKED_BYTES = 1024 * MIB
"""Maximum size of one file of any kind, and of all messages of one recording after unpacking [bytes]. Larger data are
refused. Messages are read one after another, so they need not fit into the memory together."""
MAX_NUMBERS_BYTES = 256 * MIB
"""Maximum size of all numbers of one file [bytes], which is 33 million numbers: each number counts as a float of 8
bytes. A file with more numbers is refused. Readers make copies of the numbers; with all copies, reading one file takes
at most about 1.2 GiB of memory."""
BYTES_PER_NUMBER = 8
"""Size of a float in memory [bytes]."""


def content(path: str | Path, max_bytes: int = MAX_UNPACKED_BYTES, head: int | None = None) -> bytes:
    """Return the bytes of a regular file, or only the first `head` bytes.

    Raises OSError: the file cannot be read, is a folder, a device or a pipe, or holds more than `max_bytes`. The size
    of the whole file counts, also if only its head is read.
    """
    try:
        # Without O_NONBLOCK, opening a pipe would wait for a process that writes to it.
        opened = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except ValueError as error:
        raise OSError(errno.EINVAL, "no file can have this name") from error
    with open(opened, "rb") as file:
        status = os.fstat(opened)
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "it is a device or a pipe, not a file")
        # One byte more than allowed is read, so that the check below notices a file that is still growing.
        raw = file.read(max_bytes + 1 if head is None else head) if status.st_size <= max_bytes else b""
    # The file may have grown after the system stated its size, so the bytes that were read are counted as well.
    if max(status.st_size, len(raw)) > max_bytes:
        raise too_large(max_bytes)
    return raw


def text(path: str | Path, max_bytes: int = MAX_TEXT_BYTES, encoding: str = "utf-8") -> str:
    r"""Return the text of a regular file; line ends of all systems become "\n".

    Raises OSError: the file cannot be read, is no regular file, or holds more than `max_bytes`.
    Raises UnicodeDecodeError: the bytes are no text in this encoding.
    """
    return io.TextIOWrapper(io.BytesIO(content(path, max_bytes)), encoding=encoding).read()


def arrays(path: str | Path, max_bytes: int = MAX_NUMBERS_BYTES) -> dict[str, np.ndarray]:
    """Return the arrays of an `.npz` file in a dict from the name of an array to the array.

    Arrays of Python objects are refused, because NumPy would unpickle them, and unpickling runs code from the file.

    Raises OSError: the file cannot be read, or its arrays together hold more than `max_bytes`.
    Raises ValueError: the file is not an `.npz` file of plain arrays, or is damaged.
    """
    arrays_by_name: dict[str, np.ndarray] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(content(path, 2 * max_bytes))) as archive:
            # The archive states the unpacked sizes. They are checked before anything is unpacked.
            if sum(entry.file_size for entry in archive.infolist()) > max_bytes:
                raise too_large(max_bytes)
            remaining_bytes = max_bytes
            for entry in archive.infolist():
                name = entry.filename.removesuffix(".npy")
                arrays_by_name[name] = array_of(archive.read(entry), max_bytes)
                # Numbers of one byte take eight when a reader makes floats of them, so floats are counted.
                remaining_bytes -= BYTES_PER_NUMBER * arrays_by_name[name].size
                if remaining_bytes < 0:
                    raise too_large(max_bytes)
    except (zipfile.BadZipFile, zlib.error, EOFError, KeyError, MemoryError, NotImplementedError) as error:
        raise ValueError(str(error) or "damaged") from error
    except RuntimeError as error:  # zipfile's error for an entry with a password
        raise ValueError(str(error)) from error
    return arrays_by_name


def array_of(raw: bytes, max_bytes: int = MAX_NUMBERS_BYTES) -> np.ndarray:
    """Return the array that the bytes of an `.npy` file hold. The array is read-only and shares the memory of `raw`.

    The header of a damaged file may state an array of any size. Therefore the shape and type in the header are compared
    with the number of bytes that follow the header before an array is made.

    Raises OSError: the numbers would take more than `max_bytes` as floats.
    Raises ValueError: the bytes are not an `.npy` file of plain values, or the file is damaged.
    """
    file = io.BytesIO(raw)
    # The format version decides how the header is encoded.
    version = np.lib.format.read_magic(file)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in readers:
        raise ValueError(f"its format version is {version[0]}.{version[1]}; only versions 1.0 and 2.0 can be read")
    shape, columns_first, dtype = readers[version](file)
    # Objects would be unpickled, and unpickling runs code.
    if dtype.hasobject:
        raise ValueError("it holds Python objects instead of plain numbers")
    count, following_bytes = math.prod(shape), len(raw) - file.tell()
    if count * dtype.itemsize != following_bytes:
        raise ValueError(
            f"its header states {count} values of {dtype.itemsize} bytes each, but {following_bytes} bytes follow it"
        )
    if count * BYTES_PER_NUMBER > max_bytes:
        raise too_large(max_bytes)
    # NumPy refuses an empty buffer, so an array without elements is made separately.
    values = np.frombuffer(raw, dtype, count, file.tell()) if count else np.zeros(0, dtype)
    return values.reshape(shape, order="F" if columns_first else "C")


class Allowance:
    """A counter of the bytes that may still be unpacked from one file, or from one recording of several files.

    A small compressed file may unpack to any size. Therefore the reader subtracts the size of each unpacked piece from
    this counter, and an error stops the reader when the counter falls below zero.
    """

    def __init__(self, max_bytes: int | None = None) -> None:
        self.max_bytes = self.remaining_bytes = MAX_UNPACKED_BYTES if max_bytes is None else max_bytes

    def take(self, count: int) -> None:
        """Subtract `count` bytes from the number of bytes that may still be unpacked.

        Raises OSError: fewer than `count` bytes may still be unpacked.
        """
        self.remaining_bytes -= count
        if self.remaining_bytes < 0:
            raise OSError(errno.EFBIG, f"it unpacks to more than {self.max_bytes // MIB} MiB, the maximum that is read")


def too_large(max_bytes: int) -> OSError:
    """Return the error to raise for a file that holds more than `max_bytes` bytes."""
    return OSError(errno.EFBIG, f"it holds more than {max_bytes // MIB} MiB, the maximum that is read")
