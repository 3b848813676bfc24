"""Surface gravity of the places a rover drives on [m/s^2]."""

from __future__ import annotations

from rover_pin.errors import ParameterError, closest

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
        return float(word)
    except ValueError:
        raise ParameterError(
            f"gravity = {word!r} is neither a number [m/s^2] nor known: {closest(str(word), GRAVITIES)}"
        ) from None
