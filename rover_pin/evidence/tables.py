"""CSV, Parquet and TOML files in, with every failure as one sentence."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow
import pyarrow.parquet

from rover_pin.errors import DataError, closest


def read_table(path: Path, required: tuple[str, ...]) -> pd.DataFrame:
    """Return a CSV or Parquet file as a table with at least one row and the `required` columns."""
    read, kind = (_parquet, "Parquet") if path.suffix == ".parquet" else (_csv, "CSV")
    try:
        table = read(path)
    except FileNotFoundError:
        raise DataError(f"there is no file {path}; give the path of a CSV or Parquet file.") from None
    except pd.errors.EmptyDataError:
        raise DataError(f"{path} is empty; give a header line and one row a point.") from None
    except (OSError, UnicodeDecodeError, pd.errors.ParserError, pyarrow.ArrowInvalid) as error:
        told = str(error).strip().partition("\n")[0]
        raise DataError(f"{path} cannot be read as {kind} ({told}); give a {kind} file.") from None
    for name in required:
        if name not in table:
            raise DataError(f"{path} has no column '{name}': {closest(name, map(str, table.columns))}")
    if table.empty:
        raise DataError(f"{path} has a header and no data; give at least one row.")
    return table


def _csv(path: Path) -> pd.DataFrame:
    return pd.read_csv(path, skipinitialspace=True)


def _parquet(path: Path) -> pd.DataFrame:
    return pyarrow.parquet.read_table(pyarrow.BufferReader(path.read_bytes())).to_pandas()


def read_toml(path: Path) -> dict[str, Any]:
    """Return a TOML file as a dictionary."""
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except FileNotFoundError:
        raise DataError(f"there is no file {path}; a data set is a folder with that file in it.") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise DataError(f"{path} cannot be read as TOML ({error}).") from None
