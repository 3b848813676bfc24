"""Return a changed copy of a terrain: with another soil in a stretch of x, or raised by a height that depends on x."""

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from rover_pin.base.arguments import spec
from rover_pin.base.errors import ParameterError
from rover_pin.terrain.terrain import HeightGrid, Lanes, Profile, Terrain

LEAD = 1.0
"""Distance [m] of two additional points of a profile from the end of a stretch of soil, if this end lies outside the
profile. The points lie before and behind the end, on the straight continuation of the profile, so that the ground keeps
its shape. Any distance of the size of a rover serves this purpose."""
MIN_PIECE = 1e-9
"""Minimum distance [m] between a new point of a profile and the profile's own points. A new point that is nearer is
dropped, because round-off could give the short piece between the two points any slope."""
MAX_LINES = 20_000
"""Maximum number of grid lines across x in a height grid that `bend_terrain` raises. A grid with more lines is refused,
because it would be far larger than its raised part."""

End = Annotated[float, spec("m", "none: no stretch of hard ground is laid")]


def with_ground(terrain: Terrain, x_from: End, x_to: End, index: int) -> Terrain:
    """Return a copy of the terrain that has another soil from `x_from` to `x_to` [m], at every y.

    Parameters
    ----------
    terrain : Terrain
        The terrain without this stretch of soil.
    x_from, x_to : float [m]
        Ends of the stretch; one or both may be infinite. In a height grid, every cell whose middle lies in the stretch
        gets the soil.
    index : int
        Soil index of the stretch; 0 is the model's default soil.

    Raises ParameterError: the stretch is empty, or contains no cell of the height grid.
    """
    if not x_from < x_to:
        raise ParameterError(
            f"Soil {index} from x = {x_from:g} m to {x_to:g} m is an empty stretch. The first end must be smaller than "
            "the second: swap them."
        )
    if isinstance(terrain, HeightGrid):
        # A grid has one soil for each cell, so that the stretch is rounded to whole cells.
        middle = terrain.x0 + terrain.dx * (np.arange(terrain.ground.shape[0]) + 0.5)
        inside = (middle >= x_from) & (middle <= x_to)
        if not np.any(inside):
            raise ParameterError(
                f"Soil {index} from x = {x_from:g} m to {x_to:g} m covers no cell of the height grid, which has a cell "
                f"every {terrain.dx:g} m from {terrain.extent.x_low:g} to {terrain.extent.x_high:g} m."
            )
        ground = np.where(inside[:, None], index, terrain.ground)
        return HeightGrid(terrain.x0, terrain.y0, terrain.dx, terrain.dy, terrain.z, ground)
    assert isinstance(terrain, Lanes)
    profiles = []
    for profile in terrain.profiles:
        # The ends of the stretch become points of the profile. An end outside the profile gets a point on either side,
        # because the soil of the whole end piece would change otherwise.
        x = profile.x
        for end in (x_from, x_to):
            if math.isfinite(end):
                new = [end] if x[0] < end < x[-1] else [end - LEAD, end, end + LEAD]
                x = np.append(x, [cut for cut in new if np.min(np.abs(x - cut)) > MIN_PIECE])
        # Each piece between two points has its own soil, or the new soil if its middle lies in the stretch.
        x = np.sort(x)
        middle = 0.5 * (x[1:] + x[:-1])
        ground = np.where((middle > x_from) & (middle < x_to), index, profile.ground[profile.piece(middle)])
        profiles.append(Profile(x, profile.height(x), ground))
    return Lanes(tuple(profiles), terrain.borders)


def bend_terrain(terrain: Terrain, x: Sequence[float], rise: Sequence[float]) -> Terrain:
    """Return a copy of the terrain that is raised by a height that depends on x only.

    An effect with a method `bend()` changes the model's terrain by this function, for instance to fit the error of a
    surveyed height. A profile gets the points of the bend in addition to its own points. A height grid gets additional
    lines across x, and stays bilinear between these lines.

    Parameters
    ----------
    terrain : Terrain
        The terrain before it is raised.
    x, rise : sequences (N,) [m]
        Increasing positions, and the rise of the terrain at these positions. The height is linear between two positions
        and constant beyond the first and the last position.

    Raises ParameterError: the height grid would need more than MAX_LINES lines across x.
    """
    places, lift = np.asarray(x, dtype=float), np.asarray(rise, dtype=float)
    if isinstance(terrain, HeightGrid):
        # The grid gets enough lines across x for one line between any two points of the bend.
        spacing = float(np.min(np.diff(places)))
        finer = max(1, math.ceil(terrain.dx / spacing))
        lines = (terrain.z.shape[0] - 1) * finer + 1
        if lines > MAX_LINES:
            raise ParameterError(
                f"The terrain's bend has points every {spacing:.3g} m, and the height grid has a line every "
                f"{terrain.dx:g} m. The raised grid would need {lines} lines across x, but {MAX_LINES} is the maximum. "
                "Place the points of the bend further apart, or use a shorter height grid."
            )
        dx = terrain.dx / finer
        grid_x = terrain.x0 + dx * np.arange(lines)
        y = terrain.y0 + terrain.dy * np.arange(terrain.z.shape[1])
        z = terrain.height(grid_x[:, None], y[None, :]) + np.interp(grid_x, places, lift)[:, None]
        return HeightGrid(terrain.x0, terrain.y0, dx, terrain.dy, z, np.repeat(terrain.ground, finer, axis=0))
    assert isinstance(terrain, Lanes)
    # One additional point beyond each end keeps the rise constant there, also on the continuation of the profile.
    length = float(places[-1] - places[0])
    extended = np.concatenate([[places[0] - length], places, [places[-1] + length]])
    profiles = []
    for profile in terrain.profiles:
        # The points of the profile and of the bend are joined. The height is linear between two neighbouring points.
        coincident = np.min(np.abs(extended[:, None] - profile.x), axis=1) < MIN_PIECE
        points = np.union1d(profile.x, extended[~coincident])
        middle = (points[1:] + points[:-1]) / 2.0
        raised = profile.height(points) + np.interp(points, places, lift)
        profiles.append(Profile(points, raised, profile.ground[profile.piece(middle)]))
    return Lanes(tuple(profiles), terrain.borders)
