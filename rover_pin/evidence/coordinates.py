"""Coordinates u in which a fit moves: logarithms where a parameter spans decades, scaled values elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from rover_pin.contact import Soil, Wheel
from rover_pin.errors import ParameterError, closest
from rover_pin.evidence.channel import FIELDS
from rover_pin.quantity import Quantity, quantities

DECADES = 1e-6
"""A logarithm whose bound is zero or negative stops at this share of where it starts."""

MOST_EXIT = 0.99
"""Greatest exit ratio of a fit: at 1 the stress ends on a second singularity, where derivatives jump."""

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
    about: Quantity
    coordinate: Coordinate
    low: float
    "lower bound of u"
    high: float
    "upper bound of u"


@dataclass(frozen=True, eq=False)
class Space:
    """The free parameters among `FIELDS`; the others keep the values of `base`."""

    axes: tuple[Axis, ...]
    base: np.ndarray

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
        u = [axis.coordinate.u(self.base[FIELDS.index(axis.name)]) for axis in self.axes]
        return np.clip(u, self.low, self.high)

    def values(self, u: np.ndarray) -> np.ndarray:
        """Return the free parameters' values, held inside their bounds against rounding."""
        found = [axis.coordinate.value(x) for axis, x in zip(self.axes, u, strict=True)]
        return np.clip(found, [axis.about.low for axis in self.axes], [axis.about.high for axis in self.axes])

    def slopes(self, u: np.ndarray) -> np.ndarray:
        """Return d value / d u of the free parameters."""
        return np.array([axis.coordinate.slope(x) for axis, x in zip(self.axes, u, strict=True)])

    def fields(self, u: np.ndarray) -> np.ndarray:
        """Return the values of all `FIELDS`."""
        fields = self.base.copy()
        fields[[FIELDS.index(name) for name in self.names]] = self.values(u)
        return fields


def space(free: tuple[str, ...], wheel: Wheel, soil: Soil) -> Space:
    """Return the space of the `free` parameters around a wheel and a soil.

    Raises
    ------
    ParameterError
        An unknown or repeated name (the message lists the close ones), none at all, or a pressure that is not positive.
    """
    known = quantities(Wheel) | quantities(soil)
    for name in free:
        if name not in known:
            raise ParameterError(f"no parameter '{name}' can be free: {closest(name, known)}")
    if not free or len(set(free)) < len(free):
        raise ParameterError(f"free = {tuple(free)!r} must name one parameter or more, each once.")
    base = {**wheel.values(), **soil.values()}
    axes = tuple(_axis(name, known[name], base, free) for name in free)
    return Space(axes, np.array([float(base[name]) for name in FIELDS]))


def _axis(name: str, about: Quantity, base: dict[str, float], free: tuple[str, ...]) -> Axis:
    if name in ("k_1", "k_2"):
        return _modulus_axis(name, about, base, free)
    value = float(base[name])
    if about.low > 0:
        return _log_axis(name, about, value, 0.0)
    span = about.high - about.low
    scale = min(span / 4, max(abs(value), 1e-3 * span))
    return _linear_axis(name, about, scale, span / 4)


def _modulus_axis(name: str, about: Quantity, base: dict[str, float], free: tuple[str, ...]) -> Axis:
    """k_1 + k_2 b must be positive, each alone need not: where one is held, the logarithm is of the sum."""
    b = base["b"]
    modulus, share = base["k_1"] + base["k_2"] * b, 1.0 if name == "k_1" else 1 / b
    if modulus <= 0:
        raise ParameterError(f"k_1 + k_2 b = {modulus:g} Pa must be positive to fit {name}; start from a firmer soil.")
    if {"k_1", "k_2"} <= set(free):
        return _linear_axis(name, about, modulus * share / 2, modulus * share)
    return _log_axis(name, about, float(base[name]), modulus * share - base[name])


def _linear_axis(name: str, about: Quantity, scale: float, widest: float) -> Axis:
    coordinate = Linear(scale, widest / scale)
    high = MOST_EXIT if name == "exit_ratio" else about.high
    return Axis(name, about, coordinate, coordinate.u(about.low), coordinate.u(high))


def _log_axis(name: str, about: Quantity, value: float, shift: float) -> Axis:
    low = max(about.low + shift, DECADES * (value + shift))
    return Axis(name, about, Log(shift), math.log(low), math.log(about.high + shift))
