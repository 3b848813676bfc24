"""Rover and ground as a model drives them: under its gravity, with what effects make it carry, lean and bend."""

from collections.abc import Sequence
from functools import lru_cache

from rover_pin.rover.rover import Rover
from rover_pin.terrain.bent import bend_terrain
from rover_pin.terrain.terrain import Terrain

Change = tuple[tuple[float, ...], tuple[float, ...]]
"""What one effect does to the rover: `ballast()` and `rise()`."""
Bend = tuple[tuple[float, ...], tuple[float, ...]]
"""What one effect does to the ground: `bend()`."""


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


def built_ground(terrain: Terrain, bends: Sequence[Bend]) -> Terrain:
    """Return the ground with these bends: itself where there are none, else the same object for the same arguments.

    A dense grid is compared by all of its heights, which takes as long as a short drive: not where nothing bends.
    """
    there = tuple(bend for bend in bends if bend[0])
    return _bent_by(terrain, there) if there else terrain


@lru_cache(maxsize=64)
def _bent_by(terrain: Terrain, bends: tuple[Bend, ...]) -> Terrain:
    for x, rise in bends:
        terrain = bend_terrain(terrain, x, rise)
    return terrain
