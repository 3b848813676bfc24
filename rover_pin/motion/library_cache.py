"""The folders of compiled libraries: nobody else writes there, and a library is loaded only as it was made."""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from rover_pin.errors import CacheError

VARIABLE = "ROVER_PIN_CACHE"
OTHERS_WRITE = 0o022
HINT = f"set {VARIABLE} to a folder of your own that can be written"


def private_folders() -> list[Path]:
    """Return the folders that may hold compiled libraries, the preferred first, made where they are missing.

    They are $ROVER_PIN_CACHE alone where it is set, else rover_pin in the user's cache and one of the user's in the
    system's folder for temporary files. A folder that belongs to another user than root, or to which others can write,
    is not among them: its libraries would run as ours.

    Raises
    ------
    CacheError
        There is none.
    """
    own = os.environ.get(VARIABLE)
    folders, troubles = [Path(own)] if own else _usual(), {}
    for folder in folders:
        troubles[folder] = _trouble(folder)
    safe = [folder for folder in folders if not troubles[folder]]
    if not safe:
        told = "; ".join(f"{folder}: {trouble}" for folder, trouble in troubles.items()) or "there is no home"
        raise CacheError(f"Compiled code cannot be kept ({told}): {HINT}.")
    return safe


def kept(folder: Path, stem: str) -> ctypes.CDLL | None:
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

    Raises
    ------
    CacheError
        No folder takes it, or it cannot be loaded.
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
        made = make(Path(place))
        file = _named(folder, stem, made.read_bytes())
        os.replace(made, file)
    return file


def _named(folder: Path, stem: str, content: bytes) -> Path:
    return folder / f"{stem}-{hashlib.sha256(content).hexdigest()[:32]}.so"


def _usual() -> list[Path]:
    folders = []
    with contextlib.suppress(RuntimeError):  # a user without a home
        folders.append(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "rover_pin")
    with contextlib.suppress(OSError):  # no folder for temporary files
        folders.append(Path(tempfile.gettempdir()) / f"rover_pin-{os.geteuid()}")
    return folders


def _trouble(folder: Path) -> str:
    """Return why a folder may not hold code, or nothing; make it where it is missing."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        about = folder.stat()
    except OSError as error:
        return error.strerror or str(error)
    if about.st_uid not in (os.geteuid(), 0):
        return f"it belongs to another user ({about.st_uid})"
    return "other users can write to it" if about.st_mode & OTHERS_WRITE else ""
