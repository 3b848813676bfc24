"""Tables in .mat files: vectors of one length, also inside structs; read by scipy, h5py not needed for version 5."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rover_pin.base.errors import DataError
from rover_pin.base.files.bounded import content


def mat_table(path: Path) -> pd.DataFrame:
    """Return the vectors of the commonest length in a .mat file, matrices by their columns.

    Raises
    ------
    DataError
        It cannot be read, is of version 7.3 (HDF5), or holds no vectors.
    """
    from scipy.io import loadmat

    try:
        variables = loadmat(io.BytesIO(content(path)), squeeze_me=True, struct_as_record=False)
    except NotImplementedError as error:
        raise DataError(f"{path}: a .mat of version 7.3 is not read: save it with '-v7', or as CSV.") from error
    except Exception as error:  # whatever scipy raises for bytes that are no .mat
        raise DataError(f"{path}: the file is no .mat that can be read: {error}".rstrip(". \n") + ".") from error
    vectors = dict(_vectors("", {name: value for name, value in variables.items() if not name.startswith("__")}))
    lengths = Counter(len(values) for values in vectors.values() if len(values) > 1)
    if not lengths:
        raise DataError(f"{path}: there is no vector of numbers in it: save one variable a channel.")
    length = lengths.most_common(1)[0][0]
    return pd.DataFrame({name: values for name, values in vectors.items() if len(values) == length})


def _vectors(prefix: str, table: dict[str, Any]) -> Iterator[tuple[str, np.ndarray]]:
    for key, value in table.items():
        name = f"{prefix}.{key}" if prefix else key
        if hasattr(value, "_fieldnames"):
            yield from _vectors(name, {field: getattr(value, field) for field in value._fieldnames})
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
            yield from _columns(name, value)


def _columns(name: str, value: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    if value.ndim == 1:
        yield name, value.astype(float)
    elif value.ndim == 2:
        long = value if value.shape[0] >= value.shape[1] else value.T
        yield from ((f"{name} {at}", column.astype(float)) for at, column in enumerate(long.T, 1))
