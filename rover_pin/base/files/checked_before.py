"""What was found sound before and need not be checked again: digests, in a file of a private folder."""

import contextlib
import hashlib
from collections.abc import Iterable
from pathlib import Path

from rover_pin.base.errors import CacheError, DataError
from rover_pin.base.files import bounded
from rover_pin.base.files.columns import replace_file
from rover_pin.base.files.private_folders import private_folders

MOST = 200
"""Digests that are kept, the latest; what falls out is checked anew."""


def digest_of(parts: Iterable[str]) -> str:
    """Return the digest of all that a finding depends on."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def is_cached(kind: str, digest: str) -> bool:
    """Return whether this was found sound by this user on this machine; False where nothing can be kept."""
    return digest in _digests(kind)


def remember(kind: str, digest: str) -> None:
    """Keep that this was found sound; where no private folder takes it, it is checked again next time."""
    digests = [*(old_digest for old_digest in _digests(kind) if old_digest != digest), digest][-MOST:]
    with contextlib.suppress(CacheError, DataError):
        replace_file(_file(kind), "\n".join(digests))


def _digests(kind: str) -> list[str]:
    try:
        return bounded.text(_file(kind)).split()
    except (CacheError, DataError, OSError, UnicodeDecodeError):
        return []


def _file(kind: str) -> Path:
    return private_folders()[0] / f"{kind}.sound"
