"""A digest of the package's code. A stopped calculation is resumed only if the code has not changed since it began."""

import hashlib
from collections.abc import Iterable
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from rover_pin.version import __version__


def key_of_code(others: Iterable[Path] = ()) -> str:
    """Return a digest of the code that computes a result, as 32 hexadecimal digits.

    The digest covers the package's version, its Python and C files, and `others`, which are files of code outside the
    package, such as a user's effects. A saved result is stored with its digest. If the present digest differs, other
    code computed the saved result, and the result must be computed again.

    Examples
    --------
    >>> len(key_of_code())
    32
    """
    digest = hashlib.sha256(_package_key().encode())
    # The order of the files must not change the digest.
    for file in sorted(others):
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:32]


@lru_cache(maxsize=1)
def _package_key() -> str:
    """Return the digest of the package's version and of its Python and C files."""
    # Every file is hashed by itself, so that moving text from the end of one file to the next changes the digest.
    package = Path(str(files("rover_pin")))
    digest = hashlib.sha256(__version__.encode())
    for file in sorted(file for kind in ("*.py", "*.c") for file in package.rglob(kind)):
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
