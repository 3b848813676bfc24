"""A terrain as the compiled step reads it: straight runs of a polyline as one piece, and bins to find a place in it."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from rover_pin.simulation.native.shared import N_FACET, N_PATCH
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.terrain import HeightGrid, Lanes, Terrain

WHEEL_LENGTH = 2.1
"""Radii of ground along x that a wheel looks at (REACH of lanes.c, both ways)."""
GRID_FACETS = 8


def terrain_fields(terrain: Terrain, radius: float) -> dict[str, Any]:
    """Return the fields of the C struct Drive that describe a terrain, for wheels of at most this radius [m]."""
    if isinstance(terrain, Lanes):
        return _lanes(terrain, radius)
    assert isinstance(terrain, HeightGrid)
    return {
        "grid_nx": terrain.z.shape[0],
        "grid_ny": terrain.z.shape[1],
        "grid_x0": terrain.x0,
        "grid_y0": terrain.y0,
        "grid_per_x": 1.0 / terrain.dx,
        "grid_per_y": 1.0 / terrain.dy,
        "grid_z": np.ascontiguousarray(terrain.z, dtype=float),
        "grid_ground": np.ascontiguousarray(terrain.ground, dtype=np.int64),
        **_room([GRID_FACETS]),
    }


class Line(NamedTuple):
    """A profile's points (N,) and pieces (N-1,), with bins: `bins[i]` is the last point at or behind bin i's begin."""

    x: np.ndarray
    z: np.ndarray
    ground: np.ndarray
    normals: np.ndarray
    bins: np.ndarray
    begin: float
    per_metre: float

    def crowd(self, length: float) -> int:
        """Return the most points within a length [m]."""
        return int(np.max(np.searchsorted(self.x, self.x + length, side="right") - np.arange(len(self.x))))


@lru_cache(maxsize=64)
def line_of(profile: Profile) -> Line:
    """Return a profile for the compiled step."""
    x, z, ground = profile.without_collinear_points().extended_points()
    along = np.column_stack([-np.diff(z), np.diff(x)])
    normals = along / np.linalg.norm(along, axis=1, keepdims=True)
    begins = np.linspace(x[1], x[-2], len(x))
    bins = np.searchsorted(x, begins, side="right") - 1
    bins[0], bins[-1] = 0, len(x) - 2
    per_metre = (len(begins) - 1) / (begins[-1] - begins[0])
    return Line(x, z, ground, normals, bins, float(begins[0]), float(per_metre))


def _lanes(terrain: Lanes, radius: float) -> dict[str, Any]:
    lines = [line_of(profile) for profile in terrain.profiles]
    # a point more ahead of each lane's pieces: the last point has no piece
    return {
        "n_lanes": len(lines),
        "lane_borders": np.append(np.asarray(terrain.borders, dtype=float), np.inf),
        "lane_start": _starts(lines, "x"),
        "lane_x": np.concatenate([line.x for line in lines]),
        "lane_z": np.concatenate([line.z for line in lines]),
        "lane_normal": np.concatenate([np.vstack([line.normals, line.normals[-1:]]) for line in lines]),
        "lane_ground": np.concatenate([np.append(line.ground, line.ground[-1]) for line in lines]).astype(np.int64),
        "bin": np.concatenate([line.bins for line in lines]).astype(np.int64),
        "bin_start": _starts(lines, "bins"),
        "bin_x0": np.array([line.begin for line in lines]),
        "bin_per_metre": np.array([line.per_metre for line in lines]),
        **_room([line.crowd(WHEEL_LENGTH * radius) for line in lines]),
    }


def _starts(lines: list[Line], name: str) -> np.ndarray:
    return np.cumsum([0, *(len(getattr(line, name)) for line in lines)]).astype(np.int64)


def _room(crowds: list[int]) -> dict[str, Any]:
    """Return room for the facets of a wheel on one lane, and for its patches on all of them."""
    facets = [crowd + 4 for crowd in crowds]  # the pieces at both ends, and one more beyond each
    return {"facets": np.zeros((max(facets), N_FACET)), "patches": np.zeros((sum(facets), N_PATCH))}
