"""A table of points as folds: arrays (folds, columns, samples), the folds named by one of its columns."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rover_pin.base.files.table import measured_points
from rover_pin.measurements.checks import column


def read_folded(path: Path, by: str, names: tuple[str, ...]) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the names of a table's folds, and these columns (folds, columns, samples), NaN behind a fold's end.

    Raises DataError: no such file or column, or a value that is no finite number: one sentence.
    """
    table = measured_points(path, (by, *names), (by,))
    rows = np.array([column(table[name], name, str(path)) for name in names])
    folds, owner = np.unique(table[by].astype(str).to_numpy(dtype=object).astype(str), return_inverse=True)
    padded_table = np.full((len(folds), len(names), int(np.bincount(owner).max())), np.nan)
    for at in range(len(folds)):
        part = rows[:, owner == at]
        padded_table[at, :, : part.shape[1]] = part
    return tuple(map(str, folds)), padded_table


def stack(parts: Sequence[tuple[np.ndarray, Sequence[int]]], channels: int, empty: float) -> np.ndarray:
    """Return tables (..., folds, rows, samples) as one of this many channels, `empty` where a part has none.

    Each comes with the channels of its rows.
    """
    samples = max(table.shape[-1] for table, _ in parts)
    padded_tables = []
    for table, rows in parts:
        padded_table = np.full((*table.shape[:-2], channels, samples), empty)
        padded_table[..., rows, : table.shape[-1]] = table
        padded_tables.append(padded_table)
    return np.concatenate(padded_tables, axis=-3)
