"""Arguments of functions that state unit, bounds and source in their annotation, and are checked against them.

@checked("terrain")
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
R = TypeVar("R")


def spec(unit: str, source: str, low: float = -math.inf, high: float = math.inf) -> Quantity:
    """Return what an argument's annotation says of it besides its type."""
    return Quantity(unit, source, low, high, "")


class Argument(NamedTuple):
    """An argument that says what it is: its type, and unit, source and bounds."""

    kind: Any
    quantity: Quantity


@functools.cache
def arguments_of(function: Callable[..., Any]) -> dict[str, Argument]:
    """Return the arguments of a function, or fields of a class, whose annotation says what they are."""
    hints = get_type_hints(function, include_extras=True)
    argument_parts = {name: get_args(hint) for name, hint in hints.items() if get_origin(hint) is Annotated}
    return {name: Argument(*parts[:2]) for name, parts in argument_parts.items() if isinstance(parts[1], Quantity)}


def check_arguments(owner: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return the decorator by which a function refuses numbers out of the bounds that its annotations state.

    Raises ParameterError: by the function: what is no number, is out of bounds, or is not whole where the annotation is
    of `int`.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
            bound = signature.bind(*args, **kwargs).arguments
            for name, argument in arguments_of(function).items():
                if name in bound and argument.kind in (int, float):
                    check(owner, name, bound[name], argument.quantity)
                    _refuse_parts(owner, name, bound[name], argument.kind)
            return function(*args, **kwargs)

        return wrapper

    return decorate


def _refuse_parts(owner: str, name: str, value: Any, kind: type) -> None:
    if kind is int and value != int(value):
        raise ParameterError(f"{owner}.{name} = {value:g} is not allowed: it must be a whole number.")
