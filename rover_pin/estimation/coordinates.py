"""Coordinates u in which a fit moves: logarithms where a parameter spans decades, scaled values elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from rover_pin.base.quantity import Quantity

RATIO = 4.0
"""A 95 % interval of a logarithm is called found up to this ratio of its ends."""


class Coordinate(Protocol):
    """One parameter's u."""

    @property
    def spread(self) -> float:
        """How far apart, in u, starts are scattered."""

    @property
    def widest(self) -> float:
        """Width in u up to which a 95 % interval still tells the parameter."""

    def u(self, value: float) -> float:
        """Return the coordinate of a value."""

    def value(self, u: float) -> float:
        """Return the value of a coordinate."""

    def slope(self, u: float) -> float:
        """Return d value / d u."""


@dataclass(frozen=True)
class Log:
    """u = ln(value + shift)."""

    shift: float = 0.0
    spread: float = math.log(5.0)
    widest: float = math.log(RATIO)

    def u(self, value: float) -> float:
        """Return ln(value + shift)."""
        return math.log(value + self.shift)

    def value(self, u: float) -> float:
        """Return e^u - shift."""
        return math.exp(u) - self.shift

    def slope(self, u: float) -> float:
        """Return e^u."""
        return math.exp(u)


@dataclass(frozen=True)
class Linear:
    """u = value / scale: the scale is how far starts are scattered."""

    scale: float
    widest: float
    spread: float = 1.0

    def u(self, value: float) -> float:
        """Return value / scale."""
        return value / self.scale

    def value(self, u: float) -> float:
        """Return u times the scale."""
        return u * self.scale

    def slope(self, u: float) -> float:
        """Return the scale."""
        return self.scale


class Axis(NamedTuple):
    """One free parameter."""

    name: str
    quantity: Quantity
    coordinate: Coordinate
    low: float
    "lower bound of u"
    high: float
    "upper bound of u"


@dataclass(frozen=True, eq=False)
class Space:
    """The free parameters among `all_names`; the others keep the values of `base`."""

    axes: tuple[Axis, ...]
    base: np.ndarray
    all_names: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        return tuple(axis.name for axis in self.axes)

    @property
    def low(self) -> np.ndarray:
        """Lower bounds of u."""
        return np.array([axis.low for axis in self.axes])

    @property
    def high(self) -> np.ndarray:
        """Upper bounds of u."""
        return np.array([axis.high for axis in self.axes])

    def start(self) -> np.ndarray:
        """Return u of the base values, inside the bounds."""
        u = [axis.coordinate.u(self.base[self.all_names.index(axis.name)]) for axis in self.axes]
        return np.clip(u, self.low, self.high)

    def values(self, u: np.ndarray) -> np.ndarray:
        """Return the free parameters' values, held inside their bounds against rounding."""
        raw_values = [axis.coordinate.value(x) for axis, x in zip(self.axes, u, strict=True)]
        return np.clip(
            raw_values, [axis.quantity.low for axis in self.axes], [axis.quantity.high for axis in self.axes]
        )

    def slopes(self, u: np.ndarray) -> np.ndarray:
        """Return d value / d u of the free parameters."""
        return np.array([axis.coordinate.slope(x) for axis, x in zip(self.axes, u, strict=True)])

    def fields(self, u: np.ndarray) -> np.ndarray:
        """Return the values of all that are known."""
        fields = self.base.copy()
        fields[[self.all_names.index(name) for name in self.names]] = self.values(u)
        return fields
