"""Tables of numbers in files, with the place of whatever is wrong."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError, closest
from rover_pin.base.files.table import read_table


class Columns(NamedTuple):
    """The columns of a file; an empty cell is NaN."""

    path: Path
    values: dict[str, np.ndarray]
    places: tuple[str, ...]
    "where each row stands, as 'line 7' of a text file or 'row 6'"

    def need(self, *names: str) -> tuple[np.ndarray, ...]:
        """Return these columns; the first that is missing is an error."""
        for name in names:
            if name not in self.values:
                raise DataError(f"{self.path}: there is no column '{name}': {closest(name, self.values)}")
        return tuple(self.values[name] for name in names)

    def refuse_gaps(self, *names: str) -> None:
        """Refuse a number that is missing or not finite in these columns."""
        for name in names:
            bad = np.flatnonzero(~np.isfinite(self.values[name]))
            if bad.size:
                value = self.values[name][bad[0]]
                raise DataError(
                    f"{self.path}, {self.places[bad[0]]}: column '{name}' is {value:g}; "
                    "every row needs a finite number there."
                )

    def refuse_steps_back(self, name: str) -> None:
        """Refuse a column that does not increase from row to row."""
        back = np.flatnonzero(np.diff(self.values[name]) <= 0.0)
        if back.size:
            before, value = self.values[name][back[0] : back[0] + 2]
            raise DataError(
                f"{self.path}, {self.places[back[0] + 1]}: column '{name}' must increase, but {value:.12g} follows "
                f"{before:.12g}: sort the rows and drop repeated ones."
            )


def read_columns(path: str | Path) -> Columns:
    """Return the columns of a table of numbers, in text of any layout or Parquet.

    Raises DataError: what `read_table` refuses, a row of another length, a name that stands there twice, or text where
    a number belongs.
    """
    table = read_table(Path(path))
    table.refuse_faults()
    return Columns(table.path, {name: table.numbers(name) for name in table.columns}, table.places)


def columns_text(values: dict[str, np.ndarray]) -> str:
    """Return columns of one length as comma-separated text, each number with the digits that bring it back exactly."""
    rows = zip(*(np.asarray(column, dtype=float).tolist() for column in values.values()), strict=True)
    return "\n".join([",".join(values), *(",".join(map(repr, row)) for row in rows)]) + "\n"
