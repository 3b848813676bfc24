"""Read height maps as terrains: GeoTIFF, ESRI ASCII grid, grey PNG, and a matrix of heights in .npy, .mat or CSV.

Rows of a height map run from north (+y) to south, and columns from west to east (+x). In the terrain that is made from
the map, x = y = 0 is the middle of the map, z = 0 is the height of its lowest cell, and the height of a cell holds at
the middle of the cell.
"""

import io
import re
import struct
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import DataError, MissingExtraError, RoverPinError
from rover_pin.base.extras import install_command
from rover_pin.base.files.bounded import MAX_TABLE_BYTES, array_of, content
from rover_pin.base.files.matlab import mat_variables
from rover_pin.base.files.table import decode
from rover_pin.base.files.whole_file import replace_file
from rover_pin.terrain.terrain import MAX_STEEPNESS, HeightGrid

MAX_HEIGHTS = 1 << 24
"""Maximum number of cells of a height map: 16.8 million, for instance 4,096 by 4,096. A larger file is refused before
its cells are decoded. In every format, reading a map of this size takes 1 GiB of memory or less, including all copies.
"""
GEOTIFF = (".tif", ".tiff")
"""Suffixes of GeoTIFF files."""
SUFFIXES = (*GEOTIFF, ".asc", ".png", ".npy", ".mat")
"""Suffixes of files that are always read as a height map; a CSV is a height map if the width of its cells is given."""
WHITE = {"L": 255.0, "I;16": 65535.0}
"""Value of a white pixel in a grey picture with 8 or 16 bits, by Pillow's name of the picture's mode."""
FILL, CUT = "fill", "cut"
"""Values of the argument `missing`: fill the cells without a height from the cells around them, or keep only the
largest rectangle of cells with a height."""
MAX_SHOWN_VALUES = 5
"""Maximum number of values that an error message lists as probable codes for missing heights. Further values are
reported as "more", so that the message stays readable; a file usually has one code."""
FILL_SWEEPS = 20
"""Number of times that each filled cell of a height map is replaced by the mean of its neighbours, on the map itself
and on each coarser copy of the map. Twenty times suffice, because the coarser copies already removed errors of long
wavelength; more times would take more time."""
ESRI_HEADER = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "nodata_value")
"""Keys in the header of an ESRI ASCII grid, in small letters."""


class Heights(NamedTuple):
    """The heights that were read from a height map file, and the distances between its cells."""

    z: np.ndarray
    "heights [m], rows from north to south (rows, columns); NaN where the file has no height"
    dx: float
    "distance between neighbouring columns [m]"
    dy: float
    "distance between neighbouring rows [m]"


def raster_grid(path: Path, cell: float = 0.0, relief: float = 0.0, missing: str = "") -> HeightGrid:
    """Return the terrain of a height map file.

    Parameters
    ----------
    path : Path
        A file with one of SUFFIXES, or a CSV or text file with a matrix of heights [m].
    cell : float [m]
        Width of a cell, for files that do not state it (.npy, .mat, .png and CSV); otherwise 0.
    relief : float [m]
        Height difference between a white and a black pixel of a .png; otherwise 0.
    missing : str
        What happens to cells without a height: "" refuses the file, "fill" fills the cells with a membrane that is
        stretched over the hole (heights of zero Laplacian), and "cut" keeps the largest rectangle without such cells.

    Raises
    ------
    DataError
        The file is no height map or has more than MAX_HEIGHTS cells, its coordinates are in degrees or feet or are
        turned, an argument is missing or is also stated by the file, or cells have no height. A cell also counts as a
        cell without a height if no terrain of 89 deg or less can join its height to the other heights; the error lists
        such heights.
    MissingExtraError
        The file is a GeoTIFF, and rasterio is not installed.
    """
    suffix = path.suffix.lower()
    # An argument is refused if it is missing although the kind of file needs it, or if it is given although the file
    # states the value itself.
    states_cell, has_relief = suffix in (*GEOTIFF, ".asc"), suffix == ".png"
    known_kind = suffix in SUFFIXES
    for name, number, needed, meaning in (
        ("cell", cell, not states_cell, "width of a cell"),
        ("relief", relief, has_relief, "height of white above black"),
    ):
        if needed != (number > 0.0) and (known_kind or name == "relief"):
            remedy = f"leave it out for a {suffix} file" if number else f"give it for a {suffix} file"
            raise DataError(f"{path}: terrain.{name} is the {meaning} [m]: {remedy}.")
    if missing not in ("", FILL, CUT):
        raise DataError(f"{path}: terrain.missing = '{missing}' is not known: give {FILL} or {CUT}, or leave it out.")
    try:
        if suffix in GEOTIFF:
            heights = _geotiff(path)
        elif suffix == ".png":
            heights = Heights(_grey(path, relief), cell, cell)
        elif suffix == ".npy":
            heights = Heights(_plain(path, array_of(content(path))), cell, cell)
        elif suffix == ".mat":
            matrices = {
                name: value
                for name, value in mat_variables(path).items()
                if isinstance(value, np.ndarray) and value.ndim == 2
            }
            if len(matrices) != 1:
                names = ", ".join(matrices) or "none"
                raise DataError(
                    f"{path}: a height map needs exactly one matrix of numbers, and the file has {names}. Save the "
                    "matrix of heights alone."
                )
            heights = Heights(_plain(path, next(iter(matrices.values()))), cell, cell)
        else:
            text = decode(content(path, MAX_TABLE_BYTES))[0]
            is_esri = text[:200].lstrip().lower().startswith(ESRI_HEADER)
            if is_esri == bool(cell):
                raise DataError(
                    f"{path}: terrain.cell is the width of a cell [m]: "
                    + (
                        "leave it out, because an ESRI ASCII grid states it."
                        if is_esri
                        else "give it, because a matrix of heights does not state it."
                    )
                )
            heights = _esri(path, text) if is_esri else Heights(_text_matrix(path, text), cell, cell)
    except OSError as error:
        raise DataError(f"{path}: the file cannot be read: {error.strerror or error}.") from error
    except RoverPinError:
        raise
    except Exception as error:  # whatever numpy, Pillow and GDAL raise for damaged files
        raise DataError(f"{path}: the file is no {suffix} of plain numbers ({error}).") from error
    return ground_of(heights.z, heights.dx, heights.dy, str(path), missing)


def ground_of(pixels: Any, dx: float, dy: float, where: str, missing: str = "") -> HeightGrid:
    """Return the terrain of an array of heights, with x = y = 0 in the middle of the array and z = 0 at the lowest
    height.

    Parameters
    ----------
    pixels : array (rows, columns) [m]
        Height of each cell, the first row in the north (+y); masked or NaN where a cell has no height.
    dx, dy : float [m]
        Distance between neighbouring columns and between neighbouring rows.
    where : str
        Name of the file or argument, for error messages.
    missing : str
        What happens to cells without a height: "" raises an error, "fill" fills the cells, and "cut" keeps the largest
        rectangle without such cells.

    Raises
    ------
    DataError
        The heights are not in rows and columns, or some heights are missing.

    Examples
    --------
    >>> terrain = ground_of(np.array([[0.2, 0.3], [0.0, 0.1]]), 1.0, 1.0, "my heights")
    >>> round(terrain.height(-0.5, 0.5), 3)
    0.2
    """
    # Masked cells become NaN, so that all later steps know a single mark for a missing height.
    masked: Any = np.ma.asarray(pixels)
    z = _plain(where, masked.data)
    z[np.ma.getmaskarray(masked)] = np.nan
    z, (west, south) = _complete(where, Heights(z, dx, dy), missing)
    z -= z.min()
    # The last row is the southernmost row and goes to low y; the first axis of a HeightGrid is x.
    return HeightGrid(west, south, dx, dy, z[::-1].T)


def is_esri_grid(path: Path) -> bool:
    """Return whether a file begins with the header of an ESRI ASCII grid. The suffix of the file does not matter.

    The result is False for a file that cannot be read.
    """
    try:
        head = content(path, MAX_TABLE_BYTES, 200)
    except OSError:
        return False
    return head.lstrip().lower().startswith(tuple(word.encode() for word in ESRI_HEADER))


def _refuse_size(path: Path | str, rows: int, columns: int) -> None:
    """Check that a height map has at most MAX_HEIGHTS cells, and at least two rows and two columns.

    Readers call this function before they decode the cells, so that a small compressed file cannot fill the memory.

    Raises DataError: the map has too many cells, or too few rows or columns.
    """
    if rows * columns > MAX_HEIGHTS:
        raise DataError(
            f"{path}: the height map has {rows} rows of {columns} cells, and {MAX_HEIGHTS} cells is the maximum. Cut "
            "out the part that the rover drives on, or make the cells wider (gdal_translate -srcwin or -tr)."
        )
    if min(rows, columns) < 2:
        raise DataError(
            f"{path}: the height map has {rows} rows of {columns} cells: it needs two rows and two columns or more."
        )


def _plain(path: Path | str, array: np.ndarray) -> np.ndarray:
    """Return an array of heights [m] as floats (rows, columns). Raise DataError if the array is no matrix of
    numbers.
    """
    if array.dtype.kind not in "biuf":
        raise DataError(f"{path}: the heights are of type {array.dtype}: give heights [m] as plain numbers.")
    if array.ndim != 2:
        raise DataError(
            f"{path}: the heights have shape {array.shape}: give one height for each cell, in rows and columns."
        )
    _refuse_size(path, *array.shape)
    return array.astype(float)


def _grey(path: Path, relief: float) -> np.ndarray:
    """Return the heights of a grey PNG [m] (rows, columns), from 0 for black to `relief` [m] for white."""
    from PIL import Image

    raw = content(path)
    # The first chunk of the file states the size, which is checked here because Pillow only warns of large pictures.
    if raw.startswith(b"\x89PNG\r\n\x1a\n") and len(raw) >= 24:
        columns, rows = struct.unpack(">II", raw[16:24])
        _refuse_size(path, rows, columns)
    with Image.open(io.BytesIO(raw), formats=("PNG",)) as image:
        if image.mode not in WHITE:
            raise DataError(
                f"{path}: the picture has mode {image.mode}: save the picture in greys of 8 bits or, better, 16 bits."
            )
        return np.asarray(image) * (relief / WHITE[image.mode])


def _geotiff(path: Path) -> Heights:
    """Return the heights of a GeoTIFF [m], with the file's scale and offset applied.

    Raises DataError: the file has several bands, is not in metres, or does not run from north to south.
    """
    with _open_geotiff(path) as dataset:
        _refuse_size(path, dataset.height, dataset.width)
        block_rows, block_columns = dataset.block_shapes[0]
        # GDAL decodes a block as a whole, however few cells the map itself has.
        if block_rows * block_columns > 2 * MAX_HEIGHTS:
            raise DataError(
                f"{path}: the file's blocks have {block_rows} by {block_columns} cells, which would take too much "
                "memory: write the file in smaller blocks."
            )
        step, (unit, metres) = dataset.transform, dataset.crs.units_factor if dataset.crs else ("no unit", 0.0)
        if dataset.count != 1:
            raise DataError(
                f"{path}: the file has {dataset.count} bands: keep only the band of the heights (gdal_translate -b 1)."
            )
        if metres != 1.0 or dataset.crs.is_geographic:
            raise DataError(
                f"{path}: the coordinates are in {unit}, but a terrain needs metres. Project the file (gdalwarp -t_srs "
                "EPSG:32633 is UTM 33 N), or state its coordinate system (gdal_edit.py -a_srs)."
            )
        if step.b or step.d or step.a <= 0.0 or step.e >= 0.0:
            raise DataError(f"{path}: the rows of the map do not run from north to south: turn the map with gdalwarp.")
        # The file may store heights as integers with a scale and an offset, and mark missing heights by a mask.
        band = dataset.read(1, masked=True)
        z = np.asarray(band.data, dtype=float) * dataset.scales[0] + dataset.offsets[0]
        z[np.ma.getmaskarray(band)] = np.nan
        return Heights(z, step.a, -step.e)


def _esri(path: Path, text: str) -> Heights:
    """Return the heights of an ESRI ASCII grid: lines with a key and a value, then the rows from north to south.

    The corner in the header is the position of the map on Earth; it must be a number and is not used. Cells with the
    header's NODATA_value have no height.

    Source: ESRI, ArcGIS documentation, "Esri ASCII raster format".
    """
    # The header ends at the first line that is no key of ESRI_HEADER with a number.
    header: dict[str, float] = {}
    body = 0
    for line in re.finditer(r"[ \t]*([A-Za-z_]+)[ \t]+(\S+)[ \t]*\r?\n", text):
        if line.start() != body or line[1].lower() not in ESRI_HEADER:
            break
        try:
            header[line[1].lower()] = float(line[2])
        except ValueError:
            raise DataError(f"{path}: '{line[1]}' is '{line[2]}', which is not a number.") from None
        body = line.end()
    lacking = [name for name in ("ncols", "nrows", "cellsize") if not 0.0 < header.get(name, 0.0) < 1e9]
    if lacking:
        raise DataError(
            f"{path}: an ESRI ASCII grid begins with {', '.join(ESRI_HEADER)}, but here {lacking[0]} is no positive "
            "number."
        )
    columns, rows = int(header["ncols"]), int(header["nrows"])
    _refuse_size(path, rows, columns)
    z = _numbers(path, text[body:])
    if z.size != rows * columns:
        raise DataError(f"{path}: the header states {rows} rows of {columns} cells, and {z.size} numbers follow.")
    z[z == header.get("nodata_value", -9999.0)] = np.nan
    return Heights(z.reshape(rows, columns), header["cellsize"], header["cellsize"])


def _text_matrix(path: Path, text: str) -> np.ndarray:
    """Return the matrix of heights (rows, columns) in lines of text, with any delimiter; NaN for an empty cell."""
    # The first of these delimiters in the first line separates the cells; without a delimiter, blanks do.
    lines = [line for line in text.splitlines() if line.strip()]
    delimiter = next((mark for mark in ";\t," if lines and mark in lines[0]), "")
    widths = [line.rstrip(f"{delimiter} ").count(delimiter) + 1 if delimiter else len(line.split()) for line in lines]
    _refuse_size(path, len(lines), max(widths, default=0))
    if len({*widths}) > 1:
        odd = next(row for row, width in enumerate(widths) if width != widths[0])
        raise DataError(
            f"{path}, line {odd + 1}: this line has {widths[odd]} cells, but the first line has {widths[0]} cells. A "
            "matrix of heights needs the same number of cells in each row, and no column names."
        )
    if delimiter:
        # If the comma is not the delimiter, it is a decimal comma.
        if delimiter != ",":
            lines = [line.replace(",", ".") for line in lines]
        # An empty cell becomes the word nan, because it would otherwise disappear between blanks.
        gap = re.compile(rf"(?:^|(?<={delimiter}))[ ]*(?={delimiter})")
        lines = [gap.sub("nan", line.rstrip(f"{delimiter} ")).replace(delimiter, " ") for line in lines]
    z = _numbers(path, "\n".join(lines))
    if z.size != len(lines) * widths[0]:
        raise DataError(
            f"{path}: the matrix has {len(lines)} rows of {widths[0]} cells, but only {z.size} cells have a number: "
            "correct the other cells."
        )
    return z.reshape(len(lines), widths[0])


def _numbers(path: Path, text: str) -> np.ndarray:
    """Return the numbers in a text of numbers that are separated by blanks. Raise DataError at the first word that is
    no number.
    """
    try:
        with warnings.catch_warnings():
            # NumPy warns in this way that it stopped at a word.
            warnings.simplefilter("error", DeprecationWarning)
            return np.fromstring(text, sep=" ")
    except (DeprecationWarning, ValueError):
        wrong = ""
        for word in text.split():
            try:
                float(word)
            except ValueError:
                wrong = word
                break
        raise DataError(f"{path}: '{wrong}' is no number: a height map has heights only, in metres.") from None


def _complete(path: str, heights: Heights, missing: str) -> tuple[np.ndarray, tuple[float, float]]:
    """Return the heights of a map without gaps (rows, columns), and the position (x, y) [m] of the south-west cell.

    `missing` is the treatment of cells without a height (see `raster_grid`). The returned array may be the array of
    `heights` itself.
    """
    z, dx, dy = heights
    rows, columns = z.shape
    corner = (-0.5 * (columns - 1) * dx, -0.5 * (rows - 1) * dy)
    z[~np.isfinite(z)] = np.nan
    gaps = np.isnan(z)
    if gaps.all():
        raise DataError(f"{path}: no cell of the height map has a height.")
    reasons = [f"{np.count_nonzero(gaps)} have none in the file"] if gaps.any() else []
    # Many files mark missing heights by a number, such as -9999, but do not state this number in a header.
    codes = _codes(z, np.tan(MAX_STEEPNESS) * max(dx, dy))
    if codes:
        reasons += [f"{count} at {value:g}" for value, count in codes[:MAX_SHOWN_VALUES]]
        reasons += ["more"] if len(codes) > MAX_SHOWN_VALUES else []
        gaps |= np.isin(z, [value for value, _ in codes])
    if not reasons:
        return z, corner
    if not missing:
        row, column = np.argwhere(gaps)[0]
        low, high = np.min(z[~gaps]), np.max(z[~gaps])
        raise DataError(
            f"{path}: {np.count_nonzero(gaps)} of {z.size} cells seem to have no height ({', '.join(reasons)}); the "
            f"first is in row {row}, column {column}. No terrain of {np.degrees(MAX_STEEPNESS):g} deg or less joins "
            f"these cells to the other cells, whose heights lie between {low:g} and {high:g} m. Set terrain.missing to "
            f"{FILL}, which fills these cells from the cells around them, or to {CUT}, which keeps the largest "
            "rectangle without such cells."
        )
    if missing == FILL:
        if 2 * np.count_nonzero(gaps) > z.size:
            raise DataError(
                f"{path}: {np.count_nonzero(gaps)} of {z.size} cells have no height; this is too many to fill. Cut out "
                f"a part of the map with more heights, or set terrain.missing to {CUT}."
            )
        return _filled(z, gaps), corner
    top, bottom, left, right = _largest_rectangle(~gaps)
    if min(bottom - top, right - left) < 2:
        raise DataError(
            f"{path}: no two rows and two columns next to each other have a height in every cell: fill the gaps "
            f"(terrain.missing={FILL})."
        )
    # The middle of the whole map stays x = y = 0, so that coordinates are the same with and without the cut.
    return z[top:bottom, left:right].copy(), (corner[0] + left * dx, corner[1] + (rows - bottom) * dy)


def _codes(z: np.ndarray, steepest: float) -> list[tuple[float, int]]:
    """Return the values in a height map that are codes for missing heights, such as -9999, each with its number of
    cells.

    If neighbouring cells of a terrain differ by `steepest` [m] or less, its sorted heights have no gap wider than
    `steepest` either. If the sorted heights of the map have wider gaps, the largest group of heights between two gaps
    is the terrain. Another group with a single value is a code for missing heights. Another group with several values
    is a part of the terrain beyond a wall; `HeightGrid` then refuses the wall, because it is too steep.
    """
    if not np.nanmax(z) - np.nanmin(z) > steepest:
        return []
    values, counts = np.unique(z[~np.isnan(z)], return_counts=True)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values) > steepest) + 1, [values.size]])
    sizes = np.add.reduceat(counts, starts[:-1])
    ground = int(np.argmax(sizes))
    groups = [k for k in range(sizes.size) if k != ground]
    # Heights in another unit leave gaps too, but then most heights lie outside the largest group.
    if any(starts[k + 1] - starts[k] > 1 for k in groups) or 2 * sizes[ground] < sizes.sum():
        return []
    codes = [(float(values[starts[k]]), int(sizes[k])) for k in groups]
    return sorted(codes, key=lambda code: -code[1])


def _filled(z: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    """Return the heights z (rows, columns) after filling the cells in `gaps`.

    Each filled cell is about the mean of its four neighbours, like a membrane that is stretched over the hole.

    The mean over 2 x 2 cells gives a coarser map with smaller gaps. The same function fills the coarser map first; the
    result is the initial guess for the map itself.
    """
    if not gaps.any():
        return z
    # Odd sizes are padded by cells without a height, so that the map divides into blocks of 2 x 2 cells.
    rows, columns = (n + n % 2 for n in z.shape)
    pad = ((0, rows - z.shape[0]), (0, columns - z.shape[1]))
    known = np.pad(~gaps, pad).astype(float)
    total = np.pad(np.where(gaps, 0.0, z), pad)
    known, total = (part.reshape(rows // 2, 2, columns // 2, 2).sum(axis=(1, 3)) for part in (known, total))
    coarse = _filled(total / np.maximum(known, 1.0), known == 0.0)
    guess = np.repeat(np.repeat(coarse, 2, axis=0), 2, axis=1)[: z.shape[0], : z.shape[1]]
    filled = np.where(gaps, guess, z)
    # Jacobi iterations; the coarser map has already removed the errors of long wavelength.
    for _ in range(FILL_SWEEPS):
        edged = np.pad(filled, 1, mode="edge")
        mean = 0.25 * (edged[:-2, 1:-1] + edged[2:, 1:-1] + edged[1:-1, :-2] + edged[1:-1, 2:])
        filled[gaps] = mean[gaps]
    return filled


def _largest_rectangle(full: np.ndarray) -> tuple[int, int, int, int]:
    """Return the largest rectangle of cells that all have a height, as (first row, end row, first column, end column).

    The end row and the end column are directly outside the rectangle. `full` is a boolean array (rows, columns), True
    where a cell has a height. The algorithm goes through the rows. For each column, it keeps the number of full cells
    that end in the present row, and the range of columns to which a rectangle of this height can be extended.
    """
    columns = full.shape[1]
    number = np.arange(columns)
    height, left, right = np.zeros(columns, dtype=int), np.zeros(columns, dtype=int), np.full(columns, columns)
    best, rectangle = 0, (0, 0, 0, 0)
    for row, cells in enumerate(full):
        # A full cell makes the run of full cells in its column longer, and an empty cell ends this run.
        height = np.where(cells, height + 1, 0)
        run_left = np.maximum.accumulate(np.where(cells, 0, number + 1))
        run_right = np.minimum.accumulate(np.where(cells, columns, number)[::-1])[::-1]
        left = np.where(cells, np.maximum(left, run_left), 0)
        right = np.where(cells, np.minimum(right, run_right), columns)
        area = height * (right - left)
        if (k := int(np.argmax(area))) is not None and area[k] > best:
            best, rectangle = int(area[k]), (row + 1 - int(height[k]), row + 1, int(left[k]), int(right[k]))
    return rectangle


@contextmanager
def _open_geotiff(path: Path) -> Iterator[Any]:
    """Yield the rasterio dataset of a GeoTIFF.

    The file is opened from memory, so that GDAL opens no other file and no network address that the file names.

    Raises DataError: the file is no GeoTIFF.
    Raises MissingExtraError: rasterio is not installed.
    """
    try:
        import rasterio
        from rasterio.io import MemoryFile
    except ImportError as error:
        raise MissingExtraError(f"{path}: a GeoTIFF needs rasterio. Run `{install_command('dem')}`.") from error
    with MemoryFile(content(path)) as memory, warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        try:
            with memory.open(driver="GTiff") as dataset:
                yield dataset
        except rasterio.errors.RasterioError as error:
            reason = str(error).rpartition(":")[2]
            raise DataError(f"{path}: the file is no GeoTIFF that can be read ({reason}).") from error


def write_geotiff(
    path: Path, like: Path, corner: tuple[float, float], spacing: float, bands: Mapping[str, np.ndarray]
) -> Path:
    """Write arrays as the bands of a GeoTIFF in the coordinate system of another GeoTIFF. Return the path of the new
    file.

    Parameters
    ----------
    path : Path
        The file to write.
    like : Path
        The GeoTIFF that the terrain was read from (`raster_grid`); the terrain's x = y = 0 is the middle of this map.
    corner : (x, y) [m]
        Position of the entry [0, 0] of each array in the terrain.
    spacing : float [m]
        Distance between neighbouring entries along x and y.
    bands : mapping
        The arrays (nx, ny), by the name of their band.
    """
    with _open_geotiff(like) as dataset:
        (west, south, east, north), crs = dataset.bounds, dataset.crs
    from rasterio import Affine
    from rasterio.io import MemoryFile

    # The arrays hold values at points, and the file has cells around these points. Therefore the edges of the file lie
    # half a spacing outside the outermost points.
    nx, ny = next(iter(bands.values())).shape
    left, bottom = (0.5 * (west + east) + corner[0], 0.5 * (south + north) + corner[1])
    step = Affine(spacing, 0.0, left - 0.5 * spacing, 0.0, -spacing, bottom + (ny - 0.5) * spacing)
    profile = {"width": nx, "height": ny, "count": len(bands), "dtype": "float64", "crs": crs, "transform": step}
    with MemoryFile() as memory:
        with memory.open(driver="GTiff", nodata=np.nan, **profile) as out:
            for band, (name, values) in enumerate(bands.items(), 1):
                out.write(values.T[::-1], band)
                out.set_band_description(band, name)
        return replace_file(path, memory.read())
