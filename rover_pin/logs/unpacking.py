"""Limit the number of bytes to which a ROS bag is unpacked, because a packed bag of a few kB may unpack to any size.

The package rosbags unpacks data in three places: through two tables of functions and through one module. While a bag is
open, the functions in these places are replaced by functions that count the unpacked bytes.
"""

from __future__ import annotations

import bz2
import io
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from rover_pin.base.errors import DataError
from rover_pin.base.files import bounded
from rover_pin.base.files.paths import is_file, is_folder

METADATA = "metadata.yaml"
"""File in the folder of a ROS 2 bag that describes the content of the bag."""
ALIASES = re.compile(r"(?m)(?:^|[-:,\[{])\s*[&*]")
"""Pattern of anchors and aliases in YAML. With these, a few lines of a file can expand to an unlimited size."""

PLAIN = ("", "none")
"""Names of data without compression in rosbags. Such data are not unpacked and need no limit."""

Opener = Callable[[Any], Any]


def unpack_bytes(opener: Opener, packed: bytes, allowance: bounded.Allowance) -> bytes:
    """Unpack some bytes completely, and return the result.

    Raises OSError: the limit on unpacked bytes is reached.

    Parameters
    ----------
    opener : callable
        Opens a packed file for reading, such as `lz4.frame.LZ4FrameFile`.
    packed : bytes
        The packed bytes.
    allowance : Allowance
        Counter of the bytes that may still be unpacked.
    """
    with _LimitedFile(opener(io.BytesIO(packed)), allowance) as file:
        return b"".join(iter(lambda: file.read(bounded.MIB), b""))


class _LimitedFile:
    """A packed file that is open for reading. Each byte that is read is subtracted from the bytes that may still be
    unpacked (`allowance`).
    """

    def __init__(self, file: Any, allowance: bounded.Allowance):
        self.file, self.allowance = file, allowance

    def read(self, size: int = -1) -> bytes:
        """Read at most `size` unpacked bytes and return them, but never more than 1 MiB in one call."""
        part: bytes = self.file.read(size if 0 <= size <= bounded.MIB else bounded.MIB)
        self.allowance.take(len(part))
        return part

    def __enter__(self) -> _LimitedFile:
        return self

    def __exit__(self, *error: object) -> None:
        self.file.close()


@contextmanager
def bounded_unpacking() -> Iterator[None]:
    """Limit the data that rosbags unpacks within this `with` block to `bounded.MAX_UNPACKED_BYTES` bytes in total."""
    from lz4.frame import LZ4FrameFile
    from rosbags.rosbag1 import reader as one
    from rosbags.rosbag2 import reader as two
    from rosbags.rosbag2 import storage_mcap as chunks

    allowance, zstd = bounded.Allowance(), two.zstd
    openers = {"zstd": zstd.ZstdFile, "lz4": LZ4FrameFile, "bz2": bz2.BZ2File}

    def whole(name: str) -> Callable[..., bytes]:
        """Return a replacement for the function of rosbags that unpacks bytes of the compression `name` completely."""
        return lambda raw, *size: unpack_bytes(openers[name], raw, allowance)

    # The reader of ROS 2 bags calls two functions of its module zstd; only these are replaced.
    module = SimpleNamespace(
        open=lambda file, mode: _LimitedFile(zstd.open(file, mode), allowance), decompress=whole("zstd")
    )
    with ExitStack() as stack:
        # Functions of both tables are found by the name of the compression.
        for table in (one.decompressors, chunks.DECOMPRESSORS):
            packed = {name: whole(name) for name in table if name not in PLAIN}  # KeyError for unknown compressions
            stack.enter_context(_replace_entries(table, packed))
        stack.enter_context(_replace_entries(vars(two), {"zstd": module}))
        yield


@contextmanager
def _replace_entries(table: dict[str, Any], entries: dict[str, Any]) -> Iterator[None]:
    """Replace entries of a table of functions within this `with` block, and restore them afterwards."""
    before = {name: table[name] for name in entries}
    table.update(entries)
    try:
        yield
    finally:
        table.update(before)


def refuse_anchors(bag: Path) -> None:
    """Check that the metadata.yaml of a bag folder has no YAML anchors or aliases, because rosbags would expand them.

    Raises DataError: the file has anchors or aliases, is too long, or is not text.
    """
    file = bag / METADATA
    if not is_folder(bag) or not is_file(file):
        return
    try:
        anchored = ALIASES.search(bounded.text(file))
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{file}: the file cannot be read: {getattr(error, 'strerror', '') or error}") from error
    if anchored:
        raise DataError(
            f"{file}: it has YAML anchors or aliases, which ROS does not write and which can expand without limit: "
            "remove them from the file."
        )
