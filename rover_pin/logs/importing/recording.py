"""One file of a recording on one clock, and what a choice among its readings is."""

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.formula import quote
from rover_pin.base.quantity import to_si
from rover_pin.logs.column_map import mapped_column
from rover_pin.logs.importing.column_names import Word, word
from rover_pin.simulation.trace.channels import unit_of

NOTHING: Mapping[str, np.ndarray] = MappingProxyType({})
Entry = dict[str, Any]


class Guess(NamedTuple):
    """What a column of a drive log is made of: an entry of [columns], why, and how sure that is."""

    target: str
    entry: Entry
    why: str
    sure: bool = False
    "whether the file says so itself, by a drive log's own name or by a name and its unit"
    share: float = 1.0
    "of all readings that agree on it"


class Choice(NamedTuple):
    """One way to read a part of a recording: entries of [columns], the logarithm of its prior, and why."""

    entries: Mapping[str, Entry]
    weight: float
    why: str
    sure: bool = False
    turned: bool = False
    "a place seen in a mirror (z down), or an angle counted clockwise"
    free: bool = False
    "whether its scale is unknown, as of counts or behind a gear"


class Recording:
    """Rows of a file whose clock runs ahead: seconds from the begin, and the numbers of every column."""

    def __init__(self, t: np.ndarray, table: pd.DataFrame, helpers: Mapping[str, Entry] = MappingProxyType({})):
        self.t, self.table, self.helpers = t, table, helpers

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """The numbers by the names of the columns."""
        columns = {str(name): self.table[name].to_numpy(dtype=float) for name in self.table} | {"t_s": self.t}
        for name, entry in self.helpers.items():
            columns[name] = mapped_column(name, entry, columns, f"the column {name}")
        return columns

    def values(self, entry: Mapping[str, Any], target: str, derived: Mapping[str, np.ndarray] = NOTHING) -> np.ndarray:
        """Return what an entry makes of the recording, and of columns that were `derived` from it before [SI]."""
        return mapped_column(target, entry, {**self.columns, **derived, "t_s": self.t}, f"the column {target}")


def words_of(table: pd.DataFrame) -> tuple[Word, ...]:
    """Return the names of a table's columns taken apart."""
    return tuple(word(str(name)) for name in table.columns)


def column(word: Word, unit: str = "", **more: float) -> Entry:
    """Return an entry that takes a column as it is, in the unit that its name tells, or in this one."""
    stated_unit = word.unit or unit
    return {"column": word.name, **({"unit": stated_unit} if stated_unit else {}), **more}


def formula_of(target: str, entry: Mapping[str, Any]) -> str:
    """Return an entry as the formula that --column takes."""
    if "formula" in entry:
        return str(entry["formula"])
    unit, factor = entry.get("unit", ""), float(entry.get("scale", 1.0))
    factor *= to_si(1.0, unit, unit_of(target), target) if unit else 1.0
    sign, size = "-" if factor < 0.0 else "", abs(factor)
    return f"{sign}{'' if size == 1.0 else f'{size:.6g} * '}{quote(str(entry['column']))}"
