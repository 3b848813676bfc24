"""Heights as pixels, of a GeoTIFF, an .npy array or a grey PNG: rows from north (y) to south, columns to the east (x).

The ground's x = y = 0 is the middle of the raster, z = 0 its lowest pixel; heights hold at the pixels' middles.
"""

import io
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError, MissingExtraError, RoverPinError
from rover_pin.base.files.bounded import MOST_UNPACKED, content, too_large
from rover_pin.base.files.whole_file import replace_file
from rover_pin.terrain.terrain import HeightGrid

GEOTIFF = (".tif", ".tiff")
NEEDS: dict[str, tuple[str, ...]] = {".npy": ("cell",), ".png": ("cell", "relief")}
"""What a file of this kind does not say itself."""
SUFFIXES = (*GEOTIFF, *NEEDS)
WHITE = {"L": 255.0, "I;16": 65535.0}
"""Pillow's greys, of 8 and 16 bits, and the number that is white."""
Heights = tuple[Any, float, float]
"""Heights [m] (rows, columns), masked where there are none, and steps [m] to the next column and row."""


def raster_grid(path: Path, cell: float = 0.0, relief: float = 0.0) -> HeightGrid:
    """Return the ground of a raster; `cell` [m] and `relief`, white above black [m], where the file does not say them.

    Raises DataError: what is no such raster, in degrees or feet, turned, or without a height somewhere; a size that is
    missing.
    Raises MissingExtraError: a GeoTIFF where rasterio is not installed.
    """
    suffix = path.suffix.lower()
    for name, number, meaning in (("cell", cell, "width of a pixel"), ("relief", relief, "height of white over black")):
        if (name in NEEDS.get(suffix, ())) != (number > 0.0):
            remedy = "leave it out of" if number else "give it to"
            raise DataError(f"{path}: terrain.{name} is the {meaning} [m]: {remedy} a {suffix} file.")
    try:
        pixels, dx, dy = {".npy": _array, ".png": _grey}.get(suffix, _geotiff)(path, cell, relief)
        heights: Any = np.ma.masked_invalid(np.ma.asarray(pixels, dtype=float))
    except OSError as error:
        raise DataError(f"{path}: the file cannot be read: {error.strerror or error}.") from error
    except RoverPinError:
        raise
    except Exception as error:  # whatever numpy, Pillow and GDAL raise for damaged files
        raise DataError(f"{path}: the file is no {suffix} of plain numbers ({error}).") from error
    if heights.ndim != 2:
        raise DataError(f"{path}: it is of shape {heights.shape}: give one height a pixel, rows and columns.")
    missing = np.argwhere(np.ma.getmaskarray(heights))
    if missing.size:
        raise DataError(
            f"{path}: {len(missing)} of {heights.size} pixels have no height, the first in row {missing[0][0]}, column "
            f"{missing[0][1]}: fill them (gdal_fillnodata) or cut a part that has all (gdal_translate -projwin)."
        )
    z = heights.data[::-1].T - float(heights.min())
    return HeightGrid(-0.5 * (z.shape[0] - 1) * dx, -0.5 * (z.shape[1] - 1) * dy, dx, dy, z)


def _array(path: Path, cell: float, relief: float) -> Heights:
    return np.lib.format.read_array(io.BytesIO(content(path)), allow_pickle=False), cell, cell


def _grey(path: Path, cell: float, relief: float) -> Heights:
    from PIL import Image

    with Image.open(io.BytesIO(content(path)), formats=("PNG",)) as image:
        _refuse_size(image.width, image.height)
        if image.mode not in WHITE:
            raise DataError(f"{path}: it is of mode {image.mode}: save it in greys of 8 or, better, 16 bits.")
        return np.asarray(image) * (relief / WHITE[image.mode]), cell, cell


def _geotiff(path: Path, cell: float, relief: float) -> Heights:
    with _open_geotiff(path) as dataset:
        _refuse_size(dataset.width, dataset.height)
        step, (unit, metres) = dataset.transform, dataset.crs.units_factor if dataset.crs else ("no unit it says", 0.0)
        if dataset.count != 1:
            raise DataError(f"{path}: it has {dataset.count} bands: keep that of the heights (gdal_translate -b 1).")
        if metres != 1.0 or dataset.crs.is_geographic:
            raise DataError(
                f"{path}: its coordinates are in {unit}, and ground needs metres: project it (gdalwarp -t_srs "
                "EPSG:32633 is UTM 33 N), or name its system (gdal_edit.py -a_srs)."
            )
        if step.b or step.d or step.a <= 0.0 or step.e >= 0.0:
            raise DataError(f"{path}: its rows do not run from north to south: turn it (gdalwarp).")
        return dataset.read(1, masked=True) * dataset.scales[0] + dataset.offsets[0], step.a, -step.e


def _refuse_size(width: int, height: int) -> None:
    if width * height * np.dtype(float).itemsize > MOST_UNPACKED:
        raise too_large(MOST_UNPACKED)


@contextmanager
def _open_geotiff(path: Path) -> Iterator[Any]:
    """Yield a GeoTIFF opened from memory: GDAL goes to no other file, nor to a network, that one may name."""
    try:
        import rasterio
        from rasterio.io import MemoryFile
    except ImportError as error:
        raise MissingExtraError(f"{path}: a GeoTIFF needs rasterio: pip install 'rover-pin[dem]'.") from error
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
    """Write numbers (nx, ny) each `spacing` [m] from a corner x, y of `like`'s ground on, in its coordinate system."""
    with _open_geotiff(like) as dataset:
        (west, south, east, north), crs = dataset.bounds, dataset.crs
    from rasterio import Affine
    from rasterio.io import MemoryFile

    nx, ny = next(iter(bands.values())).shape
    left, bottom = (0.5 * (west + east) + corner[0], 0.5 * (south + north) + corner[1])
    step = Affine(spacing, 0.0, left - 0.5 * spacing, 0.0, -spacing, bottom + (ny - 0.5) * spacing)
    profile = {"width": nx, "height": ny, "count": len(bands), "dtype": "float64", "crs": crs, "transform": step}
    with MemoryFile() as memory:
        with memory.open(driver="GTiff", nodata=np.nan, **profile) as out:
            for at, (name, values) in enumerate(bands.items(), 1):
                out.write(values.T[::-1], at)
                out.set_band_description(at, name)
        return replace_file(path, memory.read())
