"""Give one run of a drive log its own terrain: a declared slope, or the surface estimated from the run's sensors.

The table `[terrain]` of drive.toml applies to every run, and `terrain = { ... }` of a `[[run]]` to this run alone::

    slope = { value = 12, unit = "deg" }      # a plane that rises along the heading at the run's start
    estimated = true                          # the smoothest surface under the measured pitch, roll and height
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy

from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.quantity import to_si, value_and_unit
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import base_of, corners, wheel_places
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.shapes import flat
from rover_pin.terrain.terrain import HeightGrid, Terrain

KEYS = ("slope", "estimated")
"""Keys of a terrain table that give each run a terrain of its own instead of one terrain for the whole log."""
SLOPE_SD, HEIGHT_SD, BEND_SD = math.radians(0.5), 0.03, 0.15
"""Assumed SDs of three quantities of the terrain estimate: mean pitch and roll over half a second [rad], mean height
over half a second [m], and change of the terrain's slope over one wheelbase [rad]."""
BLOCK = 0.5
"""Duration of the intervals over which pitch, roll and height are averaged before the terrain is estimated [s]. Longer
intervals would smooth the terrain more; shorter intervals would leave more noise and more equations."""
ROUND_OFF = 1e-5
"""Maximum time before the end of an averaging interval [s] at which a row still belongs to the next interval, because
its time may be rounded down. Clocks that count from 1970 are rounded to 2e-7 s (assumed)."""
CELLS = 7.0
"""Number of grid cells per wheelbase in the estimated terrain. Features shorter than the rover are smoothed away, so
more cells would only take more time."""
MAX_CELLS = 100
"""Maximum number of grid cells along each side of the estimated terrain. For a longer run, the cells become larger, so
that at most about ten thousand heights are unknown."""
PLANE_SD = math.tan(math.radians(15.0))
"""Assumed prior SD of the mean slope of the ground over the extent of a drive. Without it, the bends alone would leave
every plane free, and the probability of a terrain would not be defined."""
MAX_MODES = 48
"""Maximum number of shapes that describe the error of an estimated terrain. Each shape costs one replay of each run.

The shapes with the largest prior variance of the slopes under the wheels are kept. Along a path of the length T, n
shapes resolve wavelengths down to about 4 T / n, because half of the shapes differ between left and right."""
MODE_POSES = 120
"""Maximum number of poses of the rover, evenly distributed over all runs, at which the slopes under the wheels are
computed to choose the shapes. The value limits the size of the matrices; poses lie closer than a wheelbase."""
MAX_SLOPE = math.radians(45.0)
"""Limit of a declared slope [rad]. A slope of this size or more is refused, because the slope is probably stated in
another unit."""


def is_of_run(table: Mapping[str, Any]) -> bool:
    """Return whether a terrain table gives each run its own terrain, that is, whether it has the key `slope` or
    `estimated`.
    """
    return any(key in table for key in KEYS)


def run_terrain(table: Mapping[str, Any], run: Trace, rover: Rover, where: str) -> Terrain:
    """Return the terrain of one run: a plane with the declared slope, or the surface estimated from the run's sensors.

    Parameters
    ----------
    table : mapping
        Either `slope` = { value, unit }, or `estimated` = true.
    run : Trace
        The measured run. A declared slope rises along the first heading of this run.
    rover : Rover
        The rover, whose wheelbase and track are used for the estimate.
    where : str
        Place of the table, for error messages.

    Raises
    ------
    DataError
        The table has an unknown key, or both a slope and an estimate, or its slope is not an angle or not below 45 deg.
    """
    for key in table:
        if key not in KEYS:
            raise DataError(f"{where} has an unknown key '{key}': {closest(key, KEYS)}")
    # A declared slope and an estimated terrain exclude each other.
    if len(table) > 1 or table.get("estimated", True) is not True:
        raise DataError(
            f"{where} must have either slope = {{ value = 12, unit = 'deg' }} or estimated = true, and not both."
        )
    if "slope" not in table:
        return estimate_surface(run, rover)
    # A declared slope is a plane through the middle of the run's positions, which rises along the first heading.
    value, unit = value_and_unit(table["slope"], "rad")
    try:
        slope = to_si(value, unit, "rad", f"{where}: slope")
    except ParameterError as error:
        raise DataError(str(error)) from error
    if not abs(slope) < MAX_SLOPE:
        raise DataError(
            f"{where}: slope = {math.degrees(slope):.4g} deg must be below 45 deg: check its number and its unit."
        )
    x, y, yaw = (run[f"body_{name}"] for name in ("x", "y", "yaw"))
    valid = np.isfinite(x + y + yaw)
    x, y, heading = x[valid], y[valid], float(yaw[valid][0])
    middle = np.array([np.mean([x.min(), x.max()]), np.mean([y.min(), y.max()])])
    # The plane extends beyond the run, because a simulated rover may drive farther than the measured one.
    half = 5.0 + max(np.ptp(x), np.ptp(y))
    ends = np.array([-half, half])
    rise = math.tan(slope) * (math.cos(heading) * ends[:, None] + math.sin(heading) * ends[None, :])
    return HeightGrid(middle[0] - half, middle[1] - half, 2.0 * half, 2.0 * half, rise)


@dataclass(frozen=True, eq=False)
class GroundEstimate:
    """The terrain under one or several runs that was estimated from the runs' pitch, roll and height, with its prior.

    The true terrain is this estimate plus sum_j e_j shapes_j, where the e_j are independent before the measurements of
    the runs, with mean 0 and SD 1. A fit that compares pitch, roll and height finds the e_j together with the pitch and
    the sinkage of the rover itself.
    """

    terrain: HeightGrid
    shapes: np.ndarray = field(repr=False)
    """changes of the heights of the terrain's grid [m] (shapes, nx, ny)"""
    log_evidence: float
    """log of the probability density of the measured pitch, roll and height under the prior of the terrain, for the
    comparison of one terrain for all runs with one terrain for each run"""

    def moved(self, shape: int, size: float) -> HeightGrid:
        """Return the terrain after adding the shape with the index `shape`, multiplied by `size`."""
        grid = self.terrain
        return HeightGrid(grid.x0, grid.y0, grid.dx, grid.dy, grid.z + size * self.shapes[shape])

    def slopes_along(self, x: np.ndarray, y: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """Return the slope of each shape along the heading `yaw` [rad] at the positions x, y [m] (T, shapes); NaN where
        a position or heading is NaN.
        """
        grid = self.terrain
        columns = []
        for shape in self.shapes:
            slope_x, slope_y = HeightGrid(grid.x0, grid.y0, grid.dx, grid.dy, shape).gradient(
                *(np.where(np.isfinite(x + y), place, 0.0) for place in (x, y))
            )
            columns.append(slope_x * np.cos(yaw) + slope_y * np.sin(yaw) + 0.0 * (x + y))
        return np.array(columns).T


def estimate_surface(run: Trace, rover: Rover) -> Terrain:
    """Return the smoothest terrain under a run that agrees with its pitch, roll and height; flat if neither pitch nor
    height was measured. `estimate_ground` describes the estimate.
    """
    estimate = estimate_ground([run], rover)
    return flat() if estimate is None else estimate.terrain


def shared_grounds(runs: Sequence[Trace], rover: Rover) -> list[tuple[list[int], GroundEstimate]]:
    """Return the estimated terrains under several runs, each with the indices of the runs that drive over it.

    Runs that pass the same place have one terrain, if the measurements of all of them are more probable with one
    terrain than with a terrain for each run. They are less probable if the ground was prepared anew between the runs,
    or if the positions of the runs have different origins. Runs without pitch and height have no terrain and are
    omitted.
    """
    alone = [estimate_ground([run], rover) for run in runs]
    groups: list[tuple[list[int], GroundEstimate]] = []
    for index, estimate in enumerate(alone):
        if estimate is None:
            continue
        # The run joins the group with which its measurements gain most, if they gain at all.
        joined, gain = None, 0.0
        for place, (members, ground) in enumerate(groups):
            if not any(_pass_same_place(runs[member], runs[index], rover) for member in members):
                continue
            together = estimate_ground([runs[member] for member in (*members, index)], rover)
            assert together is not None
            more = together.log_evidence - ground.log_evidence - estimate.log_evidence
            if more > gain:
                joined, gain = (place, together), more
        if joined is None:
            groups.append(([index], estimate))
        else:
            place, together = joined
            groups[place] = ([*groups[place][0], index], together)
    return groups


def _pass_same_place(first: Trace, second: Trace, rover: Rover) -> bool:
    """Return whether the paths of two runs come closer to each other than the track of the rover."""
    paths = []
    for run in (first, second):
        blocks = _blocks(run)
        assert blocks is not None
        paths.append(np.array([blocks["body_x"], blocks["body_y"]]))
    distances = np.hypot(*(paths[0][:, :, None] - paths[1][:, None, :]))
    return bool(distances.min() < base_of(rover).track)


def estimate_ground(runs: Sequence[Trace], rover: Rover) -> GroundEstimate | None:
    """Return the smoothest terrain under some runs that agrees with their pitch, roll and height; None if neither pitch
    nor height was measured in one of the runs.

    The unknowns z are the heights at the corners of a grid. They minimise

        sum (rise from the back wheels to the front / L + tan pitch)^2 / s^2 + the same across, with roll and track
        + sum (mean z under the wheels - z_0 - body_z)^2 / h^2 + sum (changes of slope of z over L)^2 / b^2

    where the first three sums run over all averaging intervals of BLOCK seconds. L is the wheelbase, z_0 the mean
    height, and s, h, b are SLOPE_SD, HEIGHT_SD and BEND_SD. The changes of slope are second differences of the heights.
    The last sum runs over patches of L by L, so each grid cell counts by its fraction of the area of a patch. Features
    shorter than the rover are smoothed away, and a constant error of the attitude sensor becomes a slope of the
    terrain.

    The rises are taken under the wheels on both sides, and not along the path of the body. Otherwise the surface could
    be smooth along the path and rough under the wheels, and the pitch and roll of a simulated rover on this surface
    would differ from the measured angles by up to half a degree.

    The last sum is the prior of the terrain: a smooth random field whose slope changes by b over a wheelbase. The prior
    also limits the heights themselves (PLANE_SD). The shapes of the result are the principal components of this field
    for the slopes under the wheels along the paths of the runs (Karhunen-Loeve expansion), the largest first.

    Parameters
    ----------
    runs : sequence of Trace
        The measured runs with body_x, body_y, body_yaw and, if measured, body_pitch, body_roll, body_z.
    rover : Rover
        Positions of the outer wheels.

    Returns
    -------
    GroundEstimate
        Its terrain is a grid of heights with mean 0.
    """
    of_runs = [_blocks(run) for run in runs]
    blocks_of_runs = [blocks for blocks in of_runs if blocks is not None]
    if len(blocks_of_runs) < len(runs):
        return None
    base = max(base_of(rover))
    x, y, yaw = (np.concatenate([blocks[f"body_{name}"] for blocks in blocks_of_runs]) for name in ("x", "y", "yaw"))
    # The margin around the path is at least the distance from the base to the outermost wheel, so every wheel stands on
    # the grid.
    grid = _Grid.around(x, y, max(base, float(np.max(np.linalg.norm(corners(rover), axis=-1)))))
    bends = grid.bends() / BEND_SD
    # Each row of the least-squares problem is divided by its SD.
    rows, right, log_sds = [], [], 0.0
    for blocks in blocks_of_runs:
        under = _under(grid.at, rover, np.array([blocks[f"body_{name}"] for name in ("x", "y", "yaw")]))
        # Positive pitch is nose down, so that the rise ahead is -tan(pitch); positive roll lowers the right side.
        for name, sign, rise in (("body_pitch", -1.0, under[0]), ("body_roll", 1.0, under[1])):
            if name in blocks:
                use = np.isfinite(blocks[name])
                rows.append(rise[use] / SLOPE_SD)
                right.append(sign * np.tan(np.clip(blocks[name][use], -MAX_SLOPE, MAX_SLOPE)) / SLOPE_SD)
                log_sds += float(use.sum()) * math.log(SLOPE_SD)
        # Only the variation of the height within a run counts; its mean is arbitrary.
        if "body_z" in blocks:
            use = np.isfinite(blocks["body_z"])
            heights = under[2][use]
            if len(runs) > 1:
                heights = heights - scipy.sparse.csr_matrix(np.ones((use.sum(), 1))) @ heights.mean(axis=0)
            rows.append(scipy.sparse.csr_matrix(heights) / HEIGHT_SD)
            right.append((blocks["body_z"][use] - np.mean(blocks["body_z"][use])) / HEIGHT_SD)
            log_sds += float(use.sum()) * math.log(HEIGHT_SD)
    measured, values = scipy.sparse.vstack(rows).tocsr(), np.concatenate(right)
    terrain = grid.surface(scipy.sparse.vstack([bends, measured]).tocsr(), np.r_[np.zeros(bends.shape[0]), values])
    # The prior precision: the bends, and the limit of the heights that makes it regular. A plane with the slope s over
    # the length T has the sum of squared heights N (s T)^2 / 12 over N corners, and the prior density of s / PLANE_SD.
    count, length = grid.nx * grid.ny, grid.size * max(grid.nx, grid.ny)
    limit = 12.0 / (count * (PLANE_SD * length) ** 2)
    prior = (bends.T @ bends + limit * scipy.sparse.identity(count)).tocsc()
    log_evidence = _log_density(prior, measured, values) - log_sds
    return GroundEstimate(terrain, _shapes(grid, prior, np.array([x, y, yaw]), rover), log_evidence)


def _log_density(prior: scipy.sparse.csc_matrix, rows: scipy.sparse.csr_matrix, right: np.ndarray) -> float:
    """Return ln N(right; 0, I + rows Q^-1 rows') without its constant, for the prior precision Q of the heights.

    With the posterior precision P = Q + rows' rows, the determinant is |P| / |Q|, and the quadratic form is
    |right|^2 - (rows' right)' P^-1 (rows' right).
    """
    before, after = (scipy.sparse.linalg.splu(matrix.tocsc()) for matrix in (prior, prior + rows.T @ rows))
    log_ratio = sum(sign * float(np.log(np.abs(lu.U.diagonal())).sum()) for sign, lu in ((1.0, after), (-1.0, before)))
    projected = rows.T @ right
    return -0.5 * (log_ratio + float(right @ right - projected @ after.solve(projected)))


def _shapes(grid: _Grid, prior: scipy.sparse.csc_matrix, place: np.ndarray, rover: Rover) -> np.ndarray:
    """Return the principal components of a prior field of heights, for the slopes under the wheels at given poses.

    Each component is a change of the grid's heights with the prior SD of 1 (shapes, nx, ny). `prior` is the precision
    of the heights, and `place` (3, T) holds x [m], y [m] and yaw [rad] of the body.
    """
    x, y, yaw = place[:, :: math.ceil(place.shape[1] / MODE_POSES)]
    # Slope along the heading under each wheel, over the length of the wheel, at each pose.
    rows = []
    for wheel in rover.wheels:
        a, b, _ = wheel_places(rover)[wheel.name]
        r = float(wheel.wheel.r)
        ahead, behind = (
            grid.at(x + np.cos(yaw) * (a + step) - np.sin(yaw) * b, y + np.sin(yaw) * (a + step) + np.cos(yaw) * b)
            for step in (r, -r)
        )
        rows.append((ahead - behind) / (2.0 * r))
    slopes = scipy.sparse.vstack(rows).tocsr()
    spread = scipy.sparse.linalg.splu(prior).solve(slopes.T.toarray())
    values, vectors = np.linalg.eigh(slopes @ spread)
    # The eigenvalues ascend. Those of rounding are dropped.
    kept = np.flatnonzero(values > 1e-9 * values[-1])[::-1][:MAX_MODES]
    heights = spread @ vectors[:, kept] / np.sqrt(values[kept])
    return np.asarray(heights.T.reshape(len(kept), grid.nx, grid.ny))


def level_on(ground: Terrain, rover: Rover, place: np.ndarray) -> dict[str, np.ndarray]:
    """Return the pitch [rad], roll [rad] and height [m] that a rigid rover would have on a terrain at given poses.

    Parameters
    ----------
    ground : Terrain
        The terrain.
    rover : Rover
        Positions of the outer wheels.
    place : array (T, 3)
        x [m], y [m] and yaw [rad] of the body.

    Returns
    -------
    dict
        body_pitch, body_roll and body_z, each (T,).
    """
    ahead, left, height = _under(ground.height, rover, place.T)
    return {"body_pitch": -np.arctan(ahead), "body_roll": np.arctan(left), "body_z": np.asarray(height)}


def _under(height: Callable[..., Any], rover: Rover, place: np.ndarray) -> tuple[Any, Any, Any]:
    """Return the terrain's slope ahead, its slope to the left, and its mean height under the outer wheels of a rover.

    Each of the three results has one entry for each of the T poses.

    Parameters
    ----------
    height : callable
        Function of x and y that returns the terrain heights at these points, or the rows of weights that interpolate
        the heights of the grid at these points.
    place : array (3, T)
        x [m], y [m] and yaw [rad] of the body.
    """
    x, y, yaw = place
    # Positions of the outer wheels are rotated by the yaw into the map.
    (c, s), (length, track) = (np.cos(yaw), np.sin(yaw)), base_of(rover)
    (fl, fr), (bl, br) = ([height(x + c * a - s * b, y + s * a + c * b) for a, b in axle] for axle in corners(rover))
    ahead, left = (fl + fr - bl - br) / (2.0 * length), (fl + bl - fr - br) / (2.0 * track)
    return ahead, left, (fl + fr + bl + br) / 4.0


def _blocks(run: Trace) -> dict[str, np.ndarray] | None:
    """Return the means of pose and attitude over intervals of BLOCK seconds; None if neither pitch nor height was
    measured.

    Rows without a position are omitted. A row at the border of two intervals belongs to the later one, even if its time
    was rounded down.
    """
    # Pitch or height alone determines slopes along the path; roll alone does not.
    names = [name for name in ("body_pitch", "body_roll", "body_z") if name in run and np.isfinite(run[name]).any()]
    if "body_pitch" not in names and "body_z" not in names:
        return None
    place = [run[f"body_{name}"] for name in ("x", "y", "yaw")]
    use = np.all(np.isfinite(place), axis=0)
    at = np.floor((run.t[use] - run.t[0] + ROUND_OFF) / BLOCK).astype(int)
    _, at = np.unique(at, return_inverse=True)
    count = np.bincount(at)

    def mean(values: np.ndarray) -> np.ndarray:
        """Return the mean of a channel over each interval (intervals,)."""
        return np.bincount(at, values[use]) / count

    return {name: mean(run[name]) for name in ("body_x", "body_y", "body_yaw", *names)}


class _Grid:
    """Grid of nx by ny corners with the spacing `size` [m], and the sparse matrices that act on the heights of the
    corners.
    """

    def __init__(self, x0: float, y0: float, size: float, nx: int, ny: int):
        self.x0, self.y0, self.size, self.nx, self.ny = x0, y0, size, nx, ny

    @classmethod
    def around(cls, x: np.ndarray, y: np.ndarray, base: float) -> _Grid:
        """Return the grid that covers the path (x, y) of a run and a margin of `base` [m] around the path."""
        size = max(base / CELLS, (max(np.ptp(x), np.ptp(y)) + 2.0 * base) / MAX_CELLS)
        nx, ny = (math.ceil((np.ptp(coordinate) + 2.0 * base) / size) + 1 for coordinate in (x, y))
        return cls(float(x.min()) - base, float(y.min()) - base, size, nx, ny)

    def at(self, x: np.ndarray, y: np.ndarray) -> scipy.sparse.csr_matrix:
        """Return the matrix that interpolates the grid's heights bilinearly at given points.

        The matrix is sparse and has the shape (points, corners).
        """
        # Position in units of cells; the cell index is clipped to the grid, so that points outside extrapolate.
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
        """Return the matrix that maps the grid's heights to the changes of the terrain's slope between neighbouring
        cells [rad].

        The rows of the sparse matrix are the changes of the x slope along x, the changes of the y slope along y, and
        the changes of the x slope along y, multiplied by sqrt(2).
        """
        # Kronecker products apply the one-dimensional differences along each axis of the grid.
        along = [scipy.sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(n - 2, n)) for n in (self.nx, self.ny)]
        step = [scipy.sparse.diags([-1.0, 1.0], [0, 1], shape=(n - 1, n)) for n in (self.nx, self.ny)]
        identity = [scipy.sparse.diags([1.0], [0], shape=(n, n)) for n in (self.nx, self.ny)]
        kron = scipy.sparse.kron
        rows = [kron(along[0], identity[1]), kron(identity[0], along[1]), kron(step[0], step[1]) * math.sqrt(2.0)]
        return scipy.sparse.vstack([row for row in rows if row.shape[0]]).tocsr() / self.size

    def surface(self, rows: scipy.sparse.csr_matrix, right: np.ndarray) -> HeightGrid:
        """Return the grid of heights z that solves rows z = right by least squares, shifted so that its mean height is
        0.
        """
        normal = (rows.T @ rows).tocsc()
        # The mean height is undetermined, so a tiny diagonal makes the matrix regular.
        normal = normal + scipy.sparse.diags(np.full(normal.shape[0], 1e-9 * normal.diagonal().max()))
        z = np.asarray(scipy.sparse.linalg.spsolve(normal.tocsc(), rows.T @ right)).reshape(self.nx, self.ny)
        return HeightGrid(self.x0, self.y0, self.size, self.size, z - z.mean())
