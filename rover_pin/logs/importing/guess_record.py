"""One guess: what a column of a drive log is made of, why that is thought, and whether it is certain."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from rover_pin.logs.column_map import mapped_column
from rover_pin.logs.importing.words import Word, word
from rover_pin.rover.rover import Rover

NOTHING: Mapping[str, np.ndarray] = MappingProxyType({})


class Guess(NamedTuple):
    """What a column of a drive log is made of: an entry of [columns], and why."""

    target: str
    entry: dict[str, Any]
    why: str
    sure: bool = False
    "whether the file says so itself, by a drive log's own name or by a name and its unit"


class Recording(NamedTuple):
    """A recording whose clock is found, with the rover that drove it."""

    t: np.ndarray
    "seconds from its begin"
    table: pd.DataFrame
    rover: Rover
    words: tuple[Word, ...]
    "of the columns that are not the clock's"

    def values(self, entry: Mapping[str, Any], target: str, derived: Mapping[str, np.ndarray] = NOTHING) -> np.ndarray:
        """Return what an entry makes of the recording, and of columns that were `derived` from it before [SI]."""
        columns = {str(name): self.table[name].to_numpy(dtype=float) for name in self.table} | {
            **derived,
            "t_s": self.t,
        }
        return mapped_column(target, entry, columns, f"the column {target}")

    def best(self, score: Callable[[Word], float]) -> Word | None:
        """Return the column that scores highest above 0; of equals the first."""
        scored = [(score(word), -at, word) for at, word in enumerate(self.words)]
        top = max(scored, default=(0.0, 0, None))
        return top[2] if top[0] > 0.0 else None


def recording(t: np.ndarray, table: pd.DataFrame, clock: str, rover: Rover) -> Recording:
    """Return a recording of a table whose column `clock` became the seconds `t`."""
    return Recording(t, table, rover, tuple(word(str(name)) for name in table.columns if name != clock))


def column(word: Word, unit: str = "", **more: float) -> dict[str, Any]:
    """Return an entry that takes a column as it is, in the unit that its name tells, or in this one."""
    stated_unit = word.unit or unit
    return {"column": word.name, **({"unit": stated_unit} if stated_unit else {}), **more}
