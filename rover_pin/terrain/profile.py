"""A polyline of ground along x."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, final

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.terrain.checks import arrays_equal, check_steepness, freeze, numbers, soil_indices

FAR = 1000.0
"""How far the first and the last piece of a profile go on where end points are wanted [m]."""

ROUND_OFF = 8.0 * float(np.finfo(float).eps)
"""Points off a line by this share of the largest coordinate lie on it."""

Number = Any
"""A float, or an array of them; arrays are broadcast against each other and give arrays."""


@final
@dataclass(frozen=True, eq=False)
class Profile:
    """A polyline z(x), whose first and last pieces go on without end.

    Parameters
    ----------
    x, z : array (N,) [m]
        Points; x increases strictly, N >= 2.
    ground : int or array (N-1,), optional
        Soil index of each piece; 0, the default soil, unless given.

    Raises
    ------
    ParameterError
        Numbers that are not finite, x not increasing, a piece steeper than 89 deg, shapes that do not fit.
    """

    x: np.ndarray
    z: np.ndarray
    ground: np.ndarray = field(default_factory=lambda: np.zeros((), dtype=np.int64))

    def __post_init__(self) -> None:
        x, z = numbers("x", self.x), numbers("z", self.z)
        if x.ndim != 1 or x.shape != z.shape or x.size < 2:
            raise ParameterError(
                f"A profile has x of shape {x.shape} and z of shape {z.shape}: "
                "give two lists of the same length, 2 at least."
            )
        back = np.flatnonzero(np.diff(x) <= 0.0)
        if back.size:
            raise ParameterError(
                f"A profile's x must increase, but point {back[0] + 1} at {x[back[0] + 1]:g} m "
                f"follows {x[back[0]]:g} m: sort the points, and give a wall a lean."
            )
        check_steepness(np.diff(z), np.diff(x), lambda k: f"The piece of ground from x = {x[k]:g} m to {x[k + 1]:g} m")
        ground = soil_indices(self.ground, (x.size - 1,), "profile", "piece")
        freeze(self, x=x, z=z, ground=ground)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Profile) and arrays_equal(self, other, "x", "z", "ground")

    def __hash__(self) -> int:
        return hash((self.x.tobytes(), self.z.tobytes(), self.ground.tobytes()))

    def piece(self, x: Number) -> Any:
        """Return the index of the piece at `x` [m]; at a corner, of the piece ahead."""
        return np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, self.x.size - 2)

    def slope(self, x: Number) -> Any:
        """Return dz/dx at `x` [m]; at a corner, of the piece ahead."""
        k = self.piece(x)
        return (self.z[k + 1] - self.z[k]) / (self.x[k + 1] - self.x[k])

    def height(self, x: Number) -> Any:
        """Return z [m] at `x` [m]."""
        k = self.piece(x)
        return self.z[k] + (x - self.x[k]) * self.slope(x)

    def extended_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return x (N+2,), z (N+2,) and ground (N+1,) with end points a kilometre further on both sides."""
        ends = np.array([self.x[0] - FAR, self.x[-1] + FAR])
        heights = self.height(ends)
        return (
            np.concatenate([ends[:1], self.x, ends[1:]]),
            np.concatenate([heights[:1], self.z, heights[1:]]),
            np.concatenate([self.ground[:1], self.ground, self.ground[-1:]]),
        )

    @lru_cache(maxsize=64)  # noqa: B019 - few profiles, and small
    def without_collinear_points(self) -> Profile:
        """Return the same polyline without the points amid straight runs of one soil."""
        x, z, ground = self.x, self.z, self.ground
        tolerance = ROUND_OFF * max(1.0, float(np.max(np.abs(x))), float(np.max(np.abs(z))))
        corners = np.ones(len(x), dtype=bool)
        chord = z[:-2] + (x[1:-1] - x[:-2]) * (z[2:] - z[:-2]) / (x[2:] - x[:-2])
        corners[1:-1] = (np.abs(z[1:-1] - chord) > tolerance) | (ground[1:] != ground[:-1])
        bent = np.abs(z - np.interp(x, x[corners], z[corners])) > tolerance
        run = np.cumsum(corners)
        corners |= np.isin(run, run[bent])  # a bow of many small turns is no straight run: it stays as it is
        return Profile(x[corners], z[corners], ground[corners[:-1]])
