"""The folders in which the package keeps what it made, or found sound, for a later run: nobody else can write there."""

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from rover_pin.base.errors import CacheError, DataError
from rover_pin.base.files import bounded
from rover_pin.base.files.whole_file import replace_file

VARIABLE = "ROVER_PIN_CACHE"
OTHERS_WRITE = 0o022
HINT = f"set {VARIABLE} to a folder of your own that can be written"


def private_folders() -> list[Path]:
    """Return the folders that may hold compiled code and findings, the preferred first, made where they are missing.

    They are $ROVER_PIN_CACHE alone where it is set, else rover_pin in the user's cache and one of the user's in the
    system's folder for temporary files. A folder that belongs to another user than root, or to which others can write,
    is not among them: its libraries would run as ours.

    Raises CacheError: there is none.
    """
    configured = os.environ.get(VARIABLE)
    folders, troubles = [Path(configured)] if configured else _usual(), {}
    for folder in folders:
        troubles[folder] = _trouble(folder)
    safe = [folder for folder in folders if not troubles[folder]]
    if not safe:
        reasons = "; ".join(f"{folder}: {trouble}" for folder, trouble in troubles.items()) or "there is no home"
        raise CacheError(f"Compiled code cannot be kept ({reasons}): {HINT}.")
    return safe


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
        status = folder.stat()
    except OSError as error:
        return error.strerror or str(error)
    if status.st_uid not in (os.geteuid(), 0):
        return f"it belongs to another user ({status.st_uid})"
    return "other users can write to it" if status.st_mode & OTHERS_WRITE else ""


MAX_DIGESTS = 200
"""Digests that are kept, the latest; what falls out is checked anew."""


def digest_of(parts: Iterable[str]) -> str:
    """Return the digest of all that a finding depends on."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def is_cached(kind: str, digest: str) -> bool:
    """Return whether this was found sound by this user on this machine; False where nothing can be kept."""
    return digest in _digests(kind)


def remember(kind: str, digest: str) -> None:
    """Keep that this was found sound; where no private folder takes it, it is checked again next time."""
    digests = [*(old_digest for old_digest in _digests(kind) if old_digest != digest), digest][-MAX_DIGESTS:]
    with contextlib.suppress(CacheError, DataError):
        replace_file(_file(kind), "\n".join(digests))


def _digests(kind: str) -> list[str]:
    try:
        return bounded.text(_file(kind)).split()
    except (CacheError, DataError, OSError, UnicodeDecodeError):
        return []


def _file(kind: str) -> Path:
    return private_folders()[0] / f"{kind}.sound"
