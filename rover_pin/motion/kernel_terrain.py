"""A terrain as the compiled step reads it."""

from __future__ import annotations

from typing import Any

import numpy as np

from rover_pin.body.terrain import HeightGrid, Lanes, Terrain
from rover_pin.errors import ParameterError

MOST_FACETS = 56


def terrain_fields(terrain: Terrain, radius: float) -> dict[str, Any]:
    """Return the fields of the C struct Drive that describe a terrain, for wheels of at most this radius [m].

    Raises
    ------
    ParameterError
        More points under a wheel than the step holds.
    """
    if isinstance(terrain, Lanes):
        return _lanes(terrain, radius)
    assert isinstance(terrain, HeightGrid)
    return {
        "grid_nx": terrain.z.shape[0],
        "grid_ny": terrain.z.shape[1],
        "grid_x0": terrain.x0,
        "grid_y0": terrain.y0,
        "grid_dx": terrain.dx,
        "grid_dy": terrain.dy,
        "grid_z": np.ascontiguousarray(terrain.z, dtype=float),
        "grid_ground": np.ascontiguousarray(terrain.ground, dtype=np.int64),
    }


def _lanes(terrain: Lanes, radius: float) -> dict[str, Any]:
    xs, zs, grounds, starts = [], [], [], [0]
    for profile in terrain.profiles:
        x, z, ground = profile.extended()
        crowd = int(np.max(np.searchsorted(x, x + 2.2 * radius) - np.arange(len(x))))
        if crowd > MOST_FACETS:
            raise ParameterError(
                f"The terrain has {crowd} points within a wheel's length of {2.2 * radius:g} m; "
                f"at most {MOST_FACETS} are allowed: thin the polyline."
            )
        xs.append(x)
        zs.append(z)
        grounds.append(np.append(ground, ground[-1]))
        starts.append(starts[-1] + len(x))
    return {
        "n_lanes": len(terrain.profiles),
        "lane_borders": np.append(np.asarray(terrain.borders, dtype=float), np.inf),
        "lane_start": np.array(starts, dtype=np.int64),
        "lane_x": np.concatenate(xs),
        "lane_z": np.concatenate(zs),
        "lane_ground": np.concatenate(grounds).astype(np.int64),
    }
