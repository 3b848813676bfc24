"""Read and write terrains in files: the table `[terrain]` of a drive log or model, polylines along x, and height grids.

[terrain]
polyline = "ground.csv"                   # x_m, z_m[, ground], extruded sideways
# or: polylines = ["right.csv", "left.csv"] and borders = [0.0], the y [m] between them
# or: grid = "ground.npz", a .tif or .asc, or a .npy, .mat, .csv or .png with cell = 0.1 [m]; a .png also needs
#     relief = 2.0 [m]; missing = "fill" or "cut" decides about cells without a height
patch = [{ x_from = 1.0, x_to = 2.0, ground = 1 }]   # stretches of another soil
"""

import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from rover_pin.base.arguments import check_arguments, spec
from rover_pin.base.errors import DataError, ParameterError, closest
from rover_pin.base.files.bounded import arrays
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.table import Columns, columns_text, read_columns
from rover_pin.base.files.whole_file import replace_file
from rover_pin.base.quantity import as_float
from rover_pin.base.trust import Trust
from rover_pin.terrain.edits import with_ground
from rover_pin.terrain.raster import SUFFIXES, is_esri_grid, raster_grid
from rover_pin.terrain.terrain import HeightGrid, Lanes, Profile, Terrain

KINDS = ("polyline", "polylines", "grid")
"""Keys of the table `[terrain]` that give the terrain's files: one profile, several profiles, or a height grid. A table
has exactly one of these keys."""
GRID_OPTIONS = ("cell", "relief", "missing")
"""Keys of the table `[terrain]` that are passed to `from_grid` as arguments."""
KEYS = (*KINDS, *GRID_OPTIONS, "borders", "patch")
PATCH_KEYS = ("x_from", "x_to", "ground")
"""All keys that the table `[terrain]` may have (KEYS), and all keys that one of its patches may have (PATCH_KEYS). Any
other key is refused."""
LARGEST = 1000.0
"""Maximum coordinate [m] in a terrain file. A file with a larger coordinate is refused, because its numbers are
probably in millimetres: rover drives are shorter than 1 km."""
SPACING_TOLERANCE = 1e-3
"""Maximum distance of a grid point from its position on an evenly spaced grid, as a fraction of the spacing. A table
with a larger distance is refused, because its points are not evenly spaced. Smaller distances are due to rounded
numbers."""


def terrain_from(table: Mapping[str, Any], file: Path, trust: Trust = Trust()) -> Terrain:
    """Return the terrain that the table `[terrain]` of a drive log or model declares.

    Parameters
    ----------
    table : mapping
        The keys and values of the table; the docstring of this module shows an example.
    file : Path
        The TOML file that contains the table. The terrain's files must lie in the folder of `file`, unless `trust`
        allows other folders.
    trust : Trust
        The further folders that the user allows to read files from.

    Raises DataError: the table has an unknown key, no kind of terrain or several kinds, or one of its files is missing,
    is not allowed or is refused by its reader.
    """
    for key in table:
        if key not in KEYS:
            raise DataError(f"{file}: [terrain] has an unknown key '{key}': {closest(key, KEYS)}")
    kinds = [kind for kind in KINDS if kind in table]
    if len(kinds) != 1:
        raise DataError(
            f"{file}: [terrain] must have exactly one of {', '.join(KINDS)}, but it has {', '.join(kinds) or 'none'}."
        )
    for key in ("polylines", "borders", "patch"):
        if not isinstance(table.get(key, []), list):
            raise DataError(f"{file}: [terrain] has {key} = {table[key]!r}: give a list.")

    def file_path(name: Any) -> Path:
        """Return the path of a file that the table names; DataError if the file is missing or not allowed."""
        path = trust.within(file.parent, name, f"{file}: [terrain]")
        if not is_file(path):
            siblings = (
                [entry.name for entry in file.parent.iterdir() if entry.is_file()] if file.parent.is_dir() else []
            )
            raise DataError(
                f"{file}: [terrain] names the file {name!r}, which does not exist: {closest(str(name), siblings)}"
            )
        return path

    try:
        terrain: Terrain
        if "grid" in table:
            options = {name: table[name] for name in GRID_OPTIONS if name in table}
            terrain = from_grid(file_path(table["grid"]), **options)
        elif "polyline" in table:
            terrain = from_polyline(file_path(table["polyline"]))
        else:
            profiles = [from_polyline(file_path(name)).profiles[0] for name in table["polylines"]]
            terrain = Lanes(tuple(profiles), tuple(table.get("borders", ())))
        # If patches overlap, the later patch of the list decides about the soil.
        for patch in table.get("patch", []):
            if not isinstance(patch, Mapping) or not set(patch) <= set(PATCH_KEYS) or "ground" not in patch:
                raise DataError(
                    f"{file}: [terrain] has patch = {patch!r}, which is no table of x_from, x_to and ground. Give a "
                    "table such as { x_from = 1.0, x_to = 2.0, ground = 1 }, with x in m and a soil index as ground."
                )
            try:
                x_from, x_to = as_float(patch.get("x_from", -math.inf)), as_float(patch.get("x_to", math.inf))
            except (TypeError, ValueError):
                raise DataError(
                    f"{file}: [terrain] has patch = {patch!r}: x_from and x_to must be numbers [m]."
                ) from None
            terrain = with_ground(terrain, x_from, x_to, patch["ground"])
    except ParameterError as error:
        raise DataError(f"{file}: [terrain]: {error}") from error
    return terrain


def write_terrain(folder: str | Path, terrain: Terrain) -> dict[str, Any]:
    """Write the files of a terrain into a folder, and return the table `[terrain]` that names these files.

    `folder` is the folder of the drive log or model that will contain this table.
    """
    folder = Path(folder)
    if isinstance(terrain, HeightGrid):
        return {"grid": to_grid(folder / "terrain.npz", terrain).name}
    assert isinstance(terrain, Lanes)
    if len(terrain.profiles) == 1:
        return {"polyline": to_polyline(folder / "terrain.csv", terrain.profiles[0]).name}
    files = [to_polyline(folder / f"terrain-{k}.csv", profile).name for k, profile in enumerate(terrain.profiles)]
    return {"polylines": files, "borders": list(terrain.borders)}


def from_polyline(path: Annotated[str | Path, spec("", "your own file: CSV or Parquet of x_m, z_m")]) -> Lanes:
    """Return the terrain of a CSV or Parquet file with columns x_m, z_m and, optionally, ground.

    Each row is a point of the ground's profile, which does not depend on y. x_m must increase. The column ground holds
    the soil index of the piece from a row's point to the next row's point; its last value is not used.

    Raises DataError: a column is missing, a number is missing or not finite, x_m does not increase, values look like
    millimetres, or `Profile` refuses the points.
    """
    # The columns are checked before the profile is made, because these errors name the row of the file.
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
    """Write a profile to a CSV file that `from_polyline` reads; return the path of the file."""
    ground = np.append(profile.ground, profile.ground[-1])
    return replace_file(path, columns_text({"x_m": profile.x, "z_m": profile.z, "ground": ground}))


@check_arguments("terrain")
def from_grid(
    path: Annotated[
        str | Path, spec("", "your own file: heights in .npz, CSV, GeoTIFF, .asc, .npy, .mat or grey .png")
    ],
    cell: Annotated[
        float, spec("m", "0: the file states it; needed for .npy, .mat, .png and a CSV without names", 0.0, LARGEST)
    ] = 0.0,
    relief: Annotated[
        float,
        spec("m", "0: the file has heights in m; needed for a .png, the height of white above black", 0.0, LARGEST),
    ] = 0.0,
    missing: Annotated[str, spec("", "cells without a height are refused; fill or cut them")] = "",
) -> HeightGrid:
    """Return the terrain of a file of heights.

    There are three kinds of file:

    - a height map: `.tif`, `.asc`, `.npy`, `.mat`, `.png`, and CSV if `cell` is given; see `raster_grid`.
    - `.npz`: arrays x0, y0 (position of the grid's corner), dx, dy (spacing) [m], z (nx, ny) [m] and, optionally,
      ground (nx-1, ny-1), the soil index of each cell.
    - any other CSV or Parquet file: columns x_m, y_m, z_m and, optionally, ground. It has one row for each point of a
      full, evenly spaced grid, in any order. ground is the soil index of the cell whose corner of lowest x and y is the
      row's point.

    Parameters
    ----------
    path : str or Path
        The file.
    cell : float [m]
        Width of a height map's cells.
    relief : float [m]
        Height difference between a white and a black pixel of a `.png`.
    missing : str
        What happens to a height map's cells without a height: "" refuses the file, "fill" fills the cells, and "cut"
        keeps the largest rectangle without such cells.

    Raises DataError: a column or array is missing, a number is missing or not finite, the points make no full even
    grid, values look like millimetres, or `raster_grid` or `HeightGrid` refuses the heights. Raises MissingExtraError:
    the file is a GeoTIFF, and rasterio is not installed.
    """
    path = Path(path)
    for name, given in (("cell", cell), ("relief", relief), ("missing", missing)):
        if given and path.suffix.lower() in (".npz", ".parquet", ".pq"):
            raise DataError(
                f"{path}: terrain.{name} is an option of height maps only: leave it out for a {path.suffix} file."
            )
    try:
        if path.suffix.lower() in SUFFIXES or cell or relief or missing or is_esri_grid(path):
            return raster_grid(path, cell, relief, missing)
        if path.suffix == ".npz":
            # `arrays` reads plain numbers only, because a pickled object in the file could run code.
            try:
                entries = arrays(path)
            except OSError as error:
                raise DataError(f"{path}: the file cannot be read: {error.strerror or error}.") from error
            except Exception as error:  # whatever numpy and zipfile raise for a damaged archive
                raise DataError(
                    f"{path}: the file is not an .npz of plain arrays ({error}): write it with numpy.savez or "
                    "`to_grid`."
                ) from error
            for name in ("x0", "y0", "dx", "dy", "z"):
                if name not in entries:
                    raise DataError(
                        f"{path}: there is no array '{name}' in the file, which has: "
                        f"{', '.join(sorted(entries)) or 'none'}. Give the corner x0, y0 and the spacings dx, dy [m] "
                        "as one number each, and the heights z (nx, ny) [m]."
                    )
            known = ("x0", "y0", "dx", "dy", "z", "ground")
            fields: dict[str, Any] = {name: entries[name] for name in known if name in entries}
            grid = HeightGrid(**fields)
            _refuse_large(path, "z", grid.z)
            return grid
        return _column_grid(path)
    except ParameterError as error:
        raise DataError(f"{path}: {error}") from error


def to_grid(path: str | Path, grid: HeightGrid) -> Path:
    """Write a height grid to an `.npz` file that `from_grid` reads; return the path of the file."""
    # The file is written in memory first, so that an interrupted write leaves no partial file.
    content = io.BytesIO()
    np.savez_compressed(content, x0=grid.x0, y0=grid.y0, dx=grid.dx, dy=grid.dy, z=grid.z, ground=grid.ground)
    return replace_file(path, content.getvalue())


def _column_grid(path: Path) -> HeightGrid:
    """Return the height grid in a table with one row for each grid point, in any order. The columns are x_m, y_m, z_m
    and, optionally, ground.
    """
    table = read_columns(path)
    if "column 1" in table.values:
        raise DataError(
            f"{path}: its columns have no names. If it is a matrix of heights (rows from north to south), set "
            "terrain.cell to the width of its cells [m]; if it is a table of points, name its columns x_m, y_m, z_m."
        )
    x, y, z = table.need("x_m", "y_m", "z_m")
    table.refuse_gaps(*(name for name in ("x_m", "y_m", "z_m", "ground") if name in table.values))
    _refuse_millimetres(table, "x_m", "y_m", "z_m")
    x0, dx, i = _lattice(table, "x_m", x)
    y0, dy, j = _lattice(table, "y_m", y)
    shape = (int(i.max()) + 1, int(j.max()) + 1)
    # Each grid point needs exactly one row: a missing row leaves a hole, and a second row contradicts the first. The
    # check uses only arrays with one entry for each row, because a few scattered rows may span a grid of billions of
    # points.
    present, counts = np.unique(i * shape[1] + j, return_counts=True)
    missing = np.flatnonzero(present != np.arange(present.size))
    point = int(missing[0]) if missing.size else present.size
    rows = int(point >= shape[0] * shape[1])  # 0 if this first absent point belongs to the grid, else 1
    twice = np.flatnonzero(counts[:point] > 1)
    if twice.size:
        point, rows = int(twice[0]), int(counts[twice[0]])
    if rows != 1:
        x_at, y_at = x0 + point // shape[1] * dx, y0 + point % shape[1] * dy
        raise DataError(
            f"{path}: the grid point at x = {x_at:g} m, y = {y_at:g} m has {rows} rows in the table; "
            f"the grid of {shape[0]} by {shape[1]} points needs exactly one row for each point."
        )
    # A cell has the soil of its corner of lowest x and y, so that the soils of the last row and column are not used.
    height, ground = np.empty(shape), np.zeros(shape)
    height[i, j] = z
    ground[i, j] = table.values.get("ground", np.zeros(z.size))
    return HeightGrid(x0, y0, dx, dy, height, ground[:-1, :-1])


def _lattice(table: Columns, name: str, values: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Return the first coordinate [m], the spacing [m] and the index of each row on an evenly spaced axis of a grid.

    `values` is the column `name` of a table of grid points: the coordinates of all rows along this axis.

    Raises DataError: all rows have one coordinate, or a coordinate lies off the even grid.
    """
    low, high = float(values.min()), float(values.max())
    if low == high:
        raise DataError(
            f"{table.path}: column '{name}' is {low:g} m everywhere; a grid needs two or more different values."
        )
    # The spacing is the widest step between two neighbouring values, corrected for the rounding of the file. (Values
    # that differ by round-off make very narrow steps in addition.)
    spacing = (high - low) / round((high - low) / float(np.max(np.diff(np.unique(values)))))
    index = np.rint((values - low) / spacing).astype(int)
    off = np.abs(values - low - index * spacing) / spacing
    if np.max(off) > SPACING_TOLERANCE:
        worst = int(np.argmax(off))
        raise DataError(
            f"{table.path}, {table.places[worst]}: column '{name}' = {values[worst]:g} m is not a point of the evenly "
            f"spaced grid with spacing {spacing:g} m that starts at {low:g} m: resample the heights on an even grid."
        )
    return low, spacing, index


def _refuse_millimetres(table: Columns, *names: str) -> None:
    """Check that no coordinate in the columns `names` is larger than LARGEST [m].

    Raises DataError: a coordinate is larger, so it is probably in millimetres.
    """
    for name in names:
        _refuse_large(table.path, f"column '{name}'", table.values[name])


def _refuse_large(path: Path, name: str, values: np.ndarray) -> None:
    """Check that no absolute value of `values` is larger than LARGEST [m]. `name` names the values in the error.

    Raises DataError: a value is larger, so it is probably in millimetres.
    """
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest > LARGEST:
        raise DataError(
            f"{path}: {name} reaches {largest:g} m, which looks like millimetres; "
            f"give metres, with absolute values up to {LARGEST:g} m."
        )
