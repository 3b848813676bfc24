"""Which points of the parameters' space a study visits."""

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.sweep.axis import Axis

Group = Mapping[str, Axis]
"""Parameters that move together: one direction of the plan."""
Point = dict[str, Any]
"""Parameter -> value."""
MOST_CASES = 1_000_000
"""Cases of a study, its repeats counted: a million drives take days, and all are listed beforehand."""


class Plan(ABC):
    """A way to choose points."""

    @abstractmethod
    def choose(self, groups: Sequence[Group], seed: int) -> list[Point]:
        """Return the points, in an order that depends on nothing else."""


@dataclass(frozen=True)
class Grid(Plan):
    """Every combination: all values of a list, `points` values of a range, the last parameter fastest."""

    points: int = 5

    def __post_init__(self) -> None:
        _check_count("points", self.points, 2)

    def choose(self, groups: Sequence[Group], seed: int) -> list[Point]:
        """Return the combinations; `seed` plays no part."""
        levels = [self._levels(group) for group in groups]
        size = math.prod(map(len, levels))
        if size > MOST_CASES:
            raise ParameterError(
                f"the grid has {size} points, more than {MOST_CASES}: give fewer points, or take a Sobol plan."
            )
        return [dict(itertools.chain(*(part.items() for part in parts))) for parts in itertools.product(*levels)]

    def _levels(self, group: Group) -> list[Point]:
        columns = [axis.levels(self.points) for axis in group.values()]
        return [dict(zip(group, values, strict=True)) for values in zip(*columns, strict=True)]


@dataclass(frozen=True)
class LatinHypercube(Plan):
    """`cases` points of which every parameter meets each of its `cases` equal parts once.

    Source: McKay, Beckman and Conover 1979, Technometrics 21(2); made by scipy.stats.qmc.
    """

    cases: int

    def __post_init__(self) -> None:
        _check_count("cases", self.cases, 1)

    def choose(self, groups: Sequence[Group], seed: int) -> list[Point]:
        """Return the points that `seed` gives."""
        from scipy.stats import qmc

        return _points(groups, qmc.LatinHypercube(len(groups), seed=np.random.default_rng(seed)).random(self.cases))


@dataclass(frozen=True)
class Sobol(Plan):
    """`cases` points, a power of two, of a scrambled Sobol sequence: more even than chance in all directions at once.

    Source: Sobol 1967, with the scrambling of Owen 1998; made by scipy.stats.qmc.
    """

    cases: int

    def __post_init__(self) -> None:
        _check_count("cases", self.cases, 1)
        if self.cases & (self.cases - 1):
            below = 1 << (self.cases.bit_length() - 1)
            raise ParameterError(
                f"cases = {self.cases} is not allowed: a Sobol plan is even only at a power of two; "
                f"use {below} or {2 * below}."
            )

    def choose(self, groups: Sequence[Group], seed: int) -> list[Point]:
        """Return the points that `seed` gives."""
        from scipy.stats import qmc

        return _points(groups, qmc.Sobol(len(groups), seed=np.random.default_rng(seed)).random(self.cases))


def _points(groups: Sequence[Group], shares: np.ndarray) -> list[Point]:
    return [
        {name: axis.at(share) for group, share in zip(groups, row, strict=True) for name, axis in group.items()}
        for row in shares.tolist()
    ]


def _check_count(name: str, value: Any, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= MOST_CASES:
        raise ParameterError(f"{name} = {value!r} is not allowed: it is a whole number from {least} to {MOST_CASES}.")
