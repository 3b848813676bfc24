"""Stores for results of replays: in files, so that a search that was stopped can continue, and in memory, for repeated
requests.

`Memory` keeps arrays in files of a folder. `Recent` keeps the most recent predictions of the running process. Both find
a result by a digest of everything on which the result depends.
"""

import dataclasses
import hashlib
import io
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
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
"""Name of the folder for stored arrays, inside the folder of the results."""
Arrays = dict[str, np.ndarray]
"""Name -> array, as in an npz file."""
MAX_RECENT_BYTES = 64 * 2**20
"""Maximum total size of the predictions in a `Recent` [bytes]. If they exceed it, the predictions that were requested
longest ago are removed."""


@dataclass(frozen=True)
class Memory:
    """Store of arrays in files, so that a search that was stopped need not compute the arrays again.

    The files hold arrays with checksums. Reading a file runs no code, and a damaged file is computed again.

    Parameters
    ----------
    folder : Path, optional
        Folder of the results; the folder FOLDER is created in it. If it is None, nothing is stored.
    key : str
        Digest of the code on which the arrays depend. Arrays that were stored with another key are not used.
    """

    folder: Path | None = None
    key: str = ""

    def cached_arrays(self, request: tuple[Any, ...], make: Callable[[], Arrays]) -> Arrays:
        """Return the arrays that are stored for a request; if none are stored, compute and store them.

        Parameters
        ----------
        request : tuple
            Everything on which the arrays depend, as values that `digest` accepts.
        make : callable
            Function that computes the arrays.
        """
        if self.folder is None:
            return make()
        # The name of the file holds the digest, so that other code or another request finds no file.
        file = self.folder / FOLDER / f"{digest(self.key, request)}.npz"
        with suppress(OSError, ValueError):  # there is no file, or it is damaged
            return arrays(file)
        # The file is written as a whole, so that a stop while writing leaves no damaged file.
        new_arrays, content = make(), io.BytesIO()
        np.savez(content, **new_arrays)  # type: ignore[arg-type]
        replace_file(file, content.getvalue())
        return new_arrays

    @property
    def status(self) -> str:
        """A sentence on the number of stored files and their folder; empty if nothing is stored."""
        count = len(self._files())
        return f"{count} finished steps are kept in {self.folder}/{FOLDER}" if count else ""

    @contextmanager
    def noting(self) -> Iterator[None]:
        """Add a note on how to continue to the exception if KeyboardInterrupt or SystemExit stops the work in this
        `with` block.

        The note states that a repetition of the command continues from the stored files.
        """
        try:
            yield
        except (KeyboardInterrupt, SystemExit) as stop:
            if self.status:
                stop.add_note(f"{self.status}: run the same command again to continue")
            raise

    def remove_files(self) -> None:
        """Remove the stored files at the end of the work, and also their folder if it holds no other files."""
        for file in self._files():
            file.unlink(missing_ok=True)
        if self.folder is not None and (self.folder / FOLDER).is_dir() and not any((self.folder / FOLDER).iterdir()):
            (self.folder / FOLDER).rmdir()

    def _files(self) -> list[Path]:
        """Return the paths of the files with stored arrays."""
        return [] if self.folder is None else list((self.folder / FOLDER).glob("*.npz"))


class Recent:
    """A cache, in memory, of the predictions that were requested most recently. Each is found by a digest of everything
    on which it depends.

    The returned arrays are shared and read-only.

    Parameters
    ----------
    room : int
        Maximum total size of the stored predictions [bytes].
    """

    def __init__(self, room: int = MAX_RECENT_BYTES):
        self.room = room
        self._known: OrderedDict[str, np.ndarray] = OrderedDict()
        self._size = 0

    def of(self, keys: Sequence[str], make: Callable[[list[int]], Sequence[np.ndarray]]) -> list[np.ndarray]:
        """Return the prediction for each key. Only predictions that are not stored are computed.

        Parameters
        ----------
        keys : sequence of str
            Digests of the requested predictions.
        make : callable
            Function that computes the missing predictions, given their indices in `keys`.
        """
        # A key may occur twice in one request; it is computed once.
        missing = [index for index, key in enumerate(keys) if key not in self._known and key not in keys[:index]]
        new_predictions = dict(zip([keys[index] for index in missing], make(missing) if missing else (), strict=True))
        predictions = [new_predictions[key] if key in new_predictions else self._known[key] for key in keys]
        for key, prediction in zip(keys, predictions, strict=True):
            if key in self._known:
                self._known.move_to_end(key)
                continue
            prediction.flags.writeable = False
            self._known[key] = prediction
            self._size += prediction.nbytes
            # The prediction that was requested longest ago is at the beginning.
            while self._size > self.room:
                self._size -= self._known.popitem(last=False)[1].nbytes
        return predictions


def digest(*values: Any) -> str:
    """Return a digest of the content of some values as 32 hexadecimal digits. Results that depend on these values are
    found by the digest.

    Values may be records, arrays, numbers, text, rovers, and sequences and mappings of them. Equal content gives an
    equal digest in every process.
    """
    hasher = hashlib.sha256()
    _feed(hasher, values)
    return hasher.hexdigest()[:32]


def _feed(hasher: Any, value: Any) -> None:
    """Add the content of a value, together with its type and its length or shape, to a hash."""
    # Type and length are part of the content, so that different values that print alike have different digests.
    if isinstance(value, np.ndarray):
        hasher.update(f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Rover):
        hasher.update(_rover_digest(value))
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
def _rover_digest(rover: Rover) -> bytes:
    """Return a digest of a rover's description and of its Pinocchio model.

    The digest is computed once for each rover object, because a rover is large and does not change during a loop.
    """
    # A Pinocchio model is no record, but can write itself as text.
    parts = {field.name: getattr(rover, field.name) for field in dataclasses.fields(rover)}
    model: pin.Model = parts.pop("model")
    return digest(model.saveToString(), parts).encode()
