"""Whitened columns of a function that rows may have in common, or each fold for itself."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

IDENTIFIABLE_SHARE = 1e-3
"""Share of its size, or of the greatest, a square or a singular value, that a direction of columns must have left to be
identified; below is round-off, or none."""


class Columns(NamedTuple):
    """The whitened columns (n, k) of a function; where every run has its own numbers, run r's act on its rows."""

    values: np.ndarray
    runs: tuple[slice, ...]
    "the rows of each run that has its own numbers; all rows, once, where the runs share them"

    @property
    def width(self) -> int:
        """How many columns there are, those of each run counted."""
        return int(self.values.shape[1]) * len(self.runs)

    def normal(self, w: np.ndarray) -> np.ndarray:
        """Return C^T diag(w) C, C the whole columns."""
        return np.asarray(block_diag(*(part.T @ (w[run, None] * part) for run, part in self._parts)))

    def across(self, table: np.ndarray) -> np.ndarray:
        """Return table^T C of a table (n, ...)."""
        return np.concatenate([table[run].T @ part for run, part in self._parts], axis=-1)

    def times(self, size: np.ndarray) -> np.ndarray:
        """Return C size, one number a row."""
        amplitudes_by_run = np.split(size, len(self.runs))
        return np.concatenate(
            [part @ run_amplitudes for (_, part), run_amplitudes in zip(self._parts, amplitudes_by_run, strict=True)]
        )

    @property
    def _parts(self) -> list[tuple[slice, np.ndarray]]:
        return [(run, self.values[run]) for run in self.runs]


def no_columns(rows: int) -> Columns:
    """Return no columns at all, of a number of rows."""
    return Columns(np.zeros((rows, 0)), (slice(None),))
