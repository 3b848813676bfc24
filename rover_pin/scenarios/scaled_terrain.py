"""Terrains made for Nexus 6's wheels, for another rover's: what is a length grows with its wheels."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from rover_pin.base.arguments import arguments_of
from rover_pin.terrain.terrain import Terrain

POWERS = {"m": 1, "rad/m": -1}
"""Power of a length in the units of a terrain's arguments."""


def scaled(terrain: Callable[..., Terrain], arguments: Mapping[str, Any], size: float) -> dict[str, Any]:
    """Return the arguments of a terrain for wheels `size` times as large as those that it is made for.

    An argument's unit says whether it is a length. What is no argument (`field` has its own distances) grows by the
    argument `size`, where there is one.
    """
    if size == 1.0:
        return dict(arguments)
    units = {name: argument.quantity.unit for name, argument in arguments_of(terrain).items()}
    parameters = inspect.signature(terrain).parameters
    defaults = {
        name: parameter.default
        for name, parameter in parameters.items()
        if parameter.default is not inspect.Parameter.empty
    }
    return {
        name: _scaled(value, _power(name, units.get(name, "")), size)
        for name, value in {**defaults, **arguments}.items()
    }


def _power(name: str, unit: str) -> int:
    return 1 if name == "size" else POWERS.get(unit, 0)


def _scaled(value: Any, power: int, size: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_scaled(element, power, size) for element in value)
    return value if power == 0 else size**power * value
