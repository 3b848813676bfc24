"""Read a table of measured points as arrays with one entry for each fold. A fold is a group of rows that is held out of
a fit together.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rover_pin.base.files.table import measured_points
from rover_pin.measurements.checks import column


def read_folded(path: Path, by: str, names: tuple[str, ...]) -> tuple[tuple[str, ...], np.ndarray]:
    """Read a table of measured points, and return the names of its folds and its columns as one array (folds, columns,
    samples).

    A fold is a group of rows that is held out of a fit together. Folds with fewer rows than others are padded with NaN.

    Parameters
    ----------
    path : Path
        The CSV or Parquet file with the table.
    by : str
        The column that names the fold of each row.
    names : tuple of str
        The columns of numbers, in the order of the returned arrays.

    Raises
    ------
    DataError
        The file or a column is missing, or a value is not a finite number.
    """
    table = measured_points(path, (by, *names), (by,))
    rows = np.array([column(table[name], name, str(path)) for name in names])
    # np.unique sorts the names, so the folds are in alphabetical order and not in the order of the rows.
    folds, owner = np.unique(table[by].astype(str).to_numpy(dtype=object).astype(str), return_inverse=True)
    # A rectangular array needs folds of equal length, so shorter folds are filled with NaN, which no fit counts.
    padded_table = np.full((len(folds), len(names), int(np.bincount(owner).max())), np.nan)
    for at in range(len(folds)):
        part = rows[:, owner == at]
        padded_table[at, :, : part.shape[1]] = part
    return tuple(map(str, folds)), padded_table


def stack(parts: Sequence[tuple[np.ndarray, Sequence[int]]], channels: int, empty: float) -> np.ndarray:
    """Join several tables (..., folds, rows, samples) along the folds into one table (..., folds, channels, samples).

    Parameters
    ----------
    parts : sequence of (array, channels)
        Each table, with the indices of the channels that its rows hold. The folds of a table follow the folds of the
        previous table.
    channels : int
        Number of channels of the joined table.
    empty : float
        Value of the cells of the joined table that none of the given tables fills.
    """
    # The result is as long as the longest of the tables.
    samples = max(table.shape[-1] for table, _ in parts)
    padded_tables = []
    for table, rows in parts:
        padded_table = np.full((*table.shape[:-2], channels, samples), empty)
        padded_table[..., rows, : table.shape[-1]] = table
        padded_tables.append(padded_table)
    return np.concatenate(padded_tables, axis=-3)
