"""Axes and plans of a batch study. An axis holds the values of one parameter; a plan chooses combinations of values."""

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import as_float

MAX_CASES = 1_000_000
"""Largest number of cases of a study, repeats included. A larger study is refused, because a million drives take days
and all cases are listed before the first one runs."""


class Axis(ABC):
    """The values that one parameter of a study may take: a range of numbers, or a list."""

    @abstractmethod
    def at(self, share: float) -> Any:
        """Return the value at the position `share` along the axis: 0 is the first value, and 1 is the last value."""

    @abstractmethod
    def levels(self, points: int) -> list[Any]:
        """Return the values of this axis in a grid: all values of a list, or `points` values of a range."""


@dataclass(frozen=True)
class Range(Axis):
    """The values of a parameter from `low` to `high`, evenly spaced.

    Raises ParameterError if an end is not a finite number, or if `low` is not below `high`.

    Example: `Range(0.01, 0.05).levels(3)` gives 0.01, 0.03 and 0.05.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        # Both ends must be numbers before they are compared.
        for name in ("low", "high"):
            value = getattr(self, name)
            if kind_of(value) != "number":
                raise ParameterError(f"{name} = {value!r} is not allowed: the end of a range must be a finite number.")
        if not self.low < self.high:
            raise ParameterError(
                f"the range from {self.low:g} to {self.high:g} is empty: low must be below high. "
                "To give a parameter a single value, write it under the settings."
            )

    def at(self, share: float) -> float:
        """Return the number at the position `share` of the range, from 0 (low) to 1 (high), by linear interpolation."""
        return (1.0 - share) * self.low + share * self.high

    def levels(self, points: int) -> list[Any]:
        """Return `points` evenly spaced numbers of the range for a grid, both ends included."""
        return [self.at(i / (points - 1)) for i in range(points)]


@dataclass(frozen=True)
class LogRange(Range):
    """The positive values of a parameter from `low` to `high`, whose logarithms are evenly spaced.

    Raises ParameterError if an end is not a positive finite number, or if `low` is not below `high`.

    Example: `LogRange(1e-3, 1e-1).levels(3)` gives 0.001, 0.01 and 0.1.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low <= 0.0:
            raise ParameterError(f"low = {self.low:g} is not allowed: a logarithmic range must start above 0.")

    def at(self, share: float) -> float:
        """Return the number at the position `share` of the range, from 0 (low) to 1 (high): low^(1 - share)
        high^share.
        """
        # At the ends the declared numbers themselves are returned. exp(log(x)) differs from x in the last digit.
        if share <= 0.0 or share >= 1.0:
            return self.high if share > 0.0 else self.low
        value = math.exp((1.0 - share) * math.log(self.low) + share * math.log(self.high))
        return min(max(value, self.low), self.high)


@dataclass(frozen=True)
class Values(Axis):
    """The values of a parameter as a list of numbers, texts or truth values.

    Raises ParameterError if the list is empty, if a value occurs twice, or if the values are not all numbers, all texts
    or all true/false.

    Example: `Values(["dry-sand", "table-1"])`.
    """

    values: Sequence[Any]

    def __post_init__(self) -> None:
        if isinstance(self.values, str) or not isinstance(self.values, Iterable):
            raise ParameterError(f"{self.values!r} is a single value: give a list of values.")
        object.__setattr__(self, "values", tuple(plain(value) for value in self.values))
        if not self.values:
            raise ParameterError("the list of values is empty: give at least one value.")
        # A column of the table has one type, so a list may not mix types.
        kinds = {kind_of(value) for value in self.values}
        if len(kinds) > 1 or None in kinds:
            raise ParameterError(
                f"the values {list(self.values)!r} are not allowed: give only finite numbers, only texts or only "
                "true/false."
            )
        if len(set(self.values)) < len(self.values):
            raise ParameterError(
                f"the values {list(self.values)!r} contain one value twice: remove it; to run a case several times, "
                "set repeats."
            )

    def at(self, share: float) -> Any:
        """Return the value at the position `share` from 0 to 1. Each value of the list covers an equal part of this
        interval.
        """
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def levels(self, points: int) -> list[Any]:
        """Return all values of the list for a grid; `points` is not used."""
        return list(self.values)


def plain(value: Any) -> Any:
    """Return a NumPy scalar as a Python scalar, and every other value unchanged."""
    return value.item() if isinstance(value, np.generic) else value


def kind_of(value: Any) -> str | None:
    """Return the type of a setting's value: 'truth', 'text' or 'number' (finite numbers only). For every other value
    the result is None.
    """
    if isinstance(value, bool):
        return "truth"
    if isinstance(value, str):
        return "text"
    return "number" if isinstance(value, (int, float)) and math.isfinite(as_float(value)) else None


Group = Mapping[str, Axis]
"""Parameters that change together, as name -> axis. A plan treats them as one dimension."""
Point = dict[str, Any]
"""One combination of parameter values: name of a parameter -> value."""


class Plan(ABC):
    """A rule that chooses the combinations of parameter values (points) at which a study runs."""

    @abstractmethod
    def choose(self, groups: Sequence[Group], seed: int) -> list[Point]:
        """Return the points at which a study runs.

        The points and their order depend on the groups and the seed only.
        """


@dataclass(frozen=True)
class Grid(Plan):
    """A plan with all combinations of values: all values of each list, and `points` values of each range. The last
    parameter varies fastest.

    Raises ParameterError if `points` is not a whole number of at least 2.
    """

    points: int = 5

    def __post_init__(self) -> None:
        _check_count("points", self.points, 2)

    def choose(self, groups: Sequence[Group], seed: int) -> list[Point]:
        """Return all combinations; `seed` is not used.

        Raises ParameterError if there are more than MAX_CASES combinations.
        """
        # The parameters of a group change together: the first level of a group has the first value of each of its
        # parameters.
        levels: list[list[Point]] = []
        for group in groups:
            columns = [axis.levels(self.points) for axis in group.values()]
            levels.append([dict(zip(group, values, strict=True)) for values in zip(*columns, strict=True)])
        # The size is checked before the product is made, because the list itself could fill the memory.
        size = math.prod(map(len, levels))
        if size > MAX_CASES:
            raise ParameterError(
                f"the grid has {size} points, more than {MAX_CASES}: give fewer points, or use a Sobol plan."
            )
        return [dict(itertools.chain(*(part.items() for part in parts))) for parts in itertools.product(*levels)]


@dataclass(frozen=True)
class LatinHypercube(Plan):
    """A plan with `cases` points in a Latin hypercube: if every axis is divided into `cases` equal parts, each part
    contains exactly one point.

    Raises ParameterError if `cases` is not a whole number of at least 1.

    Source: McKay, Beckman and Conover 1979, Technometrics 21(2); computed by scipy.stats.qmc.
    """

    cases: int

    def __post_init__(self) -> None:
        _check_count("cases", self.cases, 1)

    def choose(self, groups: Sequence[Group], seed: int) -> list[Point]:
        """Return the points of the Latin hypercube that is drawn with `seed`."""
        from scipy.stats import qmc

        return _points(groups, qmc.LatinHypercube(len(groups), seed=np.random.default_rng(seed)).random(self.cases))


@dataclass(frozen=True)
class Sobol(Plan):
    """A plan with the first `cases` points of a scrambled Sobol sequence, which fills the space of the parameters more
    evenly than random points.

    Raises ParameterError if `cases` is not a power of two: only then is the sequence balanced.

    Source: Sobol 1967, with the scrambling of Owen 1998; computed by scipy.stats.qmc.
    """

    cases: int

    def __post_init__(self) -> None:
        _check_count("cases", self.cases, 1)
        if self.cases & (self.cases - 1):
            below = 1 << (self.cases.bit_length() - 1)
            raise ParameterError(
                f"cases = {self.cases} is not allowed: a Sobol plan is balanced only for a power of two. "
                f"Use {below} or {2 * below}."
            )

    def choose(self, groups: Sequence[Group], seed: int) -> list[Point]:
        """Return the points of the Sobol sequence, scrambled with `seed`."""
        from scipy.stats import qmc

        return _points(groups, qmc.Sobol(len(groups), seed=np.random.default_rng(seed)).random(self.cases))


def _points(groups: Sequence[Group], shares: np.ndarray) -> list[Point]:
    """Return the combinations of parameter values for points of the unit cube (points, groups).

    Each coordinate of a point, from 0 to 1, is a position along the axes of one group.
    """
    return [
        {name: axis.at(share) for group, share in zip(groups, row, strict=True) for name, axis in group.items()}
        for row in shares.tolist()
    ]


def _check_count(name: str, value: Any, minimum: int) -> None:
    """Check that the argument `name` of a plan is a whole number from `minimum` to MAX_CASES.

    Raises ParameterError: the value is another one.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not minimum <= value <= MAX_CASES:
        raise ParameterError(f"{name} = {value!r} is not allowed: give a whole number from {minimum} to {MAX_CASES}.")
