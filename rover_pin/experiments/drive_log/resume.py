"""Long work taken up where it stopped: arrays that took long, kept in a folder under a digest of all they depend on."""

from __future__ import annotations

import dataclasses
import hashlib
import io
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.body.rover import Rover
from rover_pin.bounded import arrays
from rover_pin.columns import replace_file

FOLDER = ".resume"
Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Memory:
    """Arrays that were made once; without a folder nothing is kept.

    The files are plain arrays with checksums: reading one runs no code, and a damaged one is made again.
    """

    folder: Path | None = None
    key: str = ""

    def kept(self, asked: tuple[Any, ...], make: Callable[[], Arrays]) -> Arrays:
        """Return the arrays that answer `asked`, as they were kept, or make and keep them."""
        if self.folder is None:
            return make()
        file = self.folder / FOLDER / f"{digest(self.key, asked)}.npz"
        found = _read(file)
        if found is None:
            found, content = make(), io.BytesIO()
            np.savez(content, **found)  # type: ignore[arg-type]
            replace_file(file, content.getvalue())
        return found

    @property
    def told(self) -> str:
        """How much is kept, and where; empty where nothing is."""
        count = len(self._files())
        return f"{count} finished steps are kept in {self.folder}/{FOLDER}" if count else ""

    @contextmanager
    def noting(self) -> Iterator[None]:
        """Let who stops the work in this block take along what is kept, as a note."""
        try:
            yield
        except (KeyboardInterrupt, SystemExit) as stop:
            if self.told:
                stop.add_note(f"{self.told}: the same command goes on there")
            raise

    def done(self) -> None:
        """Remove what was kept: the work is finished."""
        for file in self._files():
            file.unlink(missing_ok=True)
        if self.folder is not None and (self.folder / FOLDER).is_dir() and not any((self.folder / FOLDER).iterdir()):
            (self.folder / FOLDER).rmdir()

    def _files(self) -> list[Path]:
        return [] if self.folder is None else list((self.folder / FOLDER).glob("*.npz"))


def _read(file: Path) -> Arrays | None:
    """Return what a file holds, or None where there is none or it is damaged."""
    try:
        return arrays(file)
    except (OSError, ValueError):
        return None


def digest(*values: Any) -> str:
    """Return a digest of values by their content: records, arrays, numbers, text, and what is made of them."""
    found = hashlib.sha256()
    _feed(found, values)
    return found.hexdigest()[:32]


def _feed(found: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        found.update(f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Rover):
        found.update(_of_rover(value))
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        found.update(f"{type(value).__module__}.{type(value).__qualname__}".encode())
        _feed(found, tuple(getattr(value, each.name) for each in dataclasses.fields(value)))
    elif isinstance(value, Mapping):
        _feed(found, tuple(value.items()))
    elif isinstance(value, (tuple, list)):
        found.update(b"%d(" % len(value))
        for each in value:
            _feed(found, each)
    elif isinstance(value, bytes):
        found.update(b"%d:" % len(value) + value)
    else:
        found.update(f"{type(value).__qualname__}{value!r};".encode())


@lru_cache(maxsize=8)
def _of_rover(rover: Rover) -> bytes:
    """Return a digest of a rover, which is compared by identity and stays the same through a loop."""
    parts = {each.name: getattr(rover, each.name) for each in dataclasses.fields(rover)}
    model: pin.Model = parts.pop("model")
    return digest(model.saveToString(), parts).encode()
