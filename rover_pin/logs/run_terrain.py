"""The ground under one run of a drive log: a slope, or what the run itself tells of it.

In `[terrain]`, for every run, or as `terrain = { ... }` of a `[[run]]`::

    slope = { value = 12, unit = "deg" }      # a plane that rises along the heading at the run's start
    estimated = true                          # the smoothest surface under the measured pitch, roll and height
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import scipy

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.quantity import to_si, value_and_unit
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of, corners
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.shapes import flat
from rover_pin.terrain.terrain import HeightGrid, Terrain

KEYS = ("slope", "estimated")
SLOPE_SD, HEIGHT_SD, BEND_SD = math.radians(0.5), 0.03, 0.15
"""Assumed SDs of a block's pitch and roll [rad], of its height [m], and of the ground's bend over a base [rad]."""
BLOCK = 0.5
"""Time over which pitch, roll and height are averaged [s]."""
INSTANT = 1e-5
"""A row so little before the end of a block [s] is of the next one (assumed): clocks since 1970 round to 2e-7 s."""
CELLS = 7.0
"""Cells of the grid to a wheelbase."""
MAX_CELLS = 100
"""Cells along each side at most; a run that goes further has larger ones."""
STEEPEST = math.radians(45.0)
"""Slope that is declared in another unit, or no rover's."""


def is_of_run(table: Mapping[str, Any]) -> bool:
    """Return whether a terrain's table says of each run by itself what its ground is."""
    return any(key in table for key in KEYS)


def run_terrain(table: Mapping[str, Any], run: Trace, rover: Rover, where: str) -> Terrain:
    """Return the ground of a run.

    Raises DataError: an unknown key, both a slope and an estimate, a slope that is none, or beyond 45 deg.
    """
    for key in table:
        if key not in KEYS:
            raise DataError(f"{where} has an unknown key '{key}': {closest(key, KEYS)}")
    if len(table) > 1 or table.get("estimated", True) is not True:
        raise DataError(f"{where} must have either slope = {{ value, unit }} or estimated = true.")
    return _plane(table["slope"], run, where) if "slope" in table else estimate_surface(run, rover)


def _plane(entry: Any, run: Trace, where: str) -> Terrain:
    value, unit = value_and_unit(entry, "rad")
    try:
        slope = to_si(value, unit, "rad", f"{where}: slope")
    except ParameterError as error:
        raise DataError(str(error)) from error
    if not abs(slope) < STEEPEST:
        raise DataError(f"{where}: slope = {math.degrees(slope):.4g} deg is beyond 45 deg: give value and unit.")
    x, y, yaw = (run[f"body_{name}"] for name in ("x", "y", "yaw"))
    valid = np.isfinite(x + y + yaw)
    x, y, heading = x[valid], y[valid], float(yaw[valid][0])
    middle = np.array([np.mean([x.min(), x.max()]), np.mean([y.min(), y.max()])])
    half = 5.0 + max(np.ptp(x), np.ptp(y))
    ends = np.array([-half, half])
    rise = math.tan(slope) * (math.cos(heading) * ends[:, None] + math.sin(heading) * ends[None, :])
    return HeightGrid(middle[0] - half, middle[1] - half, 2.0 * half, 2.0 * half, rise)


def estimate_surface(run: Trace, rover: Rover) -> Terrain:
    """Return the smoothest surface under a run whose slopes and heights are those measured; flat where none are.

    With z the heights at the corners of a grid, minimise

        sum (rise from the back wheels to the front / L + tan pitch)^2 / s^2 + the same across by roll and the track
        + sum (mean z under the wheels - z_0 - body_z)^2 / h^2 + sum (bends of z over L)^2 / b^2

    over all blocks, L the wheelbase, the bends those of patches of L by L: each cell has its bend, and counts by its
    share of a patch. What is shorter than the rover is smoothed out, and a zero error of the level is a
    slope of the ground. The wheels stand beside the way: were the way itself to rise as the body, bends would be small
    beside it, and the replayed rover would stand up to half a degree otherwise than the measured one.
    """
    blocks = _blocks(run)
    if blocks is None:
        return flat()
    base = max(base_of(rover))
    x, y, yaw = blocks["body_x"], blocks["body_y"], blocks["body_yaw"]
    grid = _Grid.around(x, y, max(base, float(np.max(np.linalg.norm(corners(rover), axis=-1)))))
    bends = grid.bends()
    rows, right = [bends / BEND_SD], [np.zeros(bends.shape[0])]
    under = _under(grid.at, rover, np.array([x, y, yaw]))
    for name, sign, rise in (("body_pitch", -1.0, under[0]), ("body_roll", 1.0, under[1])):
        if name in blocks:
            use = np.isfinite(blocks[name])
            rows.append(rise[use] / SLOPE_SD)
            right.append(sign * np.tan(np.clip(blocks[name][use], -STEEPEST, STEEPEST)) / SLOPE_SD)
    if "body_z" in blocks:
        use = np.isfinite(blocks["body_z"])
        rows.append(under[2][use] / HEIGHT_SD)
        right.append((blocks["body_z"][use] - np.mean(blocks["body_z"][use])) / HEIGHT_SD)
    return grid.surface(scipy.sparse.vstack(rows).tocsr(), np.concatenate(right))


def level_on(ground: Terrain, rover: Rover, place: np.ndarray) -> dict[str, np.ndarray]:
    """Return pitch, roll [rad] and height [m] of a rover that stands rigid on a ground, at x, y, yaw (T, 3)."""
    ahead, left, height = _under(ground.height, rover, place.T)
    return {"body_pitch": -np.arctan(ahead), "body_roll": np.arctan(left), "body_z": np.asarray(height)}


def _under(height: Callable[..., Any], rover: Rover, place: np.ndarray) -> tuple[Any, Any, Any]:
    """Return the rise ahead and to the left under the wheels, and their mean height, at x, y, yaw (3, T).

    `height` gives the heights at places, or the rows of weights that make them.
    """
    x, y, yaw = place
    (c, s), (length, track) = (np.cos(yaw), np.sin(yaw)), base_of(rover)
    (fl, fr), (bl, br) = ([height(x + c * a - s * b, y + s * a + c * b) for a, b in axle] for axle in corners(rover))
    ahead, left = (fl + fr - bl - br) / (2.0 * length), (fl + bl - fr - br) / (2.0 * track)
    return ahead, left, (fl + fr + bl + br) / 4.0


def _blocks(run: Trace) -> dict[str, np.ndarray] | None:
    """Return means over BLOCK of the pose where it is known; None where neither slope nor height was measured.

    A row on the border of two blocks is of the later one, also where its time was rounded.
    """
    names = [name for name in ("body_pitch", "body_roll", "body_z") if name in run and np.isfinite(run[name]).any()]
    if "body_pitch" not in names and "body_z" not in names:
        return None
    place = [run[f"body_{name}"] for name in ("x", "y", "yaw")]
    use = np.all(np.isfinite(place), axis=0)
    at = np.floor((run.t[use] - run.t[0] + INSTANT) / BLOCK).astype(int)
    _, at = np.unique(at, return_inverse=True)
    count = np.bincount(at)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(at, values[use]) / count

    return {name: mean(run[name]) for name in ("body_x", "body_y", "body_yaw", *names)}


class _Grid:
    """A grid of corners, and rows of weights on their heights."""

    def __init__(self, x0: float, y0: float, size: float, nx: int, ny: int):
        self.x0, self.y0, self.size, self.nx, self.ny = x0, y0, size, nx, ny

    @classmethod
    def around(cls, x: np.ndarray, y: np.ndarray, base: float) -> _Grid:
        """Return the grid that holds a way with a base of the rover around it."""
        size = max(base / CELLS, (max(np.ptp(x), np.ptp(y)) + 2.0 * base) / MAX_CELLS)
        nx, ny = (math.ceil((np.ptp(coordinate) + 2.0 * base) / size) + 1 for coordinate in (x, y))
        return cls(float(x.min()) - base, float(y.min()) - base, size, nx, ny)

    def at(self, x: np.ndarray, y: np.ndarray) -> scipy.sparse.csr_matrix:
        """Return the rows that interpolate at places, bilinear."""
        u, v = (x - self.x0) / self.size, (y - self.y0) / self.size
        i = np.clip(np.floor(u).astype(int), 0, self.nx - 2)
        j = np.clip(np.floor(v).astype(int), 0, self.ny - 2)
        a, b = u - i, v - j
        weights = np.concatenate([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b])
        corner = i * self.ny + j
        columns = np.concatenate([corner, corner + self.ny, corner + 1, corner + self.ny + 1])
        return scipy.sparse.coo_matrix(
            (weights, (np.tile(np.arange(len(x)), 4), columns)), (len(x), self.nx * self.ny)
        ).tocsr()

    def bends(self) -> scipy.sparse.csr_matrix:
        """Return the second differences along both axes and the mixed one, each over the spacing: bends [rad]."""
        along = [scipy.sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(n - 2, n)) for n in (self.nx, self.ny)]
        step = [scipy.sparse.diags([-1.0, 1.0], [0, 1], shape=(n - 1, n)) for n in (self.nx, self.ny)]
        identity = [scipy.sparse.diags([1.0], [0], shape=(n, n)) for n in (self.nx, self.ny)]
        kron = scipy.sparse.kron
        rows = [kron(along[0], identity[1]), kron(identity[0], along[1]), kron(step[0], step[1]) * math.sqrt(2.0)]
        return scipy.sparse.vstack([row for row in rows if row.shape[0]]).tocsr() / self.size

    def surface(self, rows: scipy.sparse.csr_matrix, right: np.ndarray) -> HeightGrid:
        """Return the surface of least squares, its mean height 0."""
        normal = (rows.T @ rows).tocsc()
        normal = normal + scipy.sparse.diags(np.full(normal.shape[0], 1e-9 * normal.diagonal().max()))
        z = np.asarray(scipy.sparse.linalg.spsolve(normal.tocsc(), rows.T @ right)).reshape(self.nx, self.ny)
        return HeightGrid(self.x0, self.y0, self.size, self.size, z - z.mean())
