"""How steep and how rough ground is over the size of a rover."""

import numpy as np

from rover_pin.terrain.terrain import Terrain

SAMPLES = 21
"""Heights along each side of the square that a plane is laid through."""


def slope_and_roughness(terrain: Terrain, x: np.ndarray, y: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Return slope [rad] and roughness [m] over squares of this side [m] around places x, y [m], sides along x and y.

    z = z_0 + a u + b v by least squares over SAMPLES x SAMPLES heights of the ground as it is driven, u and v from the
    middle: slope = atan sqrt(a^2 + b^2), roughness = sqrt(mean (z - plane)^2). What lies between the points of a
    height grid is not known to it, so ground of wide cells is rougher than this.

    Source: S. B. Goldberg, M. W. Maimone and L. Matthies, Stereo vision and rover navigation software for planetary
    exploration, IEEE Aerospace 2002: a plane through what the rover covers, its tilt and the residual about it.
    """
    u = side * ((np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5)
    x, y = (np.asarray(place, dtype=float)[..., None, None] for place in (x, y))
    z = terrain.height(x + u[:, None], y + u)
    z = z - z.mean(axis=(-2, -1), keepdims=True)
    a, b = ((z * part).sum(axis=(-2, -1), keepdims=True) / (SAMPLES * (u @ u)) for part in (u[:, None], u))
    residual = z - a * u[:, None] - b * u
    return np.arctan(np.hypot(a, b))[..., 0, 0], np.sqrt(np.mean(residual**2, axis=(-2, -1)))
