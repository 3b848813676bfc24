"""A terrain raised along x: what lies on it is lifted, nothing is turned."""

import math
from collections.abc import Sequence

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.terrain import HeightGrid, Lanes, Terrain

CLOSE = 1e-9
"""A point of the bend this near to one of the ground [m] is that one: a piece so short would have any slope."""
MAX_LINES = 20_000
"""Grid lines across x at most: more are a grid that is far larger than what bends."""


def bend_terrain(terrain: Terrain, x: Sequence[float], rise: Sequence[float]) -> Terrain:
    """Return a terrain that stands by `rise` [m] higher at these increasing `x` [m], straight in between.

    Beyond both ends it is raised as there. A polyline gets these points besides its own; a grid gets as many more
    lines across x as it takes to follow them, and its heights stay bilinear in between.

    Raises ParameterError: a grid so much larger than the bend that it would need more than MAX_LINES lines.
    """
    places, lift = np.asarray(x, dtype=float), np.asarray(rise, dtype=float)
    if isinstance(terrain, Lanes):
        return Lanes(tuple(_raise_profile(profile, places, lift) for profile in terrain.profiles), terrain.borders)
    assert isinstance(terrain, HeightGrid)
    finer = max(1, math.ceil(terrain.dx / float(np.min(np.diff(places)))))
    lines = (terrain.z.shape[0] - 1) * finer + 1
    if lines > MAX_LINES:
        raise ParameterError(
            f"The ground's bend has points every {np.min(np.diff(places)):.3g} m, the height grid a line every "
            f"{terrain.dx:g} m: it would need {lines} lines across x, {MAX_LINES} at most; bend a longer stretch, or "
            "cut the grid."
        )
    dx = terrain.dx / finer
    grid_x = terrain.x0 + dx * np.arange(lines)
    y = terrain.y0 + terrain.dy * np.arange(terrain.z.shape[1])
    z = terrain.height(grid_x[:, None], y[None, :]) + np.interp(grid_x, places, lift)[:, None]
    return HeightGrid(terrain.x0, terrain.y0, dx, terrain.dy, z, np.repeat(terrain.ground, finer, axis=0))


def _raise_profile(profile: Profile, places: np.ndarray, lift: np.ndarray) -> Profile:
    """Return a profile with the bend's points among its own, one more ahead and behind: beyond them nothing bends."""
    length = float(places[-1] - places[0])
    extended = np.concatenate([[places[0] - length], places, [places[-1] + length]])
    coincident = np.min(np.abs(extended[:, None] - profile.x), axis=1) < CLOSE
    x = np.union1d(profile.x, extended[~coincident])
    middle = (x[1:] + x[:-1]) / 2.0
    return Profile(x, profile.height(x) + np.interp(x, places, lift), profile.ground[profile.piece(middle)])
