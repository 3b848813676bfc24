"""What every description of ground is checked for, and how its arrays are kept."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from rover_pin.base.errors import ParameterError

STEEPEST = math.radians(89.0)
"""Steepest piece of ground [rad]: the height is single-valued, so a wall must lean."""


def numbers(name: str, values: Any) -> np.ndarray:
    """Return `values` [m] as a separate array, or refuse what is not finite."""
    try:
        raw = np.asarray(values)
        if raw.dtype.kind not in "biuf":
            raise ParameterError(f"A terrain's {name} must be numbers in m, not of the type {raw.dtype}.")
        array = np.array(raw, dtype=float)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"A terrain's {name} must be numbers in m: {error}.") from error
    bad = np.argwhere(~np.isfinite(array))
    if bad.size or (array.ndim == 0 and not np.isfinite(array)):
        where = f" at index {tuple(int(i) for i in bad[0])}" if array.ndim else ""
        raise ParameterError(f"A terrain's {name} has a number that is not finite{where}: remove it or fill it in.")
    return array


def soil_indices(values: Any, shape: tuple[int, ...], owner: str, element: str) -> np.ndarray:
    """Return `values` as an array of whole numbers of this shape; one number stands for all."""
    array = np.asarray(values)
    valid = array.dtype.kind in "iuf" and np.all((array >= 0) & (array < 1000) & (array == np.floor(array)))
    if array.shape not in ((), shape) or not valid:
        raise ParameterError(
            f"A {owner}'s ground of shape {array.shape} must be whole numbers from 0 up: one for all, "
            f"or of shape {shape}, one a {element}; 0 is the default soil."
        )
    return np.array(np.broadcast_to(array, shape), dtype=np.int64)


def check_steepness(rise: np.ndarray, run: Any, where: Callable[[int], str]) -> None:
    """Refuse a piece that rises steeper than STEEPEST; `where` words its index."""
    angle = np.arctan2(np.abs(rise), run)
    steep = int(np.argmax(angle))
    if angle[steep] > STEEPEST + 1e-9:
        raise ParameterError(
            f"{where(steep)} is {math.degrees(angle[steep]):.2f} deg steep; at most {math.degrees(STEEPEST):g} deg "
            "is allowed: give the wall a lean."
        )


def freeze(owner: Any, **arrays: np.ndarray) -> None:
    """Set read-only arrays on a frozen object."""
    for name, array in arrays.items():
        array.flags.writeable = False
        object.__setattr__(owner, name, array)


def arrays_equal(first: Any, second: Any, *names: str) -> bool:
    """Return whether the named arrays of both are equal."""
    return all(np.array_equal(getattr(first, name), getattr(second, name)) for name in names)
