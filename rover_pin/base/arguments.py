"""Function arguments whose unit, bounds and source are stated in the annotation, and a decorator that checks their
values.

@check_arguments("terrain")
def bump(height: Annotated[float, spec("m", "assumed", -100.0, 100.0)] = 0.04) -> Lanes: ...
"""

import functools
import inspect
import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple, ParamSpec, TypeVar, get_args, get_origin, get_type_hints

from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import Quantity, check

P = ParamSpec("P")
"""Stands for the arguments of a decorated function."""
R = TypeVar("R")
"""Stands for the type that a decorated function returns."""


def spec(unit: str, source: str, low: float = -math.inf, high: float = math.inf) -> Quantity:
    """Return the description of a numeric function argument, which is written into the argument's annotation.

    `unit` is the SI unit, `source` states where the default comes from, and `low` and `high` are the bounds in the SI
    unit. A function with the decorator `check_arguments` refuses a number outside the bounds.
    """
    return Quantity(unit, source, low, high, "")


class Argument(NamedTuple):
    """An argument whose annotation contains a `spec`: the type of the argument (`kind`), and its unit, source and
    bounds.
    """

    kind: Any
    quantity: Quantity


@functools.cache
def arguments_of(function: Callable[..., Any]) -> dict[str, Argument]:
    """Return the arguments of a function, or the fields of a class, that have a unit: a dict from name to `Argument`.

    These are the arguments whose annotation is `Annotated[..., spec(...)]`. The dict omits all other arguments.
    """
    hints = get_type_hints(function, include_extras=True)
    # The parts of `Annotated[float, spec(...)]` are the type and the Quantity.
    argument_parts = {name: get_args(hint) for name, hint in hints.items() if get_origin(hint) is Annotated}
    return {name: Argument(*parts[:2]) for name, parts in argument_parts.items() if isinstance(parts[1], Quantity)}


def check_arguments(owner: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that makes a function refuse numbers outside the bounds of its annotations.

    Errors name an argument as `owner.argument`, for example `terrain.height`.

    Raises ParameterError: when the decorated function is called with a value that is not a number, is out of bounds, or
    is not whole although its annotation is `int`.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
            bound = signature.bind(*args, **kwargs).arguments
            for name, argument in arguments_of(function).items():
                # Only arguments that were given are checked: a default may lie outside on purpose, as None does.
                if name in bound and argument.kind in (int, float):
                    value: Any = bound[name]
                    check(owner, name, value, argument.quantity)
                    if argument.kind is int and value != int(value):
                        raise ParameterError(f"{owner}.{name} = {value:g} is not allowed: it must be a whole number.")
            return function(*args, **kwargs)

        return wrapper

    return decorate
