"""Classes for a recording on one clock, for a possible interpretation of its columns, and for the source of a
channel.
"""

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rover_pin.base.files.column_names import Word, word
from rover_pin.base.formula import quote
from rover_pin.base.quantity import to_si
from rover_pin.logs.column_map import mapped_column
from rover_pin.simulation.trace.channels import unit_of

NOTHING: Mapping[str, np.ndarray] = MappingProxyType({})
Entry = dict[str, Any]
"""Source of one channel, as an entry of the table [columns] in drive.toml: a column with unit, scale and offset, or a
formula."""


class Guess(NamedTuple):
    """The source that was chosen for one channel of an imported drive log, with the reason and the probability of this
    choice.

    `target` is the name of the channel. `entry` is its source, as an entry of the table [columns] in drive.toml.
    """

    target: str
    entry: Entry
    why: str
    sure: bool = False
    """whether the recording itself states the source, by a column with the channel's name or with a clear name and a
    unit"""
    share: float = 1.0
    """probability that the source is right, summed over all interpretations of the columns that use this source"""


class Choice(NamedTuple):
    """One possible interpretation of the position, heading or wheel columns of a recording.

    `entries` holds the source of each channel, as an entry of the table [columns] in drive.toml.
    """

    entries: Mapping[str, Entry]
    weight: float
    """logarithm of the prior probability of this interpretation"""
    why: str
    sure: bool = False
    """whether the recording itself states this interpretation by the names and units of its columns"""
    turned: bool = False
    """for a position: whether z points down; for a heading: whether the angle counts clockwise"""
    free: bool = False
    """for wheel rates: whether the scale is unknown, as for encoder counts or motor rates before a gear"""


class Recording:
    """The rows of one file in order of time, as times and numbers of every column.

    Parameters
    ----------
    t : array (rows,)
        Time since the first row [s], increasing.
    table : DataFrame (rows, columns)
        The recorded numbers.
    helpers : mapping
        Name -> source of each helper column, which the user defined for use in other formulas.
    """

    def __init__(self, t: np.ndarray, table: pd.DataFrame, helpers: Mapping[str, Entry] = MappingProxyType({})):
        self.t, self.table, self.helpers = t, table, helpers

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """All columns by their name -> numbers (rows,), including the time `t_s` and the user's helper columns."""
        columns = {str(name): self.table[name].to_numpy(dtype=float) for name in self.table} | {"t_s": self.t}
        for name, entry in self.helpers.items():
            columns[name] = mapped_column(name, entry, columns, f"the column {name}")
        return columns

    def values(self, entry: Mapping[str, Any], target: str, derived: Mapping[str, np.ndarray] = NOTHING) -> np.ndarray:
        """Return the values of one channel in SI (rows,), computed from its source.

        Parameters
        ----------
        entry : mapping
            Source of the channel: a column or a formula, as an entry of the table [columns] in drive.toml.
        target : str
            Name of the channel, which states its SI unit.
        derived : mapping
            Channel -> values (rows,) that a formula may use in addition to the recorded columns.
        """
        return mapped_column(target, entry, {**self.columns, **derived, "t_s": self.t}, f"the column {target}")


def words_of(table: pd.DataFrame) -> tuple[Word, ...]:
    """Return the column names of a table, each split into its words and its unit."""
    return tuple(word(str(name)) for name in table.columns)


def column(word: Word, unit: str = "", **more: float) -> Entry:
    """Return a source that takes the values of one column, as an entry of the table [columns] in drive.toml.

    `unit` is the unit of the values if the name of the column states no unit.

    Further keywords, such as `scale`, are added to the entry.
    """
    stated_unit = word.unit or unit
    return {"column": word.name, **({"unit": stated_unit} if stated_unit else {}), **more}


def formula_of(target: str, entry: Mapping[str, Any]) -> str:
    """Return a source of a channel as a formula that gives SI units, in the form of the option --column."""
    if "formula" in entry:
        return str(entry["formula"])
    # Scale and unit become one factor, because a formula of --column has no unit of its own.
    unit, factor = entry.get("unit", ""), float(entry.get("scale", 1.0))
    factor *= to_si(1.0, unit, unit_of(target), target) if unit else 1.0
    sign, size = "-" if factor < 0.0 else "", abs(factor)
    return f"{sign}{'' if size == 1.0 else f'{size:.6g} * '}{quote(str(entry['column']))}"
