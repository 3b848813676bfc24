"""What one parameter of a study goes through: a range, a logarithmic range or a list of values."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import as_float


class Axis(ABC):
    """The values that a parameter may take."""

    @abstractmethod
    def at(self, share: float) -> Any:
        """Return the value at `share` of the way, 0 the first and 1 the last."""

    @abstractmethod
    def levels(self, points: int) -> list[Any]:
        """Return the values of a grid: all of a list, `points` of a range."""


@dataclass(frozen=True)
class Range(Axis):
    """Numbers from `low` to `high`, spread evenly.

    Raises ParameterError: an end that is not a finite number, or `low` not below `high`.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            value = getattr(self, name)
            if kind_of(value) != "number":
                raise ParameterError(f"{name} = {value!r} is not allowed: the end of a range is a finite number.")
        if not self.low < self.high:
            raise ParameterError(
                f"the range from {self.low:g} to {self.high:g} is empty: low must be below high; "
                "for a single value use the settings."
            )

    def at(self, share: float) -> float:
        """Return (1 - share) low + share high."""
        return (1.0 - share) * self.low + share * self.high

    def levels(self, points: int) -> list[Any]:
        """Return `points` values with both ends."""
        return [self.at(i / (points - 1)) for i in range(points)]


@dataclass(frozen=True)
class LogRange(Range):
    """Numbers from `low` to `high`, both positive, whose logarithms are spread evenly."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low <= 0.0:
            raise ParameterError(f"low = {self.low:g} is not allowed: a logarithmic range starts above 0.")

    def at(self, share: float) -> float:
        """Return low^(1 - share) high^share, within the ends."""
        value = math.exp((1.0 - share) * math.log(self.low) + share * math.log(self.high))
        return min(max(value, self.low), self.high) if 0.0 < share < 1.0 else (self.low, self.high)[share > 0.0]


@dataclass(frozen=True)
class Values(Axis):
    """Numbers, texts or truth values, one after the other.

    Raises ParameterError: no value, one twice, values of several kinds, or of another kind than these.
    """

    values: Sequence[Any]

    def __post_init__(self) -> None:
        if isinstance(self.values, str) or not isinstance(self.values, Iterable):
            raise ParameterError(f"{self.values!r} is a single value: give a list of values.")
        object.__setattr__(self, "values", tuple(plain(value) for value in self.values))
        if not self.values:
            raise ParameterError("the list of values is empty: give at least one.")
        kinds = {kind_of(value) for value in self.values}
        if len(kinds) > 1 or None in kinds:
            raise ParameterError(
                f"the values {list(self.values)!r} are not of one kind: give all numbers, all texts or all true/false."
            )
        if len(set(self.values)) < len(self.values):
            raise ParameterError(f"the values {list(self.values)!r} name one twice: use repeats to run a case again.")

    def at(self, share: float) -> Any:
        """Return the value in whose equal part of [0, 1] `share` lies."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def levels(self, points: int) -> list[Any]:
        """Return all values."""
        return list(self.values)


def plain(value: Any) -> Any:
    """Return a NumPy scalar as the Python one, anything else as it is."""
    return value.item() if isinstance(value, np.generic) else value


def kind_of(value: Any) -> str | None:
    """Return 'truth', 'text' or 'number' (finite), or None for anything else."""
    if isinstance(value, bool):
        return "truth"
    if isinstance(value, str):
        return "text"
    return "number" if isinstance(value, (int, float)) and math.isfinite(as_float(value)) else None
