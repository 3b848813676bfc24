"""The rover as a model drives it: under its gravity, with what effects make it carry and lean."""

from __future__ import annotations

from functools import lru_cache

from rover_pin.body.rover import Rover

Change = tuple[tuple[float, ...], tuple[float, ...]]
"""What one effect does to the rover: `ballast()` and `rise()`."""


@lru_cache(maxsize=64)
def built_rover(rover: Rover, gravity: float, changes: tuple[Change, ...]) -> Rover:
    """Return the rover under a gravity [m/s^2] with these changes; the same object for the same arguments.

    What is worked out for a rover is thereby found again in every drive of it (`rover_fields`).
    """
    rover = rover.under(gravity)
    for ballast, rise in changes:
        rover = rover.carrying(*ballast) if any(ballast) else rover
        rover = rover.rising(*rise) if any(rise) else rover
    return rover
