"""Predictions of a moment ago: fits ask again at their start, in the middle of slopes, after a step back."""

from collections import OrderedDict
from collections.abc import Callable, Sequence

import numpy as np

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
