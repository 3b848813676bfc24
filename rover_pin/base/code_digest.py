"""What tells this code from any other, so that results of other code are not gone on from."""

import hashlib
from collections.abc import Iterable
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from rover_pin.version import __version__


def key_of_code(others: Iterable[Path] = ()) -> str:
    """Return a key of this program, its version and its very code, and of the code in other files."""
    digest = hashlib.sha256(_own().encode())
    for file in sorted(others):
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:32]


@lru_cache(maxsize=1)
def _own() -> str:
    package = Path(str(files("rover_pin")))
    digest = hashlib.sha256(__version__.encode())
    for file in sorted(file for kind in ("*.py", "*.c") for file in package.rglob(kind)):
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
