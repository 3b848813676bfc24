"""Files are read only where they are what they should be: regular, and no larger, packed or unpacked, than stated here.

What is refused is an `OSError` whose `strerror` says why, so that a reader tells it in its own sentence as any other.
"""

import errno
import io
import os
import stat
import zipfile
import zlib
from pathlib import Path

import numpy as np

MIB = 1 << 20
MOST_TEXT = 16 * MIB
"""Bytes of a description, as TOML or URDF."""
MOST_TABLE = 256 * MIB
"""Bytes of a table as text: some ten million numbers. A longer one belongs into Parquet."""
MOST_UNPACKED = 1024 * MIB
"""Bytes of arrays or of a Parquet table, in the file and in memory."""


def content(path: str | Path, most: int = MOST_UNPACKED, head: int | None = None) -> bytes:
    """Return the bytes of a regular file, or its first `head` ones.

    Raises OSError: it cannot be read, is a folder, a device or a pipe, or holds more than `most` bytes.
    """
    try:
        opened = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # a pipe without a writer would keep us waiting
    except ValueError as error:
        raise OSError(errno.EINVAL, "no file can have this name") from error
    with open(opened, "rb") as file:
        status = os.fstat(opened)
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "it is a device or a pipe, not a file")
        raw = file.read(most + 1 if head is None else head) if status.st_size <= most else b""
    if max(status.st_size, len(raw)) > most:
        raise too_large(most)
    return raw


def text(path: str | Path, most: int = MOST_TEXT, encoding: str = "utf-8") -> str:
    """Return the text of a regular file, its lines ended by newlines; raises what `content` and the decoding raise."""
    return io.TextIOWrapper(io.BytesIO(content(path, most)), encoding=encoding).read()


def arrays(path: str | Path, most: int = MOST_UNPACKED) -> dict[str, np.ndarray]:
    """Return the arrays of an `.npz`; one of objects would be unpickled, and is not read.

    Raises OSError: as of `content`, or its arrays hold more than `most` bytes.
    Raises ValueError: it is no `.npz` of plain arrays, or damaged.
    """
    packed = content(path, most)
    try:
        with zipfile.ZipFile(io.BytesIO(packed)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > most:
                raise too_large(most)
        with np.load(io.BytesIO(packed), allow_pickle=False) as npz:
            return {name: _array(npz[name]) for name in npz.files}
    except (zipfile.BadZipFile, zlib.error, EOFError, KeyError, MemoryError, NotImplementedError) as error:
        raise ValueError(str(error) or "damaged") from error


def _array(array: object) -> np.ndarray:
    if not isinstance(array, np.ndarray):
        raise ValueError("an entry of it is no array")
    return array


def too_large(most: int) -> OSError:
    """Return the error of what holds more than `most` bytes."""
    return OSError(errno.EFBIG, f"it holds more than {most // MIB} MiB, which is the most that is read")
