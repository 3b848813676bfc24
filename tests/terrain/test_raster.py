"""Heights as pixels: three formats give one ground, where the file says it lies; what says too little is refused."""

import numpy as np
import pytest
from PIL import Image

from rover_pin.base.errors import DataError
from rover_pin.terrain.files import from_grid
from rover_pin.terrain.roughness import slope_and_roughness
from rover_pin.terrain.shapes import cross_slope
from rover_pin.terrain.terrain import HeightGrid

CELL, WEST, NORTH = 0.25, 500_000.0, 4_000_000.0
HEIGHTS = 2500.0 + np.random.default_rng(1).normal(0.0, 0.02, (30, 50)).cumsum(axis=1)


@pytest.fixture
def geotiff(tmp_path):
    """Write a GeoTIFF as others do; return its path."""
    rasterio = pytest.importorskip("rasterio")

    def write(heights=HEIGHTS, name="dem.tif", crs="EPSG:32633", step=(CELL, 0.0, -CELL), **options):
        bands = np.atleast_3d(heights.T).T
        count, height, width = bands.shape
        transform = rasterio.Affine(step[0], step[1], WEST, step[1], step[2], NORTH)
        profile = {"width": width, "height": height, "count": count, "dtype": bands.dtype, "transform": transform}
        with rasterio.open(tmp_path / name, "w", driver="GTiff", crs=crs, **profile, **options) as file:
            file.write(bands)
        return tmp_path / name

    return write


def npy(tmp_path, heights=HEIGHTS, name="dem.npy"):
    np.save(tmp_path / name, heights)
    return tmp_path / name


def grey(tmp_path, pixels, name="dem.png"):
    Image.fromarray(pixels).save(tmp_path / name)
    return tmp_path / name


def test_a_geotiff_is_the_ground_of_its_array(tmp_path, geotiff):
    terrain = from_grid(geotiff())
    assert terrain == from_grid(npy(tmp_path), cell=CELL)
    assert terrain == from_grid(geotiff(crs="+proj=eqc +R=1737400 +units=m"))  # of the Moon
    assert terrain.z.min() == 0.0


def test_scaled_numbers_are_heights(tmp_path, geotiff):
    rasterio = pytest.importorskip("rasterio")
    file = geotiff(np.arange(12, dtype=np.int16).reshape(3, 4))
    with rasterio.open(file, "r+") as dataset:
        dataset.scales, dataset.offsets = (0.01,), (7.0,)
    assert np.ptp(from_grid(file).z) == pytest.approx(0.11)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"crs": "EPSG:4326"}, "in degree.*gdalwarp"),
        ({"crs": "EPSG:2263"}, "foot"),
        ({"crs": None}, "no unit.*gdal_edit"),
        ({"step": (CELL, 0.1, -CELL)}, "turn it"),
        ({"step": (CELL, 0.0, CELL)}, "north to south"),
        ({"heights": np.stack([HEIGHTS, HEIGHTS])}, "2 bands"),
        (
            {"heights": np.where(np.indices(HEIGHTS.shape).sum(axis=0) == 77, -9999.0, HEIGHTS), "nodata": -9999.0},
            r"2 of 1500 pixels.*row 28, column 49.*gdal_fillnodata",
        ),
    ],
)
def test_geotiffs_that_are_refused(geotiff, options, says):
    with pytest.raises(DataError, match=says):
        from_grid(geotiff(**options))


def test_files_that_are_refused(tmp_path, geotiff):
    holed = np.where(np.indices(HEIGHTS.shape)[1] == 7, np.nan, HEIGHTS)
    (tmp_path / "bad.tif").write_bytes(b"II*\0 and no more")
    (tmp_path / "bad.png").write_bytes(b"\x89PNG")
    sizes = {"cell": 1.0, "relief": 1.0}
    for path, given, says in (
        (npy(tmp_path), {}, "terrain.cell is.*give it"),
        (npy(tmp_path), sizes, "terrain.relief is.*leave it out"),
        (geotiff(), {"cell": 1.0}, "terrain.cell is.*leave it out"),
        (tmp_path / "dem.csv", {"cell": 1.0}, "terrain.cell is.*leave it out"),
        (npy(tmp_path, holed, "holed.npy"), {"cell": 1.0}, "30 of 1500 pixels.*row 0, column 7"),
        (npy(tmp_path, np.zeros(4), "line.npy"), {"cell": 1.0}, r"shape \(4,\)"),
        (npy(tmp_path, np.array([["a"]]), "words.npy"), {"cell": 1.0}, "no .npy of plain numbers"),
        (npy(tmp_path, np.array([[None]]), "objects.npy"), {"cell": 1.0}, "no .npy of plain numbers"),
        (npy(tmp_path, 2e3 * np.eye(9), "steep.npy"), {"cell": 1.0}, "89.97 deg steep"),
        (grey(tmp_path, np.zeros((9, 9), np.uint8)), {"cell": 1.0}, "terrain.relief is.*give it"),
        (grey(tmp_path, np.zeros((9, 9, 3), np.uint8), "rgb.png"), sizes, "mode RGB"),
        (tmp_path / "bad.png", sizes, "no .png of plain numbers|cannot be read"),
        (tmp_path / "bad.tif", {}, "no GeoTIFF"),
        (tmp_path / "gone.tif", {}, "No such file"),
    ):
        with pytest.raises(DataError, match=says):
            from_grid(path, **given)


def test_a_plane_has_its_slope_and_no_roughness():
    slope, roughness = slope_and_roughness(cross_slope(0.2), np.array([0.0, 3.0]), np.array([0.0, 1.0]), 0.3)
    assert slope == pytest.approx([0.2, 0.2])
    assert roughness == pytest.approx([0.0, 0.0], abs=1e-12)


def test_slope_and_roughness_are_those_of_a_fit_by_numpy():
    """A saddle with waves of 5 cm on it: the plane by numpy.linalg.lstsq over points of the formula itself."""

    def formula(x, y):
        return 0.2 * x + 0.05 * y + 0.1 * x * y + 0.004 * np.sin(2.0 * np.pi * x / 0.05)

    axis = 0.0025 * np.arange(-400, 401)
    terrain = HeightGrid(axis[0], axis[0], 0.0025, 0.0025, formula(*np.meshgrid(axis, axis, indexing="ij")))
    x, y, side = 0.31, -0.22, 0.4
    u = side * (np.linspace(0.0, 1.0, 801)[:-1] + 0.5 / 800 - 0.5)
    points = [part.ravel() for part in np.meshgrid(x + u, y + u, indexing="ij")]
    table = np.column_stack([np.ones(u.size**2), *points])
    plane, squares, *_ = np.linalg.lstsq(table, formula(*points))
    slope, roughness = slope_and_roughness(terrain, np.array(x), np.array(y), side)
    assert float(slope) == pytest.approx(np.arctan(np.hypot(*plane[1:])), rel=2e-3)
    assert float(roughness) == pytest.approx(np.sqrt(squares[0] / u.size**2), rel=0.02)
