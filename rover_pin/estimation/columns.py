"""Columns of a linear function: each column holds the change of the whitened residuals per unit of one coefficient.

The coefficients are shared by all residuals, or each run has its own coefficients.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

MIN_IDENTIFIABLE_SHARE = 1e-3
"""Minimum ratio of a singular value to the largest one. Below this value, the direction of the singular value in the
space of the columns is dropped.

The size of such a direction would be mostly rounding noise. 1e-3 is far above the rounding of derivatives by finite
differences, and far below every direction that data determine."""


class Columns(NamedTuple):
    """A linear function that changes n whitened residuals by C v, where C (n, k) are its columns and v are k
    coefficients.

    If each run has its own coefficients, they change only the residuals of this run. The whole matrix then has k
    columns for each run, and is block-diagonal.
    """

    values: np.ndarray
    runs: tuple[slice, ...]
    """slice of the residuals of each run, if each run has its own coefficients; otherwise one slice that holds all
    residuals"""

    @property
    def width(self) -> int:
        """Number of coefficients of the function: k, or k times the number of runs if each run has its own
        coefficients.
        """
        return int(self.values.shape[1]) * len(self.runs)

    def normal(self, w: np.ndarray) -> np.ndarray:
        """Return the weighted normal matrix C^T diag(w) C (width, width) of the columns C, for weights w (n,) of the
        residuals.
        """
        return np.asarray(block_diag(*(part.T @ (w[run, None] * part) for run, part in self._parts)))

    def across(self, table: np.ndarray) -> np.ndarray:
        """Return the product table^T C (..., width) of a table (n, ...) and the columns C (n, width), for example the
        table of other columns.
        """
        return np.concatenate([table[run].T @ part for run, part in self._parts], axis=-1)

    def times(self, size: np.ndarray) -> np.ndarray:
        """Return the change C v (n,) of the whitened residuals for the coefficients v = `size` (width,)."""
        # Each run takes its own k coefficients from the long vector, in the order of the runs.
        amplitudes_by_run = np.split(size, len(self.runs))
        return np.concatenate(
            [part @ run_amplitudes for (_, part), run_amplitudes in zip(self._parts, amplitudes_by_run, strict=True)]
        )

    @property
    def _parts(self) -> list[tuple[slice, np.ndarray]]:
        return [(run, self.values[run]) for run in self.runs]


def no_columns(rows: int) -> Columns:
    """Return a function without coefficients, which changes none of its `rows` whitened residuals."""
    return Columns(np.zeros((rows, 0)), (slice(None),))
