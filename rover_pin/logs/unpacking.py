"""What rosbags unpacks goes through a bound: a packed bag of a few kB may hold any size.

rosbags unpacks in three places, each by tables and a module that are ours while a bag is open.
"""

from __future__ import annotations

import bz2
import errno
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
ALIASES = re.compile(r"(?m)(?:^|[-:,\[{])\s*[&*]")
"""YAML that names a part of itself, and of which a few lines grow without bound."""

PLAIN = ("", "none")
"""How rosbags calls what is not packed."""

ADVICE = "which is the most that is read: give it unpacked, or without its images"

Opener = Callable[[Any], Any]


class Allowance:
    """What may still be unpacked of one file or bag [bytes]."""

    def __init__(self) -> None:
        self.most = self.left = bounded.MOST_UNPACKED

    def unpack_bytes(self, opener: Opener, packed: bytes) -> bytes:
        """Return packed bytes as a whole; an `OSError` where that is more than is left."""
        with _LimitedFile(opener(io.BytesIO(packed)), self) as file:
            return b"".join(iter(lambda: file.read(bounded.MIB), b""))

    def take(self, count: int) -> None:
        """Take this number of bytes."""
        self.left -= count
        if self.left < 0:
            raise OSError(errno.EFBIG, f"it unpacks to more than {self.most // bounded.MIB} MiB, {ADVICE}")


class _LimitedFile:
    """A packed file whose bytes are taken from an allowance as they are read."""

    def __init__(self, file: Any, allowance: Allowance):
        self.file, self.allowance = file, allowance

    def read(self, size: int = -1) -> bytes:
        part: bytes = self.file.read(size if 0 <= size <= bounded.MIB else bounded.MIB)
        self.allowance.take(len(part))
        return part

    def __enter__(self) -> _LimitedFile:
        return self

    def __exit__(self, *error: object) -> None:
        self.file.close()


@contextmanager
def bounded_unpacking() -> Iterator[None]:
    """Let rosbags unpack `bounded.MOST_UNPACKED` bytes in all, of one bag, in this block."""
    from lz4.frame import LZ4FrameFile
    from rosbags.rosbag1 import reader as one
    from rosbags.rosbag2 import reader as two
    from rosbags.rosbag2 import storage_mcap as chunks

    allowance, zstd = Allowance(), two.zstd
    openers = {"zstd": zstd.ZstdFile, "lz4": LZ4FrameFile, "bz2": bz2.BZ2File}

    def whole(name: str) -> Callable[..., bytes]:
        return lambda raw, *size: allowance.unpack_bytes(openers[name], raw)

    module = SimpleNamespace(
        open=lambda file, mode: _LimitedFile(zstd.open(file, mode), allowance), decompress=whole("zstd")
    )
    with ExitStack() as stack:
        for table in (one.decompressors, chunks.DECOMPRESSORS):
            packed = {name: whole(name) for name in table if name not in PLAIN}  # of an unknown kind: a KeyError
            stack.enter_context(_replace_entries(table, packed))
        stack.enter_context(_replace_entries(vars(two), {"zstd": module}))
        yield


@contextmanager
def _replace_entries(table: dict[str, Any], entries: dict[str, Any]) -> Iterator[None]:
    before = {name: table[name] for name in entries}
    table.update(entries)
    try:
        yield
    finally:
        table.update(before)


def refuse_anchors(bag: Path) -> None:
    """Refuse a bag folder whose metadata is no file of text, or names parts of itself.

    Raises DataError: it does, is too long, or cannot be read.
    """
    file = bag / METADATA
    if not is_folder(bag) or not is_file(file):
        return
    try:
        anchored = ALIASES.search(bounded.text(file))
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{file}: the file cannot be read: {getattr(error, 'strerror', '') or error}") from error
    if anchored:
        raise DataError(f"{file}: it has YAML anchors or aliases, which ROS does not write; take them out.")
