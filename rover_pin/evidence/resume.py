"""Long work taken up where it stopped: finished stages kept in a folder under a key of everything they depend on."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from rover_pin.columns import replace_file
from rover_pin.version import __version__

Result = TypeVar("Result")
FOLDER = ".resume"


@dataclass(frozen=True)
class Stages:
    """Finished stages of one piece of work; without a folder nothing is kept.

    The files are pickles: only those that this program wrote into the user's own output folder are read.
    """

    folder: Path | None = None
    key: str = ""

    def kept(self, name: str, make: Callable[[], Result]) -> Result:
        """Return the stage as it was kept, or make and keep it."""
        if self.folder is None:
            return make()
        file = self.folder / FOLDER / f"{name}-{self.key}.pickle"
        found: Result | None = _read(file)
        if found is None:
            found = make()
            replace_file(file, pickle.dumps(found))
        return found

    def done(self) -> None:
        """Remove what was kept: the work is finished."""
        for file in (self.folder / FOLDER).glob("*.pickle") if self.folder else ():
            file.unlink(missing_ok=True)
        if self.folder is not None and (self.folder / FOLDER).is_dir():
            (self.folder / FOLDER).rmdir()


def _read(file: Path) -> Any:
    """Return what a file holds, or None where there is none or it is broken."""
    try:
        return pickle.loads(file.read_bytes())
    except (OSError, pickle.UnpicklingError, EOFError, AttributeError, ImportError, IndexError):
        return None


def key_of(files: Iterable[Path], *words: object) -> str:
    """Return a key of the contents of files, of further words, and of this version of the program."""
    digest = hashlib.sha256(__version__.encode())
    for file in sorted(files):
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    digest.update(repr(words).encode())
    return digest.hexdigest()[:20]


def told(folder: str | Path | None) -> str:
    """Return what is kept in a folder and how to go on with it."""
    kept = [] if folder is None else list((Path(folder) / FOLDER).glob("*.pickle"))
    if not kept:
        return "nothing is kept"
    return f"{len(kept)} finished steps are kept in {Path(folder or '') / FOLDER}: the same command goes on there"
