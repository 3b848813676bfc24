"""The true ground as triangles: lanes with their lips and walls, grids with their cells, a colour for each soil."""

from typing import NamedTuple

import numpy as np

from rover_pin.terrain.profile import Profile
from rover_pin.terrain.terrain import Extent, HeightGrid, Lanes, Terrain

MAX_POINTS = 400
"""Points of a height grid that are drawn along either axis."""
RULED = 0.1
"""Distance of the lines that are ruled across the ground [m]."""


class Patch(NamedTuple):
    """A piece of ground of one soil: vertices (V, 3) [m] and triangles (F, 3)."""

    soil: int
    vertices: np.ndarray
    faces: np.ndarray


def patches(terrain: Terrain, box: Extent) -> list[Patch]:
    """Return the ground within a box, one patch a soil."""
    if isinstance(terrain, Lanes):
        quads, soils = _lanes(terrain, box)
    else:
        quads, soils = _cells(terrain, box)
    return [_patch(int(soil), quads[soils == soil]) for soil in np.unique(soils)]


def _patch(soil: int, quads: np.ndarray) -> Patch:
    """Return quads (Q, 4, 3) as two triangles each."""
    first = 4 * np.arange(len(quads))[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return Patch(soil, quads.reshape(-1, 3), faces)


def _lanes(terrain: Lanes, box: Extent) -> tuple[np.ndarray, np.ndarray]:
    edges = [box.y_low, *(y for y in terrain.borders if box.y_low < y < box.y_high), box.y_high]
    quads, soils = [], []
    for low, high in zip(edges, edges[1:], strict=False):
        profile = terrain.profiles[int(terrain.lane(0.5 * (low + high)))]
        x = _corners((profile,), box)
        z, ground = profile.height(x), profile.ground[profile.piece(0.5 * (x[1:] + x[:-1]))]
        quads.append(_strip(x, z, z, low, high))
        soils.append(ground)
    for y in edges[1:-1]:
        right, left = (terrain.profiles[int(terrain.lane(y + side * 1e-9))] for side in (-1, 1))
        x = _corners((right, left), box)
        quads.append(_strip(x, right.height(x), left.height(x), y, y))
        higher = np.where(right.height(0.5 * (x[1:] + x[:-1])) > left.height(0.5 * (x[1:] + x[:-1])), 0, 1)
        middle = 0.5 * (x[1:] + x[:-1])
        soils.append(
            np.choose(higher, [side_profile.ground[side_profile.piece(middle)] for side_profile in (right, left)])
        )
    return np.concatenate(quads), np.concatenate(soils)


def _corners(profiles: tuple[Profile, ...], box: Extent) -> np.ndarray:
    x = np.concatenate([[box.x_low, box.x_high], *(profile.x for profile in profiles)])
    return np.unique(np.clip(x, box.x_low, box.x_high))


def _strip(x: np.ndarray, z_low: np.ndarray, z_high: np.ndarray, y_low: float, y_high: float) -> np.ndarray:
    """Return the quads (N-1, 4, 3) between a line at y_low and one at y_high."""
    low, high = (np.column_stack([x, np.full(x.size, y), z]) for y, z in ((y_low, z_low), (y_high, z_high)))
    return np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)


def _cells(terrain: Terrain, box: Extent) -> tuple[np.ndarray, np.ndarray]:
    x, y = (_ticks(terrain, low, high, axis) for axis, (low, high) in enumerate((box[:2], box[2:])))
    X, Y = np.meshgrid(x, y, indexing="ij")
    points = np.stack([X, Y, terrain.height(X, Y)], axis=-1)
    quads = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2)
    middle = 0.25 * quads.sum(axis=2)
    return quads.reshape(-1, 4, 3), np.asarray(terrain.ground_at(middle[..., 0], middle[..., 1])).ravel()


def _ticks(terrain: Terrain, low: float, high: float, axis: int) -> np.ndarray:
    """Return where a grid has points within a range, and its ends; thinned out where they are very many."""
    if not isinstance(terrain, HeightGrid):
        return np.linspace(low, high, MAX_POINTS)
    start, spacing = ((terrain.x0, terrain.dx), (terrain.y0, terrain.dy))[axis]
    count = terrain.z.shape[axis]
    ticks = start + spacing * np.arange(count)
    ticks = ticks[(ticks > low) & (ticks < high)]
    return np.concatenate([[low], ticks[:: max(1, ticks.size // MAX_POINTS)], [high]])


def ruled_lines(terrain: Terrain, box: Extent) -> np.ndarray:
    """Return segments (N, 2, 3) of the lines that lie on the ground each 0.1 m along x, from side to side."""
    across = sorted({box.y_low, box.y_high, *np.linspace(box.y_low, box.y_high, 25), *_seams(terrain, box)})
    y = np.array(across)
    lines = []
    for x in np.arange(np.ceil(box.x_low / RULED), np.floor(box.x_high / RULED) + 1) * RULED:
        points = np.column_stack([np.full(y.size, x), y, terrain.height(np.full(y.size, x), y) + 1e-3])
        lines.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(lines) if lines else np.zeros((0, 2, 3))


def _seams(terrain: Terrain, box: Extent) -> list[float]:
    borders = terrain.borders if isinstance(terrain, Lanes) else ()
    return [y + side for y in borders if box.y_low < y < box.y_high for side in (-1e-6, 1e-6)]
