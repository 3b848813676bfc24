"""The folders where the package keeps compiled code and the results of checks for later runs.

The package loads compiled libraries from such a folder. Therefore only the user and root may be able to write there.
"""

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
"""Environment variable by which a user names the folder for compiled code."""
OTHERS_WRITE = 0o022
"""Permission bits that allow a folder's group, or all users, to write to it."""
HINT = f"set {VARIABLE} to a folder of your own that can be written"
"""Remedy that is printed if no folder can be used."""
MAX_DIGESTS = 200
"""Maximum number of successful checks of one kind (such as checks of URDF files) that are remembered. Beyond this
number the oldest are forgotten; a forgotten check runs again when its result is needed. The number exceeds the files
that a user usually works with, and the file of the digests then takes about 13 kB."""


def private_folders() -> list[Path]:
    """Return the folders that may hold compiled code, the preferred folder first. Missing folders are created.

    If $ROVER_PIN_CACHE is set, its folder is the only candidate. Otherwise the candidates are `rover_pin` in the user's
    cache, and a folder of the user in the system's folder for temporary files. A candidate is not returned if it
    belongs to a user other than this user and root, or if other users can write to it.

    Raises CacheError: no candidate can be used.
    """
    # A folder that the user configured is used alone: a silent change to another folder would surprise the user.
    configured = os.environ.get(VARIABLE)
    folders = [Path(configured)] if configured else []
    if not configured:
        with contextlib.suppress(RuntimeError):  # raised for a user without a home folder
            folders.append(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "rover_pin")
        with contextlib.suppress(OSError):  # raised where there is no folder for temporary files
            folders.append(Path(tempfile.gettempdir()) / f"rover_pin-{os.geteuid()}")
    # Someone else's library in such a folder would run as this user, so unsafe folders are never returned.
    troubles: dict[Path, str] = {}
    for folder in folders:
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            status = folder.stat()
        except OSError as error:
            troubles[folder] = error.strerror or str(error)
            continue
        if status.st_uid not in (os.geteuid(), 0):
            troubles[folder] = f"it belongs to another user ({status.st_uid})"
        elif status.st_mode & OTHERS_WRITE:
            troubles[folder] = "other users can write to it"
    safe = [folder for folder in folders if folder not in troubles]
    if not safe:
        reasons = (
            "; ".join(f"{folder}: {trouble}" for folder, trouble in troubles.items()) or "this user has no home folder"
        )
        raise CacheError(f"Compiled code cannot be kept ({reasons}): {HINT}.")
    return safe


def digest_of(parts: Iterable[str]) -> str:
    """Return one digest of several texts. Callers pass all texts on which the result of a check depends."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def is_cached(kind: str, digest: str) -> bool:
    """Return whether a check has already succeeded on these data, so that the check need not run again.

    `kind` names the check, such as "urdf"; `digest` is the digest of the data from `digest_of`.
    """
    return digest in _digests(kind)


def remember(kind: str, digest: str) -> None:
    """Store that a check has succeeded, so that later runs skip the check (see `is_cached`).

    `kind` names the check; `digest` is the digest of the checked data. If no private folder can be written, nothing is
    stored, and the check runs again in the next run.
    """
    digests = [*(old_digest for old_digest in _digests(kind) if old_digest != digest), digest][-MAX_DIGESTS:]
    with contextlib.suppress(CacheError, DataError):
        replace_file(_file(kind), "\n".join(digests))


def _digests(kind: str) -> list[str]:
    """Return the digests of the data that passed a kind of check, the oldest first; an empty list if no file can be
    read.
    """
    try:
        return bounded.text(_file(kind)).split()
    except (CacheError, DataError, OSError, UnicodeDecodeError):
        return []


def _file(kind: str) -> Path:
    """Return the path of the file that stores the successful checks of one kind."""
    return private_folders()[0] / f"{kind}.sound"
