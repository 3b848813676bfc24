"""The coordinates of a wheel's and a soil's constants: logarithms where one spans decades, scaled values elsewhere."""

from __future__ import annotations

import math

import numpy as np

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.quantity import Quantity, quantities
from rover_pin.contact import Soil, Wheel
from rover_pin.estimation.coordinates import Axis, Linear, Log, Space
from rover_pin.measurements.channel import FIELDS

DECADES = 1e-6
"""A logarithm whose bound is zero or negative stops at this share of where it starts."""

MAX_EXIT_RATIO = 0.99
"""Greatest exit ratio of a fit: at 1 the stress ends on a second singularity, where derivatives jump."""


def space(free: tuple[str, ...], wheel: Wheel, soil: Soil) -> Space:
    """Return the space of the `free` parameters around a wheel and a soil.

    Raises
    ------
    ParameterError
        An unknown or repeated name (the message lists the close ones), none at all, or a pressure that is not positive.
    """
    parameters = quantities(Wheel) | quantities(soil)
    for name in free:
        if name not in parameters:
            raise ParameterError(f"no parameter '{name}' can be free: {closest(name, parameters)}")
    if not free or len(set(free)) < len(free):
        raise ParameterError(f"free = {tuple(free)!r} must name one parameter or more, each once.")
    base = {**wheel.values(), **soil.values()}
    axes = tuple(_axis(name, parameters[name], base, free) for name in free)
    return Space(axes, np.array([float(base[name]) for name in FIELDS]), FIELDS)


def _axis(name: str, quantity: Quantity, base: dict[str, float], free: tuple[str, ...]) -> Axis:
    if name in ("k_1", "k_2"):
        return _modulus_axis(name, quantity, base, free)
    value = float(base[name])
    if quantity.low > 0:
        return _log_axis(name, quantity, value, 0.0)
    span = quantity.high - quantity.low
    scale = min(span / 4, max(abs(value), 1e-3 * span))
    return _linear_axis(name, quantity, scale, span / 4)


def _modulus_axis(name: str, quantity: Quantity, base: dict[str, float], free: tuple[str, ...]) -> Axis:
    """k_1 + k_2 b must be positive, each alone need not: where one is held, the logarithm is of the sum."""
    b = base["b"]
    modulus, share = base["k_1"] + base["k_2"] * b, 1.0 if name == "k_1" else 1 / b
    if modulus <= 0:
        raise ParameterError(f"k_1 + k_2 b = {modulus:g} Pa must be positive to fit {name}; start from a firmer soil.")
    if {"k_1", "k_2"} <= set(free):
        return _linear_axis(name, quantity, modulus * share / 2, modulus * share)
    return _log_axis(name, quantity, float(base[name]), modulus * share - base[name])


def _linear_axis(name: str, quantity: Quantity, scale: float, widest: float) -> Axis:
    coordinate = Linear(scale, widest / scale)
    low, high = (0.0, MAX_EXIT_RATIO) if name == "exit_ratio" else (quantity.low, quantity.high)
    return Axis(name, quantity, coordinate, coordinate.u(low), coordinate.u(high))


def _log_axis(name: str, quantity: Quantity, value: float, shift: float) -> Axis:
    low = max(quantity.low + shift, DECADES * (value + shift))
    return Axis(name, quantity, Log(shift), math.log(low), math.log(quantity.high + shift))
