"""Long work taken up where it stopped: arrays that took long, kept in a folder under a digest of all they depend on."""

import dataclasses
import hashlib
import io
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from rover_pin.base.files.bounded import arrays
from rover_pin.base.files.whole_file import replace_file
from rover_pin.rover.rover import Rover

FOLDER = ".resume"
Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Memory:
    """Arrays that were made once; without a folder nothing is kept.

    The files are plain arrays with checksums: reading one runs no code, and a damaged one is made again.
    """

    folder: Path | None = None
    key: str = ""

    def cached_arrays(self, request: tuple[Any, ...], make: Callable[[], Arrays]) -> Arrays:
        """Return the arrays that answer `request`, as they were kept, or make and keep them."""
        if self.folder is None:
            return make()
        file = self.folder / FOLDER / f"{digest(self.key, request)}.npz"
        stored_arrays = _read(file)
        if stored_arrays is None:
            stored_arrays, content = make(), io.BytesIO()
            np.savez(content, **stored_arrays)  # type: ignore[arg-type]
            replace_file(file, content.getvalue())
        return stored_arrays

    @property
    def status(self) -> str:
        """How much is kept, and where; empty where nothing is."""
        count = len(self._files())
        return f"{count} finished steps are kept in {self.folder}/{FOLDER}" if count else ""

    @contextmanager
    def noting(self) -> Iterator[None]:
        """Let who stops the work in this block take along what is kept, as a note."""
        try:
            yield
        except (KeyboardInterrupt, SystemExit) as stop:
            if self.status:
                stop.add_note(f"{self.status}: the same command goes on there")
            raise

    def remove_files(self) -> None:
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
    hasher = hashlib.sha256()
    _feed(hasher, values)
    return hasher.hexdigest()[:32]


def _feed(hasher: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        hasher.update(f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Rover):
        hasher.update(_of_rover(value))
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        hasher.update(f"{type(value).__module__}.{type(value).__qualname__}".encode())
        _feed(hasher, tuple(getattr(value, field.name) for field in dataclasses.fields(value)))
    elif isinstance(value, Mapping):
        _feed(hasher, tuple(value.items()))
    elif isinstance(value, (tuple, list)):
        hasher.update(b"%d(" % len(value))
        for element in value:
            _feed(hasher, element)
    elif isinstance(value, bytes):
        hasher.update(b"%d:" % len(value) + value)
    else:
        hasher.update(f"{type(value).__qualname__}{value!r};".encode())


@lru_cache(maxsize=8)
def _of_rover(rover: Rover) -> bytes:
    """Return a digest of a rover, which is compared by identity and stays the same through a loop."""
    parts = {field.name: getattr(rover, field.name) for field in dataclasses.fields(rover)}
    model: pin.Model = parts.pop("model")
    return digest(model.saveToString(), parts).encode()


ROOM = 64 * 2**20
"""Bytes of predictions that are kept, at most: those asked for last."""


class Recent:
    """The last predictions, by a digest of all that they depend on; what is returned is not to be written to."""

    def __init__(self, room: int = ROOM):
        self.room = room
        self._known: OrderedDict[str, np.ndarray] = OrderedDict()
        self._size = 0

    def of(self, keys: Sequence[str], make: Callable[[list[int]], Sequence[np.ndarray]]) -> list[np.ndarray]:
        """Return what belongs to each key; `make` is asked for those that are not known, by their places."""
        missing = [at for at, key in enumerate(keys) if key not in self._known and key not in keys[:at]]
        new_predictions = dict(zip([keys[at] for at in missing], make(missing) if missing else (), strict=True))
        predictions = [new_predictions[key] if key in new_predictions else self._known[key] for key in keys]
        for key, prediction in zip(keys, predictions, strict=True):
            self._keep(key, prediction)
        return predictions

    def _keep(self, key: str, prediction: np.ndarray) -> None:
        if key in self._known:
            self._known.move_to_end(key)
            return
        prediction.flags.writeable = False
        self._known[key] = prediction
        self._size += prediction.nbytes
        while self._size > self.room:
            self._size -= self._known.popitem(last=False)[1].nbytes
