"""The compiled libraries that are kept: a library is loaded only as it was made, from a private folder."""

import contextlib
import ctypes
import hashlib
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from rover_pin.base.errors import CacheError
from rover_pin.base.files.private_folders import HINT


def cached_library(folder: Path, stem: str) -> ctypes.CDLL | None:
    """Return the library of this stem, or None; one that is not as it was made, or does not load, is removed."""
    for file in sorted(folder.glob(f"{stem}-*.so")):
        with contextlib.suppress(OSError):
            if file == _named(folder, stem, file.read_bytes()):
                return ctypes.CDLL(str(file))
        with contextlib.suppress(OSError):
            file.unlink()
    return None


def built(folders: Sequence[Path], stem: str, make: Callable[[Path], Path]) -> ctypes.CDLL:
    """Return the library whose file `make(folder)` writes, kept in the first folder that takes it.

    Its name has the digest of its content, so one step puts both in place, whoever else builds it meanwhile.

    Raises CacheError: no folder takes it, or it cannot be loaded.
    """
    troubles = []
    for folder in folders:
        try:
            return ctypes.CDLL(str(_placed(folder, stem, make)))
        except OSError as error:
            troubles.append(f"{folder}: {error.strerror or error}")
    raise CacheError(f"Compiled code cannot be kept or loaded ({'; '.join(troubles)}): {HINT}.")


def _placed(folder: Path, stem: str, make: Callable[[Path], Path]) -> Path:
    with tempfile.TemporaryDirectory(dir=folder) as place:
        compiled = make(Path(place))
        file = _named(folder, stem, compiled.read_bytes())
        os.replace(compiled, file)
    return file


def _named(folder: Path, stem: str, content: bytes) -> Path:
    return folder / f"{stem}-{hashlib.sha256(content).hexdigest()[:32]}.so"
