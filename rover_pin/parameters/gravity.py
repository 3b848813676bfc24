"""Gravity on the surface of the Earth, the Moon and Mars [m/s^2], and functions that read a user's gravity."""

from typing import Any

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.quantity import parse_quantity, to_si, value_and_unit

EARTH = 9.81
"""Gravity on the Earth [m/s^2]: standard gravity 9.80665, rounded as in engineering tables."""
MOON = 1.62
"""Gravity on the Moon [m/s^2]. Source: NASA Planetary Fact Sheet."""
MARS = 3.71
"""Gravity on Mars [m/s^2], as commonly tabulated. Source: NASA Planetary Fact Sheet (3.73 at the equator)."""

GRAVITIES = {"earth": EARTH, "moon": MOON, "mars": MARS}
"""Name of a body, as the command line and files state it -> gravity on its surface [m/s^2]."""


def gravity_named(word: str | float) -> float:
    """Return the gravity [m/s^2] that a user states by the name of a body, or by a number with an optional unit.

    Raises ParameterError if `word` is neither a known name nor a number; the message lists the most similar names.

    Examples
    --------
    >>> gravity_named("moon")
    1.62
    """
    # A name has priority over a number, because no number is the name of a body.
    if isinstance(word, str) and word in GRAVITIES:
        return GRAVITIES[word]
    try:
        return parse_quantity(word, "m/s^2", "gravity")
    except ParameterError:
        raise ParameterError(
            f"gravity = {word!r} is neither a number [m/s^2] nor a known body: {closest(str(word), GRAVITIES)}"
        ) from None


def gravity_from(entry: Any, where: str) -> float:
    """Return the gravity [m/s^2] from an entry of a file, which is a number in m/s^2 or a table { value, unit }.

    `where` is the location of the entry for an error message.

    Raises DataError: the entry has another form, or the value is not between 0 and 100 m/s^2.
    """
    value, unit = value_and_unit(entry, "m/s^2")
    # A value that is not a number becomes 0, which the range below refuses.
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    try:
        gravity = to_si(value, str(unit), "m/s^2", f"{where}: 'gravity'") if is_number else 0.0
    except ParameterError as error:
        raise DataError(str(error)) from error
    # A rover has no contact without gravity, and 100 m/s^2 is four times the gravity of Jupiter.
    if not 0.0 < gravity < 100.0:
        raise DataError(
            f"{where}: gravity = {entry!r} must be a number in (0, 100) m/s^2, or a table {{ value, unit }}."
        )
    return gravity
