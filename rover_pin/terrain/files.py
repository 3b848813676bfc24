"""Terrains in files: a polyline along x, or a height grid."""

import io
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from rover_pin.base.arguments import check_arguments, spec
from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.bounded import arrays
from rover_pin.base.files.columns import Columns, columns_text, read_columns
from rover_pin.base.files.whole_file import replace_file
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.raster import SUFFIXES, raster_grid
from rover_pin.terrain.terrain import HeightGrid, Lanes

LARGEST = 1000.0
"""A coordinate beyond this [m] is taken for a mistake of units."""
SAME_SPACING = 1e-3
"""Greatest deviation of a grid line from its place, as a share of the spacing."""


def from_polyline(path: Annotated[str | Path, spec("", "your own file: CSV or Parquet of x_m, z_m")]) -> Lanes:
    """Return the terrain of a CSV (or Parquet) file with columns x_m, z_m and, optionally, ground.

    x_m increases; ground is the soil index of the piece from this point to the next (that of the last row is not used).

    Raises DataError: a missing column, a number that is missing or not finite, x_m not increasing, values that look
    like millimetres, or ground that `Profile` refuses.
    """
    table = read_columns(path)
    table.need("x_m", "z_m")
    table.refuse_gaps(*(name for name in ("x_m", "z_m", "ground") if name in table.values))
    _refuse_millimetres(table, "x_m", "z_m")
    table.refuse_steps_back("x_m")
    x, z = table.need("x_m", "z_m")
    try:
        return Lanes((Profile(x, z, table.values.get("ground", np.zeros(x.size))[:-1]),))
    except ParameterError as error:
        raise DataError(f"{path}: {error}") from error


def to_polyline(path: str | Path, profile: Profile) -> Path:
    """Write a profile to a CSV file that `from_polyline` reads; return its path."""
    ground = np.append(profile.ground, profile.ground[-1])
    return replace_file(path, columns_text({"x_m": profile.x, "z_m": profile.z, "ground": ground}))


@check_arguments("terrain")
def from_grid(
    path: Annotated[str | Path, spec("", "your own file: heights in .npz, CSV, GeoTIFF, .npy or a grey .png")],
    cell: Annotated[float, spec("m", "0: as the file says; .npy and .png do not", 0.0, LARGEST)] = 0.0,
    relief: Annotated[float, spec("m", "0: as the file says; of a .png white above black", 0.0, LARGEST)] = 0.0,
) -> HeightGrid:
    """Return the terrain of a height grid.

    `.tif`, `.npy`, `.png`: see `raster`; `cell` is the width of a pixel, `relief` the height of white above black.
    `.npz`: arrays x0, y0, dx, dy [m], z (nx, ny) [m] and, optionally, ground (nx-1, ny-1).
    Otherwise CSV (or Parquet) with columns x_m, y_m, z_m and, optionally, ground: one row a point of a full, evenly
    spaced grid, in any order; ground is the soil index of the cell that has the point as its corner of lowest x and y.

    Raises DataError: a missing column or array, a number that is missing or not finite, points that make no full even
    grid, values that look like millimetres, or what `raster_grid` or `HeightGrid` refuses.
    Raises MissingExtraError: a GeoTIFF where rasterio is not installed.
    """
    try:
        if Path(path).suffix.lower() in SUFFIXES or cell or relief:
            return raster_grid(Path(path), cell, relief)
        return _npz_grid(Path(path)) if Path(path).suffix == ".npz" else _column_grid(read_columns(path))
    except ParameterError as error:
        raise DataError(f"{path}: {error}") from error


def to_grid(path: str | Path, grid: HeightGrid) -> Path:
    """Write a height grid to an `.npz` file that `from_grid` reads; return its path."""
    content = io.BytesIO()
    np.savez_compressed(content, x0=grid.x0, y0=grid.y0, dx=grid.dx, dy=grid.dy, z=grid.z, ground=grid.ground)
    return replace_file(path, content.getvalue())


def _npz_grid(path: Path) -> HeightGrid:
    try:
        table = arrays(path)
    except OSError as error:
        raise DataError(f"{path}: the file cannot be read: {error.strerror or error}.") from error
    except Exception as error:  # whatever numpy and zipfile raise for a damaged archive
        raise DataError(
            f"{path}: the file is not an .npz of plain arrays ({error}): write it with numpy.savez or `to_grid`."
        ) from error
    for name in ("x0", "y0", "dx", "dy", "z"):
        if name not in table:
            there = ", ".join(sorted(table)) or "none"
            raise DataError(
                f"{path}: there is no array '{name}', only {there}: give the corner x0, y0 "
                "and the steps dx, dy [m], one number each, and the heights z (nx, ny) [m]."
            )
    fields: dict[str, Any] = {name: table[name] for name in ("x0", "y0", "dx", "dy", "z", "ground") if name in table}
    grid = HeightGrid(**fields)
    _refuse_large(path, "z", grid.z)
    return grid


def _column_grid(table: Columns) -> HeightGrid:
    x, y, z = table.need("x_m", "y_m", "z_m")
    table.refuse_gaps(*(name for name in ("x_m", "y_m", "z_m", "ground") if name in table.values))
    _refuse_millimetres(table, "x_m", "y_m", "z_m")
    x0, dx, i = _lattice(table, "x_m", x)
    y0, dy, j = _lattice(table, "y_m", y)
    shape = (int(i.max()) + 1, int(j.max()) + 1)
    point, rows = _not_once(i * shape[1] + j, shape[0] * shape[1])
    if rows != 1:
        x_at, y_at = x0 + point // shape[1] * dx, y0 + point % shape[1] * dy
        raise DataError(
            f"{table.path}: {rows} rows for x = {x_at:g} m, y = {y_at:g} m; "
            f"the {shape[0]} by {shape[1]} grid needs exactly one row a point."
        )
    height, ground = np.empty(shape), np.zeros(shape)
    height[i, j] = z
    ground[i, j] = table.values.get("ground", np.zeros(z.size))
    return HeightGrid(x0, y0, dx, dy, height, ground[:-1, :-1])


def _not_once(points: np.ndarray, count: int) -> tuple[int, int]:
    """Return the first of `count` points that has not one row, and how many it has; 1 where all have one.

    Takes memory for the rows only: a few scattered ones would span a grid of their square.
    """
    present, rows = np.unique(points, return_counts=True)
    missing = np.flatnonzero(present != np.arange(present.size))
    first = int(missing[0]) if missing.size else present.size
    twice = np.flatnonzero(rows[:first] > 1)
    if twice.size:
        return int(twice[0]), int(rows[twice[0]])
    return first, int(first >= count)


def _lattice(table: Columns, name: str, values: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Return start, spacing and every row's index; the widest step is the spacing, up to rounding in the file."""
    low, high = float(values.min()), float(values.max())
    if low == high:
        raise DataError(f"{table.path}: column '{name}' is {low:g} m everywhere; a grid needs two values at least.")
    spacing = (high - low) / round((high - low) / float(np.max(np.diff(np.unique(values)))))
    index = np.rint((values - low) / spacing).astype(int)
    off = np.abs(values - low - index * spacing) / spacing
    if np.max(off) > SAME_SPACING:
        worst = int(np.argmax(off))
        raise DataError(
            f"{table.path}, {table.places[worst]}: column '{name}' = {values[worst]:g} m is not on a grid of spacing "
            f"{spacing:g} m from {low:g} m: resample the heights evenly."
        )
    return low, spacing, index


def _refuse_millimetres(table: Columns, *names: str) -> None:
    for name in names:
        _refuse_large(table.path, f"column '{name}'", table.values[name])


def _refuse_large(path: Path, name: str, values: np.ndarray) -> None:
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest > LARGEST:
        raise DataError(
            f"{path}: {name} reaches {largest:g} m, which looks like millimetres; "
            f"give metres, within {LARGEST:g} m of 0."
        )
