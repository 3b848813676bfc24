"""The terrain: a height and a soil index at each (x, y).

There are two kinds of terrain. `Lanes` consists of profiles (polylines z(x)), each of which is extruded sideways over
its own band of y; sharp lips and steep walls are kept. `HeightGrid` interpolates bilinearly between the points of a
grid, so that the ground may also slope sideways. Soil index 0 is the model's default soil, and higher indices are the
further soils of the model.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, final

import numpy as np

from rover_pin.base.errors import ParameterError

MAX_STEEPNESS = math.radians(89.0)
"""Maximum inclination of the terrain [rad]. A steeper or vertical wall is refused, because a terrain has one height at
each (x, y)."""

BEYOND = (1e3, 3e6)
"""Distances [m] beyond each end of a profile at which the compiled step gets two further points, in line with the end
piece.

A start and the points of a shape lie within 1,000 km of 0, so that no rover reaches the end of its terrain. The nearer
point keeps heights exact to 1e-13 m within a kilometre of the profile; up to the farther point, heights are exact to
1e-9 m."""

ROUND_OFF = 8.0 * float(np.finfo(float).eps)
"""Maximum distance of a point from a straight line at which the point counts as lying on the line, as a fraction of the
largest coordinate. A point at a larger distance is a corner. The value is eight times the round-off of a float, because
the distance is computed in a few operations."""

ROUGHNESS_SAMPLES = 21
"""Number of heights along each side of the square in `slope_and_roughness`, which fits a plane to these heights. With
21 heights, the distance between them is a twentieth of the rover's length, about the width of a small wheel."""

Number = Any
"""A float, or an array of floats; functions with several such arguments broadcast arrays against each other and return
arrays."""


class Extent(NamedTuple):
    """The box of x and y [m] that contains the points by which a terrain is given.

    A terrain continues beyond its box: `Lanes` in straight lines, and `HeightGrid` at the height of its border.
    """

    x_low: float
    x_high: float
    y_low: float
    y_high: float


class Terrain(ABC):
    """Base class of all terrains: a height and a soil index at every (x, y).

    Coordinates and heights are in [m], as floats or arrays.
    """

    @abstractmethod
    def height(self, x: Number, y: Number) -> Any:
        """Return the height of the terrain [m] at (x, y) [m]. Arrays of coordinates give an array of heights."""

    @abstractmethod
    def gradient(self, x: Number, y: Number) -> tuple[Any, Any]:
        """Return the slopes (dz/dx, dz/dy) of the terrain at (x, y) [m]. Arrays of coordinates give arrays of
        slopes.
        """

    @abstractmethod
    def ground_at(self, x: Number, y: Number) -> Any:
        """Return the soil index at (x, y) [m]; 0 is the model's default soil. Arrays of coordinates give an array of
        indices.
        """

    @property
    @abstractmethod
    def ground_indices(self) -> frozenset[int]:
        """The soil indices that occur anywhere in the terrain."""

    @property
    @abstractmethod
    def mirror_symmetric(self) -> bool:
        """Whether the terrain equals its mirror image about the plane y = 0 (to 1e-12 m)."""

    @property
    @abstractmethod
    def extent(self) -> Extent:
        """The box of x and y [m] that contains the points by which the terrain is given (see `Extent`)."""

    def normal(self, x: Number, y: Number) -> np.ndarray:
        """Return the unit normal of the terrain at (x, y) [m], which points up.

        The last axis of the result has the three components of the normal.
        """
        slope_x, slope_y = np.broadcast_arrays(*self.gradient(x, y))
        normal = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def slope_at(self, x: Number, y: Number, yaw: float = 0.0) -> Any:
        """Return the inclination of the terrain [rad] at (x, y) [m] along the heading `yaw` [rad], positive uphill."""
        slope_x, slope_y = self.gradient(x, y)
        return _plain(np.arctan(slope_x * math.cos(yaw) + slope_y * math.sin(yaw)))


@final
@dataclass(frozen=True, eq=False)
class Profile:
    """A line of ground along x: a polyline z(x), whose first and last pieces continue in a straight line.

    Parameters
    ----------
    x, z : array (N,) [m]
        Points; x increases strictly, N >= 2.
    ground : int or array (N-1,), optional
        Soil index of each piece; by default 0, the model's default soil.

    Raises
    ------
    ParameterError
        A number is not finite, x does not increase, a piece is steeper than 89 deg, or the shapes do not fit.

    Examples
    --------
    >>> ramp = Profile([0.0, 1.0, 2.0], [0.0, 0.0, 0.5])
    >>> float(ramp.height(1.5)), float(ramp.slope(1.5))
    (0.25, 0.5)
    """

    x: np.ndarray
    z: np.ndarray
    ground: np.ndarray = field(default_factory=lambda: np.zeros((), dtype=np.int64))

    def __post_init__(self) -> None:
        x, z = numbers("x", self.x), numbers("z", self.z)
        if x.ndim != 1 or x.shape != z.shape or x.size < 2:
            raise ParameterError(
                f"A profile has x of shape {x.shape} and z of shape {z.shape}. "
                "Give two lists of the same length, with 2 numbers or more."
            )
        back = np.flatnonzero(np.diff(x) <= 0.0)
        if back.size:
            raise ParameterError(
                f"A profile's x must increase, but point {back[0] + 1} at {x[back[0] + 1]:g} m "
                f"follows {x[back[0]]:g} m. Sort the points by x; replace a vertical wall by a slightly inclined wall."
            )
        check_steepness(np.diff(z), np.diff(x), lambda k: f"The terrain from x = {x[k]:g} m to {x[k + 1]:g} m")
        ground = soil_indices(self.ground, (x.size - 1,), "profile", "piece")
        freeze(self, x=x, z=z, ground=ground)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Profile) and arrays_equal(self, other, "x", "z", "ground")

    def __hash__(self) -> int:
        return hash((self.x.tobytes(), self.z.tobytes(), self.ground.tobytes()))

    def piece(self, x: Number) -> Any:
        """Return the index of the straight piece of the polyline at `x` [m], counted from 0.

        A corner belongs to the piece towards larger x.
        """
        return np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, self.x.size - 2)

    def slope(self, x: Number) -> Any:
        """Return the slope dz/dx of the polyline at `x` [m]. A corner has the slope of the piece towards larger x."""
        k = self.piece(x)
        return (self.z[k + 1] - self.z[k]) / (self.x[k + 1] - self.x[k])

    def height(self, x: Number) -> Any:
        """Return the height z [m] of the polyline at `x` [m]; beyond its ends, the end pieces continue straight."""
        k = self.piece(x)
        return self.z[k] + (x - self.x[k]) * self.slope(x)

    def extended_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the profile's points with two points added beyond each end, in line with the end pieces (see BEYOND).

        The compiled step of the simulation needs these points, because it does not continue the end pieces by itself.

        Returns
        -------
        x, z : arrays (N+4,) [m]
            The points; N is the profile's own number of points.
        ground : array (N+3,)
            Soil index of each piece. The added pieces have the soil of the end pieces.
        """
        before, after = self.x[0] - np.array(BEYOND[::-1]), self.x[-1] + np.array(BEYOND)
        return (
            np.concatenate([before, self.x, after]),
            np.concatenate([self.height(before), self.z, self.height(after)]),
            np.concatenate([self.ground[[0, 0]], self.ground, self.ground[[-1, -1]]]),
        )

    @lru_cache(maxsize=64)  # noqa: B019 - few profiles, and small
    def without_collinear_points(self) -> Profile:
        """Return the same profile without the points inside straight runs of one soil.

        The contact of a wheel then does not depend on the number of points by which a straight run is given.
        """
        x, z, ground = self.x, self.z, self.ground
        tolerance = ROUND_OFF * max(1.0, float(np.max(np.abs(x))), float(np.max(np.abs(z))))
        # A point is a corner if it leaves the chord between its two neighbours, or if the soil changes there.
        corners = np.ones(len(x), dtype=bool)
        chord = z[:-2] + (x[1:-1] - x[:-2]) * (z[2:] - z[:-2]) / (x[2:] - x[:-2])
        corners[1:-1] = (np.abs(z[1:-1] - chord) > tolerance) | (ground[1:] != ground[:-1])
        # A curve of many small turns is not straight, although each point is nearly in line with its neighbours. Such a
        # run keeps all of its points.
        bent = np.abs(z - np.interp(x, x[corners], z[corners])) > tolerance
        run = np.cumsum(corners)
        corners |= np.isin(run, run[bent])
        return Profile(x[corners], z[corners], ground[corners[:-1]])


@final
@dataclass(frozen=True)
class Lanes(Terrain):
    """A terrain of profiles along x that lie side by side. Each profile is extruded over its own band of y, its lane.

    A wheel above the border of two lanes rests on both lanes; `terrain.section` defines how the wheel's load is
    divided.

    Parameters
    ----------
    profiles : tuple of Profile (L,)
        The profiles of the lanes, from right (low y) to left.
    borders : tuple of float (L-1,) [m]
        The y between neighbouring lanes, increasing. A border itself belongs to the lane on its right.

    Raises
    ------
    ParameterError
        There is no profile, or the borders do not increase, or their number is not L - 1.

    Examples
    --------
    A step of 5 cm under the left wheels only:

    >>> level = Profile([0.0, 1.0], [0.0, 0.0])
    >>> raised = Profile([0.0, 0.5, 0.51, 1.0], [0.0, 0.0, 0.05, 0.05])
    >>> terrain = Lanes((level, raised), (0.0,))
    >>> terrain.height(0.8, 0.3), terrain.height(0.8, -0.3)
    (0.05, 0.0)
    """

    profiles: tuple[Profile, ...]
    borders: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        profiles, borders = tuple(self.profiles), numbers("borders", self.borders)
        if not profiles or borders.shape != (len(profiles) - 1,) or np.any(np.diff(borders) <= 0.0):
            raise ParameterError(
                f"Lanes have {len(profiles)} profiles and borders at y = {borders.tolist()} m, which do not fit. "
                "Give one or more profiles, and one border between each two neighbouring profiles, in increasing order."
            )
        object.__setattr__(self, "profiles", profiles)
        object.__setattr__(self, "borders", tuple(borders.tolist()))

    def lane(self, y: Number) -> Any:
        """Return the index of the lane at `y` [m], counted from the right (low y)."""
        return np.searchsorted(self.borders, y)

    def height(self, x: Number, y: Number) -> Any:
        """Return the height of the terrain [m] at (x, y). Beyond the ends of a profile, its end pieces continue in a
        straight line.
        """
        return _plain(self._by_lane(x, y, [profile.height(x) for profile in self.profiles]))

    def gradient(self, x: Number, y: Number) -> tuple[Any, Any]:
        """Return the slopes (dz/dx, dz/dy) of the terrain at (x, y) [m].

        dz/dy is 0 everywhere, because the terrain does not change with y within a lane, and the step between two lanes
        has no slope.
        """
        slope = self._by_lane(x, y, [profile.slope(x) for profile in self.profiles])
        return _plain(slope), _plain(np.zeros_like(slope))

    def ground_at(self, x: Number, y: Number) -> Any:
        """Return the soil index at (x, y) [m]: the index of the profile's piece at x, in the lane at y."""
        return _plain(self._by_lane(x, y, [profile.ground[profile.piece(x)] for profile in self.profiles]))

    @property
    def ground_indices(self) -> frozenset[int]:
        """The soil indices that occur anywhere in the profiles of the lanes."""
        return frozenset(int(index) for profile in self.profiles for index in profile.ground)

    @property
    def mirror_symmetric(self) -> bool:
        """Whether the terrain equals its mirror image about the plane y = 0. The borders of the lanes are compared to
        1e-12 m.
        """
        borders = np.array(self.borders)
        return np.allclose(borders, -borders[::-1], rtol=0.0, atol=1e-12) and self.profiles == self.profiles[::-1]

    @property
    def extent(self) -> Extent:
        """The range of x that the points of all profiles cover [m]; y is unbounded."""
        ends = [(profile.x[0], profile.x[-1]) for profile in self.profiles]
        return Extent(float(min(low for low, _ in ends)), float(max(high for _, high in ends)), -math.inf, math.inf)

    def _by_lane(self, x: Number, y: Number, values: list[Any]) -> np.ndarray:
        """Return one value for each position (x, y): the value of the lane that contains the position.

        `values` contains one array for each lane, with that lane's values at all positions.
        """
        lane = np.broadcast_to(self.lane(y), np.broadcast_shapes(np.shape(x), np.shape(y)))
        return np.choose(lane, values)


@final
@dataclass(frozen=True, eq=False)
class HeightGrid(Terrain):
    """A terrain of heights on a regular grid, interpolated bilinearly between the grid points. Outside the grid, the
    height equals the height of the nearest point of the grid's border.

    Parameters
    ----------
    x0, y0 : float [m]
        Position of the corner z[0, 0], which has the lowest x and y.
    dx, dy : float [m]
        Spacing of the points along x and y.
    z : array (nx, ny) [m]
        Heights; nx, ny >= 2.
    ground : int or array (nx-1, ny-1), optional
        Soil index of each cell; by default 0, the model's default soil.

    Raises
    ------
    ParameterError
        A number is not finite, a spacing is not positive, an edge is steeper than 89 deg, or the shapes do not fit.

    Examples
    --------
    >>> plane = HeightGrid(0.0, 0.0, 1.0, 1.0, [[0.0, 0.2], [0.1, 0.3]])
    >>> round(plane.height(0.5, 0.5), 12)
    0.15
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
                raise ParameterError(f"A height grid has {name} of shape {value.shape}. Give one number in m.")
            object.__setattr__(self, name, float(value))
        if self.dx <= 0.0 or self.dy <= 0.0:
            raise ParameterError(
                f"A height grid has spacing dx = {self.dx:g} m, dy = {self.dy:g} m. Both must be positive."
            )
        z = numbers("z", self.z)
        if z.ndim != 2 or min(z.shape) < 2:
            raise ParameterError(
                f"A height grid has z of shape {z.shape}. Give an array (nx, ny) of heights, with nx and ny 2 or more."
            )
        # The steepest line on a bilinear cell along an axis is one of the cell's edges.
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
        """Return the height of the terrain [m] at (x, y), interpolated bilinearly between the grid points. Outside the
        grid, the result is the height of the nearest point of its border.
        """
        # Linear along x on both edges of the cell, then linear along y between the edges.
        i, j, u, v = self._cell(x, y)
        z = self.z
        low, high = z[i, j] * (1 - u) + z[i + 1, j] * u, z[i, j + 1] * (1 - u) + z[i + 1, j + 1] * u
        return _plain(low * (1 - v) + high * v)

    def gradient(self, x: Number, y: Number) -> tuple[Any, Any]:
        """Return the slopes (dz/dx, dz/dy) of the terrain at (x, y) [m].

        Outside the grid, the terrain continues at the height of the border. Therefore dz/dx is 0 if x lies outside the
        grid, and dz/dy is 0 if y lies outside.
        """
        i, j, u, v = self._cell(x, y)
        z = self.z
        slope_x = ((z[i + 1, j] - z[i, j]) * (1 - v) + (z[i + 1, j + 1] - z[i, j + 1]) * v) / self.dx
        slope_y = ((z[i, j + 1] - z[i, j]) * (1 - u) + (z[i + 1, j + 1] - z[i + 1, j]) * u) / self.dy
        # Outside, the height is constant along the direction that leads away from the grid.
        low_x, high_x, low_y, high_y = self.extent
        inside_x, inside_y = (x >= low_x) & (x <= high_x), (y >= low_y) & (y <= high_y)
        return _plain(slope_x * inside_x), _plain(slope_y * inside_y)

    def ground_at(self, x: Number, y: Number) -> Any:
        """Return the soil index of the cell at (x, y) [m]; outside the grid, the soil index of the nearest cell."""
        i, j, _, _ = self._cell(x, y)
        return _plain(self.ground[i, j])

    @cached_property
    def ground_indices(self) -> frozenset[int]:
        """The soil indices that occur in the cells of the grid."""
        return frozenset(int(index) for index in np.unique(self.ground))

    @property
    def mirror_symmetric(self) -> bool:
        """Whether the terrain equals its mirror image about the plane y = 0.

        A grid whose heights do not change with y is always symmetric, because its border continues them at every y.
        """
        # If the heights do not change with y, the position of the grid does not matter.
        level = np.allclose(self.z, self.z[:, :1], rtol=0.0, atol=1e-12) and np.all(self.ground == self.ground[:, :1])
        centred = abs(self.extent.y_low + self.extent.y_high) <= 1e-12
        mirrored = np.allclose(self.z, self.z[:, ::-1], rtol=0.0, atol=1e-12) and np.all(
            self.ground == self.ground[:, ::-1]
        )
        return bool(level or (centred and mirrored))

    @property
    def extent(self) -> Extent:
        """The box of x and y between the outermost points of the grid [m]."""
        nx, ny = self.z.shape
        return Extent(self.x0, self.x0 + (nx - 1) * self.dx, self.y0, self.y0 + (ny - 1) * self.dy)

    def _cell(self, x: Number, y: Number) -> tuple[Any, Any, Any, Any]:
        """Return the cell that contains (x, y) [m] by its indices (i, j), and the position (u, v) in this cell.

        u and v run from 0 to 1. Outside the grid, the result is the nearest point of the nearest cell.
        """
        nx, ny = self.z.shape
        u, v = np.clip((x - self.x0) / self.dx, 0.0, nx - 1.0), np.clip((y - self.y0) / self.dy, 0.0, ny - 1.0)
        i, j = np.minimum(np.floor(u).astype(int), nx - 2), np.minimum(np.floor(v).astype(int), ny - 2)
        return i, j, u - i, v - j


def slope_and_roughness(terrain: Terrain, x: np.ndarray, y: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the slope [rad] and the roughness [m] of a terrain in squares of a rover's size.

    In each square, the plane z = z_0 + a u + b v is fitted by least squares to ROUGHNESS_SAMPLES x ROUGHNESS_SAMPLES
    heights, where u and v are measured from the middle of the square. The slope is atan sqrt(a^2 + b^2), and the
    roughness is the root mean square of the heights about the plane. A height grid has no detail between its points.
    Therefore the roughness of a grid with wide cells is smaller than the roughness of the real terrain.

    Parameters
    ----------
    terrain : Terrain
        The terrain that is evaluated.
    x, y : arrays of one shape
        Middles of the squares [m].
    side : float
        Side of the squares, along x and y [m].

    Returns
    -------
    slope, roughness : arrays of the shape of x
        Inclination of the fitted plane [rad], and root mean square of the residual [m].

    Source: S. B. Goldberg, M. W. Maimone and L. Matthies, Stereo vision and rover navigation software for planetary
    exploration, IEEE Aerospace 2002: a plane is fitted to the square under the rover, and the plane's tilt and the
    residual about the plane are returned.
    """
    u = side * ((np.arange(ROUGHNESS_SAMPLES) + 0.5) / ROUGHNESS_SAMPLES - 0.5)
    x, y = (np.asarray(place, dtype=float)[..., None, None] for place in (x, y))
    z = terrain.height(x + u[:, None], y + u)
    # On a symmetric grid of samples, u, v and the constant are orthogonal: each coefficient is a plain projection.
    z = z - z.mean(axis=(-2, -1), keepdims=True)
    a, b = ((z * part).sum(axis=(-2, -1), keepdims=True) / (ROUGHNESS_SAMPLES * (u @ u)) for part in (u[:, None], u))
    residual = z - a * u[:, None] - b * u
    return np.arctan(np.hypot(a, b))[..., 0, 0], np.sqrt(np.mean(residual**2, axis=(-2, -1)))


def numbers(name: str, values: Any) -> np.ndarray:
    """Return a copy of coordinates or heights [m] as an array of floats, after checking that they are finite numbers.

    `name` is the name of the argument for the error message.

    Raises ParameterError: the values are no numbers, or a number is not finite.
    """
    try:
        raw = np.asarray(values)
        if raw.dtype.kind not in "biuf":
            raise ParameterError(f"A terrain's {name} must be numbers in m, but they are of the type {raw.dtype}.")
        array = np.array(raw, dtype=float)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"A terrain's {name} must be numbers in m: {error}.") from error
    bad = np.argwhere(~np.isfinite(array))
    if bad.size or (array.ndim == 0 and not np.isfinite(array)):
        where = f" at index {tuple(int(i) for i in bad[0])}" if array.ndim else ""
        raise ParameterError(f"A terrain's {name} has a number that is not finite{where}. Remove it or fill it in.")
    return array


def soil_indices(values: Any, shape: tuple[int, ...], owner: str, element: str) -> np.ndarray:
    """Return the soil indices of a terrain as an array of the shape `shape`. A single number is used for all elements.

    `owner` ("profile", "height grid") and `element` ("piece", "cell") are words for the error message.

    Raises ParameterError: a value is no whole number from 0 to 999, or the shape does not fit.
    """
    array = np.asarray(values)
    valid = array.dtype.kind in "iuf" and np.all((array >= 0) & (array < 1000) & (array == np.floor(array)))
    if array.shape not in ((), shape) or not valid:
        raise ParameterError(
            f"A {owner} has soil indices `ground` of shape {array.shape} that do not fit. They must be whole numbers "
            f"from 0 to 999: either one number, or an array of shape {shape} with one number for each {element}. "
            "Soil 0 is the model's default soil."
        )
    return np.array(np.broadcast_to(array, shape), dtype=np.int64)


def check_steepness(rise: np.ndarray, run: Any, where: Callable[[int], str]) -> None:
    """Check that no piece of terrain is steeper than MAX_STEEPNESS.

    Raises ParameterError: a piece is steeper.

    Parameters
    ----------
    rise : array
        Height differences of the pieces [m].
    run : float or array
        Horizontal lengths of the pieces [m].
    where : callable
        Function that describes a piece in words for the error message, given the index of the piece.
    """
    # The small tolerance admits a wall that was computed to have exactly the maximum inclination.
    angle = np.arctan2(np.abs(rise), run)
    steep = int(np.argmax(angle))
    if angle[steep] > MAX_STEEPNESS + 1e-9:
        raise ParameterError(
            f"{where(steep)} is {math.degrees(angle[steep]):.2f} deg steep; at most {math.degrees(MAX_STEEPNESS):g} "
            "deg is allowed. Make this wall less steep."
        )


def freeze(owner: Any, **arrays: np.ndarray) -> None:
    """Make arrays read-only and store them as fields of `owner`, a frozen dataclass."""
    for name, array in arrays.items():
        array.flags.writeable = False
        object.__setattr__(owner, name, array)


def arrays_equal(first: Any, second: Any, *names: str) -> bool:
    """Return whether two objects have equal arrays in all attributes of these names."""
    return all(np.array_equal(getattr(first, name), getattr(second, name)) for name in names)


def _plain(value: Any) -> Any:
    """Return an array without dimensions as a Python float or int, and any other value unchanged."""
    return value.item() if np.ndim(value) == 0 and isinstance(value, (np.ndarray, np.generic)) else value
