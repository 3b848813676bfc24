"""The ground the rover drives on: a height above every (x, y), and which soil lies there.

Two kinds: `Lanes`, polylines along x extruded sideways, which keep sharp lips and steep walls; and `HeightGrid`,
bilinear between points, which has side slopes. Soil index 0 is the model's default soil, 1 and up its further soils.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, final

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.terrain.checks import arrays_equal, check_steepness, freeze, numbers, soil_indices
from rover_pin.terrain.profile import Number, Profile


class Extent(NamedTuple):
    """The box that a terrain describes [m]; beyond it the terrain goes on as its class says."""

    x_low: float
    x_high: float
    y_low: float
    y_high: float


class Terrain(ABC):
    """A height and a soil index over every (x, y); coordinates and heights in [m], floats or arrays."""

    @abstractmethod
    def height(self, x: Number, y: Number) -> Any:
        """Return the height [m]."""

    @abstractmethod
    def gradient(self, x: Number, y: Number) -> tuple[Any, Any]:
        """Return (dz/dx, dz/dy)."""

    @abstractmethod
    def ground_at(self, x: Number, y: Number) -> Any:
        """Return the soil index."""

    @property
    @abstractmethod
    def ground_indices(self) -> frozenset[int]:
        """The soil indices that occur."""

    @property
    @abstractmethod
    def mirror_symmetric(self) -> bool:
        """Whether the terrain is the same under y -> -y (to 1e-12 m)."""

    @property
    @abstractmethod
    def extent(self) -> Extent:
        """The box that the terrain describes."""

    def normal(self, x: Number, y: Number) -> np.ndarray:
        """Return the unit normal, pointing up, shape (..., 3)."""
        slope_x, slope_y = np.broadcast_arrays(*self.gradient(x, y))
        normal = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def slope_at(self, x: Number, y: Number, yaw: float = 0.0) -> Any:
        """Return the inclination [rad] along the heading `yaw` [rad], positive uphill."""
        slope_x, slope_y = self.gradient(x, y)
        return _plain(np.arctan(slope_x * math.cos(yaw) + slope_y * math.sin(yaw)))


@final
@dataclass(frozen=True)
class Lanes(Terrain):
    """Profiles along x, each extruded over its own band of y; a wheel over a border rests in both: see `section`.

    Parameters
    ----------
    profiles : tuple of Profile (L,)
        From right (low y) to left.
    borders : tuple of float (L-1,) [m]
        Where y passes from one lane to the next, increasing; a border itself belongs to the lane on its right.

    Raises
    ------
    ParameterError
        No profile, or borders that do not fit them.
    """

    profiles: tuple[Profile, ...]
    borders: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        profiles, borders = tuple(self.profiles), numbers("borders", self.borders)
        if not profiles or borders.shape != (len(profiles) - 1,) or np.any(np.diff(borders) <= 0.0):
            raise ParameterError(
                f"Lanes with {len(profiles)} profiles and borders at y = {borders.tolist()} m do not fit: "
                "give at least one profile, and one border less than profiles, increasing."
            )
        object.__setattr__(self, "profiles", profiles)
        object.__setattr__(self, "borders", tuple(borders.tolist()))

    def lane(self, y: Number) -> Any:
        """Return the index of the lane at `y`."""
        return np.searchsorted(self.borders, y)

    def height(self, x: Number, y: Number) -> Any:
        """Return the height [m]; beyond a profile's ends its first and last pieces go on."""
        return _plain(self._by_lane(x, y, [profile.height(x) for profile in self.profiles]))

    def gradient(self, x: Number, y: Number) -> tuple[Any, Any]:
        """Return (dz/dx, dz/dy); dz/dy is 0: the jump between lanes has no slope."""
        slope = self._by_lane(x, y, [profile.slope(x) for profile in self.profiles])
        return _plain(slope), _plain(np.zeros_like(slope))

    def ground_at(self, x: Number, y: Number) -> Any:
        """Return the soil index."""
        return _plain(self._by_lane(x, y, [profile.ground[profile.piece(x)] for profile in self.profiles]))

    @property
    def ground_indices(self) -> frozenset[int]:
        """The soil indices that occur."""
        return frozenset(int(index) for profile in self.profiles for index in profile.ground)

    @property
    def mirror_symmetric(self) -> bool:
        """Whether the lanes, read from the left, are those read from the right."""
        borders = np.array(self.borders)
        return np.allclose(borders, -borders[::-1], rtol=0.0, atol=1e-12) and self.profiles == self.profiles[::-1]

    @property
    def extent(self) -> Extent:
        """The x that any profile's points reach; y without end."""
        ends = [(profile.x[0], profile.x[-1]) for profile in self.profiles]
        return Extent(float(min(low for low, _ in ends)), float(max(high for _, high in ends)), -math.inf, math.inf)

    def _by_lane(self, x: Number, y: Number, values: list[Any]) -> np.ndarray:
        lane = np.broadcast_to(self.lane(y), np.broadcast_shapes(np.shape(x), np.shape(y)))
        return np.choose(lane, values)


@final
@dataclass(frozen=True, eq=False)
class HeightGrid(Terrain):
    """Heights on a regular grid, bilinear in between; outside, that of the nearest point of the border.

    Parameters
    ----------
    x0, y0 : float [m]
        The corner z[0, 0].
    dx, dy : float [m]
        Spacing.
    z : array (nx, ny) [m]
        Heights; nx, ny >= 2.
    ground : int or array (nx-1, ny-1), optional
        Soil index of each cell; 0 unless given.

    Raises
    ------
    ParameterError
        Numbers that are not finite, a spacing that is not positive, an edge steeper than 89 deg, or shapes that do
        not fit.
    """

    x0: float
    y0: float
    dx: float
    dy: float
    z: np.ndarray
    ground: np.ndarray = field(default_factory=lambda: np.zeros((), dtype=np.int64))

    def __post_init__(self) -> None:
        for name in ("x0", "y0", "dx", "dy"):
            value = numbers(name, getattr(self, name))
            if value.ndim:
                raise ParameterError(f"A height grid has {name} of shape {value.shape}: give one number in m.")
            object.__setattr__(self, name, float(value))
        if self.dx <= 0.0 or self.dy <= 0.0:
            raise ParameterError(
                f"A height grid has spacing dx = {self.dx:g} m, dy = {self.dy:g} m: both must be positive."
            )
        z = numbers("z", self.z)
        if z.ndim != 2 or min(z.shape) < 2:
            raise ParameterError(f"A height grid has z of shape {z.shape}: give (nx, ny), 2 at least in each.")
        for axis, step in enumerate((self.dx, self.dy)):
            rise = np.max(np.abs(np.diff(z, axis=axis)), axis=1 - axis)
            along = "A height grid between points {} and {} along " + "xy"[axis]
            check_steepness(rise, step, lambda k, along=along: along.format(k, k + 1))  # type: ignore[misc]
        freeze(self, z=z, ground=soil_indices(self.ground, (z.shape[0] - 1, z.shape[1] - 1), "height grid", "cell"))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, HeightGrid) and arrays_equal(self, other, "x0", "y0", "dx", "dy", "z", "ground")

    def __hash__(self) -> int:
        return hash((self.x0, self.y0, self.dx, self.dy, self.z.tobytes(), self.ground.tobytes()))

    def height(self, x: Number, y: Number) -> Any:
        """Return the height [m], bilinear; outside, that of the nearest point of the border."""
        i, j, u, v = self._cell(x, y)
        z = self.z
        low, high = z[i, j] * (1 - u) + z[i + 1, j] * u, z[i, j + 1] * (1 - u) + z[i + 1, j + 1] * u
        return _plain(low * (1 - v) + high * v)

    def gradient(self, x: Number, y: Number) -> tuple[Any, Any]:
        """Return (dz/dx, dz/dy); outside the grid 0 in the direction in which x or y is beyond it."""
        i, j, u, v = self._cell(x, y)
        z = self.z
        slope_x = ((z[i + 1, j] - z[i, j]) * (1 - v) + (z[i + 1, j + 1] - z[i, j + 1]) * v) / self.dx
        slope_y = ((z[i, j + 1] - z[i, j]) * (1 - u) + (z[i + 1, j + 1] - z[i + 1, j]) * u) / self.dy
        low_x, high_x, low_y, high_y = self.extent
        inside_x, inside_y = (x >= low_x) & (x <= high_x), (y >= low_y) & (y <= high_y)
        return _plain(slope_x * inside_x), _plain(slope_y * inside_y)

    def ground_at(self, x: Number, y: Number) -> Any:
        """Return the soil index of the cell, or of the nearest one."""
        i, j, _, _ = self._cell(x, y)
        return _plain(self.ground[i, j])

    @cached_property
    def ground_indices(self) -> frozenset[int]:
        """The soil indices that occur."""
        return frozenset(int(index) for index in np.unique(self.ground))

    @property
    def mirror_symmetric(self) -> bool:
        """Whether the grid is the same from both sides of y = 0, or the same over all y."""
        level = np.allclose(self.z, self.z[:, :1], rtol=0.0, atol=1e-12) and np.all(self.ground == self.ground[:, :1])
        centred = abs(self.extent.y_low + self.extent.y_high) <= 1e-12
        mirrored = np.allclose(self.z, self.z[:, ::-1], rtol=0.0, atol=1e-12) and np.all(
            self.ground == self.ground[:, ::-1]
        )
        return bool(level or (centred and mirrored))

    @property
    def extent(self) -> Extent:
        """The grid's box."""
        nx, ny = self.z.shape
        return Extent(self.x0, self.x0 + (nx - 1) * self.dx, self.y0, self.y0 + (ny - 1) * self.dy)

    def _cell(self, x: Number, y: Number) -> tuple[Any, Any, Any, Any]:
        nx, ny = self.z.shape
        u, v = np.clip((x - self.x0) / self.dx, 0.0, nx - 1.0), np.clip((y - self.y0) / self.dy, 0.0, ny - 1.0)
        i, j = np.minimum(np.floor(u).astype(int), nx - 2), np.minimum(np.floor(v).astype(int), ny - 2)
        return i, j, u - i, v - j


def _plain(value: Any) -> Any:
    return value.item() if np.ndim(value) == 0 and isinstance(value, (np.ndarray, np.generic)) else value
