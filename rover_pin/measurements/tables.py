"""Tables of measured points in files, CSV or Parquet, with every failure as one sentence."""

from __future__ import annotations

import io
from pathlib import Path

import pandas as pd

from rover_pin.bounded import MOST_TABLE, content
from rover_pin.columns import parquet_table
from rover_pin.errors import DataError, closest
from rover_pin.paths import is_file


def read_table(path: Path, required: tuple[str, ...]) -> pd.DataFrame:
    """Return a CSV or Parquet file as a table with at least one row and the `required` columns."""
    if not is_file(path):
        raise DataError(f"there is no file {path}; give the path of a CSV or Parquet file.")
    table = parquet_table(path).replace_schema_metadata(None).to_pandas() if path.suffix == ".parquet" else _csv(path)
    for name in required:
        if name not in table:
            meant = [each for each in table.columns if "_sd_" not in str(each)]
            said = closest(name, meant).replace("? ", f"? then call it '{name}' there. ", 1)
            raise DataError(f"{path} has no column '{name}': {said}")
    if table.empty:
        raise DataError(f"{path} has a header and no data; give at least one row.")
    return table


def _csv(path: Path) -> pd.DataFrame:
    try:
        return pd.read_csv(io.BytesIO(content(path, MOST_TABLE)), skipinitialspace=True)
    except pd.errors.EmptyDataError:
        raise DataError(f"{path} is empty; give a header line and one row a point.") from None
    except OSError as error:
        raise DataError(f"{path} cannot be read ({error.strerror or error}); give a CSV file.") from None
    except Exception as error:  # whatever pandas raises for text that is no table
        told = str(error).strip().partition("\n")[0]
        raise DataError(f"{path} cannot be read as CSV ({told}); give a CSV file.") from None
