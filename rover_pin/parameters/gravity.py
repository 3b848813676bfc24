"""Surface gravity of the places a rover drives on [m/s^2]."""

from typing import Any

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.quantity import parse_quantity, to_si, value_and_unit

EARTH = 9.81
"""Standard gravity, rounded as engineering tables do (9.80665)."""
MOON = 1.62
"""NASA Planetary Fact Sheet."""
MARS = 3.71
"""NASA Planetary Fact Sheet (3.73 at the equator, 3.71 as commonly tabulated)."""

GRAVITIES = {"earth": EARTH, "moon": MOON, "mars": MARS}
"""By name, for the command line and files."""


def gravity_named(word: str | float) -> float:
    """Return the gravity [m/s^2] of a place, or of a number in words."""
    if isinstance(word, str) and word in GRAVITIES:
        return GRAVITIES[word]
    try:
        return parse_quantity(word, "m/s^2", "gravity")
    except ParameterError:
        raise ParameterError(
            f"gravity = {word!r} is neither a number [m/s^2] nor known: {closest(str(word), GRAVITIES)}"
        ) from None


def gravity_from(entry: Any, where: str) -> float:
    """Return a gravity [m/s^2] as a file gives it: a number, or { value, unit }.

    Raises DataError: it is neither, or not within (0, 100) m/s^2.
    """
    value, unit = value_and_unit(entry, "m/s^2")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < 100.0:
        raise DataError(f"{where}: gravity = {entry!r} must be a number in (0, 100) m/s^2, or {{ value, unit }}.")
    try:
        return to_si(value, str(unit), "m/s^2", f"{where}: 'gravity'")
    except ParameterError as error:
        raise DataError(str(error)) from error
