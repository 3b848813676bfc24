"""The terrain as triangles for the 3D views, with one mesh for each soil. Lanes are drawn with their lips and walls."""

from typing import NamedTuple

import numpy as np

from rover_pin.terrain.terrain import Extent, HeightGrid, Lanes, Profile, Terrain

MAX_POINTS = 400
"""Approximate maximum number of points along each axis of the drawn terrain. A height grid with more points is drawn
with every second, third, ... point, because a page with more triangles would be slow."""
RULED = 0.1
"""Distance along x [m] between the lines that are drawn across the terrain. The lines show its shape and the rover's
progress. The distance is one to two wheel radii of a small rover."""


class Patch(NamedTuple):
    """The part of the terrain that has one soil, as triangles for a 3D view: index of the soil, positions of V vertices
    (V, 3) [m], and F triangles (F, 3), each given by the indices of its vertices.
    """

    soil: int
    vertices: np.ndarray
    faces: np.ndarray


def patches(terrain: Terrain, box: Extent) -> list[Patch]:
    """Return the terrain within a rectangle as triangles, one patch for each soil."""
    # The terrain is first divided into Q quadrilaterals (Q, 4, 3) [m], each with its soil index (Q,).
    if isinstance(terrain, Lanes):
        # Lanes are strips of ground along x whose height does not change across them. The borders of the strips are
        # those of the lanes that lie within the rectangle, and its own two sides.
        edges = [box.y_low, *(y for y in terrain.borders if box.y_low < y < box.y_high), box.y_high]
        strips, strip_soils = [], []
        for low, high in zip(edges, edges[1:], strict=False):
            profile = terrain.profiles[int(terrain.lane(0.5 * (low + high)))]
            x = _corners((profile,), box)
            z = profile.height(x)
            strips.append(_strip(x, z, z, low, high))
            strip_soils.append(profile.ground[profile.piece(0.5 * (x[1:] + x[:-1]))])
        for y in edges[1:-1]:
            # The wall between two lanes of different height has the soil of the higher lane.
            right, left = (terrain.profiles[int(terrain.lane(y + side * 1e-9))] for side in (-1, 1))
            x = _corners((right, left), box)
            middle = 0.5 * (x[1:] + x[:-1])
            strips.append(_strip(x, right.height(x), left.height(x), y, y))
            right_soil, left_soil = (profile.ground[profile.piece(middle)] for profile in (right, left))
            strip_soils.append(np.where(right.height(middle) > left.height(middle), right_soil, left_soil))
        quads, soils = np.concatenate(strips), np.concatenate(strip_soils)
    else:
        # The grid has at most about MAX_POINTS points along each axis. For a height grid they are its own points, for
        # other terrain they are evenly spaced.
        axes = [np.linspace(low, high, MAX_POINTS) for low, high in (box[:2], box[2:])]
        if isinstance(terrain, HeightGrid):
            for axis, (start, spacing) in enumerate(((terrain.x0, terrain.dx), (terrain.y0, terrain.dy))):
                low, high = axes[axis][[0, -1]]
                ticks = start + spacing * np.arange(terrain.z.shape[axis])
                ticks = ticks[(ticks > low) & (ticks < high)]
                axes[axis] = np.concatenate([[low], ticks[:: max(1, ticks.size // MAX_POINTS)], [high]])
        X, Y = np.meshgrid(*axes, indexing="ij")
        points = np.stack([X, Y, terrain.height(X, Y)], axis=-1)
        quads = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2)
        # The soil is the one in the middle of a quadrilateral.
        centres = 0.25 * quads.sum(axis=2)
        quads = quads.reshape(-1, 4, 3)
        soils = np.asarray(terrain.ground_at(centres[..., 0], centres[..., 1])).ravel()
    soil_patches = []
    for soil in np.unique(soils):
        corners = quads[soils == soil]
        # A quad (4, 3) becomes the triangles of its corners 0 1 2 and 0 2 3.
        first = 4 * np.arange(len(corners))[:, None]
        faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
        soil_patches.append(Patch(int(soil), corners.reshape(-1, 3), faces))
    return soil_patches


def _corners(profiles: tuple[Profile, ...], box: Extent) -> np.ndarray:
    """Return the x [m] at which the drawn profiles need a point, ascending: the points of all profiles within the
    rectangle, and its two ends.
    """
    x = np.concatenate([[box.x_low, box.x_high], *(profile.x for profile in profiles)])
    return np.unique(np.clip(x, box.x_low, box.x_high))


def _strip(x: np.ndarray, z_low: np.ndarray, z_high: np.ndarray, y_low: float, y_high: float) -> np.ndarray:
    """Return the quadrilaterals (N-1, 4, 3) [m] between two polylines over common x (N,): one with the heights `z_low`
    at y = `y_low`, the other with the heights `z_high` at y = `y_high`.
    """
    low, high = (np.column_stack([x, np.full(x.size, y), z]) for y, z in ((y_low, z_low), (y_high, z_high)))
    return np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)


def ruled_lines(terrain: Terrain, box: Extent) -> np.ndarray:
    """Return the segments (N, 2, 3) [m] of lines that are drawn across the terrain along y, at distances of RULED along
    x. They show the shape of the terrain and the rover's progress.
    """
    # A point on either side of a border makes a line follow the wall between two lanes.
    borders = terrain.borders if isinstance(terrain, Lanes) else ()
    seams = [y + side for y in borders if box.y_low < y < box.y_high for side in (-1e-6, 1e-6)]
    y = np.array(sorted({box.y_low, box.y_high, *np.linspace(box.y_low, box.y_high, 25), *seams}))
    lines = []
    for x in np.arange(np.ceil(box.x_low / RULED), np.floor(box.x_high / RULED) + 1) * RULED:
        # Lines are drawn 1 mm above the terrain, which would otherwise hide them.
        points = np.column_stack([np.full(y.size, x), y, terrain.height(np.full(y.size, x), y) + 1e-3])
        lines.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(lines) if lines else np.zeros((0, 2, 3))
