"""Heights as pixels: three formats give one ground, where the file says it lies; what says too little is refused."""

import math
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from rover_pin.base.errors import DataError
from rover_pin.terrain.files import from_grid
from rover_pin.terrain.raster import MAX_HEIGHTS
from rover_pin.terrain.shapes import cross_slope
from rover_pin.terrain.terrain import HeightGrid, slope_and_roughness

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
        ({"step": (CELL, 0.1, -CELL)}, "turn the map"),
        ({"step": (CELL, 0.0, CELL)}, "north to south"),
        ({"heights": np.stack([HEIGHTS, HEIGHTS])}, "2 bands"),
        (
            {"heights": np.where(np.indices(HEIGHTS.shape).sum(axis=0) == 77, -9999.0, HEIGHTS), "nodata": -9999.0},
            r"2 of 1500 cells.*row 28, column 49.*fill.*cut",
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
    for path, content, says in (
        (npy(tmp_path), {}, "terrain.cell is.*give it"),
        (npy(tmp_path), sizes, "terrain.relief is.*leave it out"),
        (geotiff(), {"cell": 1.0}, "terrain.cell is.*leave it out"),
        (tmp_path / "dem.npz", {"cell": 1.0}, "terrain.cell.*leave it out"),
        (npy(tmp_path, holed, "holed.npy"), {"cell": 1.0}, "30 of 1500 cells.*row 0, column 7"),
        (npy(tmp_path, np.zeros(4), "line.npy"), {"cell": 1.0}, r"shape \(4,\)"),
        (npy(tmp_path, np.array([["a"]]), "words.npy"), {"cell": 1.0}, "plain numbers"),
        (npy(tmp_path, np.array([[None]]), "objects.npy"), {"cell": 1.0}, "no .npy of plain numbers"),
        (npy(tmp_path, 100.0 * np.indices((9, 9))[0], "steep.npy"), {"cell": 1.0}, "deg steep"),
        (grey(tmp_path, np.zeros((9, 9), np.uint8)), {"cell": 1.0}, "terrain.relief is.*give it"),
        (grey(tmp_path, np.zeros((9, 9, 3), np.uint8), "rgb.png"), sizes, "mode RGB"),
        (tmp_path / "bad.png", sizes, "no .png of plain numbers|cannot be read"),
        (tmp_path / "bad.tif", {}, "no GeoTIFF"),
        (tmp_path / "gone.tif", {}, "No such file"),
    ):
        with pytest.raises(DataError, match=says):
            from_grid(path, **content)


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


# Orientation, by an independent computation: heights are a formula of east and north, and the ground must have them.


def of_place(x, y):
    """A ground that is mirrored or turned in no way onto itself: x to the east, y to the north [m]."""
    return 0.3 * x - 0.1 * y + 0.05 * x * y + 0.02 * x**2


ROWS, COLUMNS, WIDTH = 30, 50, 0.25
EAST = WIDTH * (np.arange(COLUMNS) - (COLUMNS - 1) / 2)
NORTH_FIRST = WIDTH * ((ROWS - 1) / 2 - np.arange(ROWS))
MAP = of_place(EAST[None, :], NORTH_FIRST[:, None])


def esri(tmp_path, heights=MAP, header="", width=WIDTH, name="dem.asc"):
    rows, columns = heights.shape
    head = f"ncols {columns}\nnrows {rows}\nxllcorner {WEST}\nyllcorner {NORTH}\ncellsize {width}\n{header}"
    (tmp_path / name).write_text(head + "\n".join(" ".join(map(repr, row)) for row in heights.tolist()) + "\n")
    return tmp_path / name


def matlab(tmp_path, heights=MAP):
    from scipy.io import savemat

    savemat(tmp_path / "dem.mat", {"ground": heights})
    return tmp_path / "dem.mat"


def matrix_csv(tmp_path, heights=MAP, delimiter=",", name="dem.csv"):
    np.savetxt(tmp_path / name, heights, delimiter=delimiter, fmt="%.17g")
    return tmp_path / name


FORMATS = {
    "npy": (npy, {"cell": WIDTH}, 0.0),
    "esri": (esri, {}, 0.0),
    "mat": (matlab, {"cell": WIDTH}, 0.0),
    "csv": (matrix_csv, {"cell": WIDTH}, 0.0),
    "blanks": (lambda path, map_: matrix_csv(path, map_, " ", "dem.txt"), {"cell": WIDTH}, 0.0),
    "tabs": (lambda path, map_: matrix_csv(path, map_, "\t", "dem.tsv"), {"cell": WIDTH}, 0.0),
    "png": (
        lambda path, map_: grey(path, np.rint(65535 * (map_ - map_.min()) / np.ptp(map_)).astype(np.uint16)),
        {"cell": WIDTH, "relief": float(np.ptp(MAP))},
        float(np.ptp(MAP)) / 65535,
    ),
    "tif": (lambda path, map_: None, {}, 0.0),
}


@pytest.mark.parametrize("kind", FORMATS)
def test_north_is_positive_y_and_east_positive_x(kind, tmp_path, geotiff):
    """Heights, slopes, normals and values between the points are those of the formula, in every format."""
    write, sizes, tolerance = FORMATS[kind]
    path = geotiff(MAP) if kind == "tif" else write(tmp_path, MAP)
    ground = from_grid(path, **sizes)
    lowest = MAP.min()
    x, y = np.meshgrid(EAST, NORTH_FIRST)
    assert ground.height(x, y) == pytest.approx(of_place(x, y) - lowest, abs=tolerance + 1e-9)
    low_x, high_x, low_y, high_y = ground.extent
    assert (low_x, high_x, low_y, high_y) == pytest.approx((EAST[0], EAST[-1], NORTH_FIRST[-1], NORTH_FIRST[0]))
    # The formula is of second degree in x alone, so that the mean of two neighbours is above it by 0.02 (w/2)^2 ...
    mid_x, mid_y = 0.5 * (EAST[7] + EAST[8]), 0.5 * (NORTH_FIRST[11] + NORTH_FIRST[12])
    expected = of_place(mid_x, mid_y) - lowest + 0.02 * (WIDTH / 2) ** 2
    assert ground.height(mid_x, mid_y) == pytest.approx(expected, abs=tolerance + 1e-9)
    # ... and its slope there is the formula's own.
    slope = (0.3 + 0.05 * mid_y + 0.04 * mid_x, -0.1 + 0.05 * mid_x)
    assert ground.gradient(mid_x, mid_y) == pytest.approx(slope, abs=4.0 * tolerance / WIDTH + 1e-9)
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1.0 + slope[0] ** 2 + slope[1] ** 2)
    assert ground.normal(mid_x, mid_y) == pytest.approx(normal, abs=4.0 * tolerance / WIDTH + 1e-9)
    assert ground.slope_at(mid_x, mid_y, np.pi / 2) == pytest.approx(
        np.arctan(slope[1]), abs=4 * tolerance / WIDTH + 1e-9
    )


def test_a_corner_is_where_it_is_in_the_picture(tmp_path):
    """A single stone in the north-east corner, top right of every picture."""
    picture = np.zeros((4, 6), dtype=np.uint16)
    picture[0, -1] = 65535
    ground = from_grid(grey(tmp_path, picture), cell=1.0, relief=0.5)
    assert ground.height(2.5, 1.5) == pytest.approx(0.5)
    assert [ground.height(-2.5, 1.5), ground.height(-2.5, -1.5), ground.height(2.5, -1.5)] == pytest.approx([0.0] * 3)


# Cells without a height.


def with_codes(count=20):
    heights = MAP.copy()
    heights[3, 5 : 5 + count] = 1e20
    heights[10, 40] = -9999.0
    return heights


def test_values_that_no_ground_can_have_are_named(tmp_path):
    with pytest.raises(DataError, match=r"21 of 1500 cells.*20 at 1e\+20.*1 at -9999.*row 3, column 5.*fill.*cut"):
        from_grid(npy(tmp_path, with_codes()), cell=WIDTH)
    with pytest.raises(DataError, match=r"2 of 1500 cells.*1 have none in the file.*1 at -32768"):
        from_grid(esri(tmp_path, np.where(MAP[2, 2] == MAP, -1.0e4, np.where(MAP[9, 9] == MAP, -32768.0, MAP)),
                       "NODATA_value -10000\n"))  # fmt: skip


def test_a_wall_is_no_missing_height(tmp_path):
    """A table of several heights is refused for its wall; a step that a slope can join is ground."""
    table = MAP + np.where(np.indices(MAP.shape)[1] > 40, 40.0, 0.0)
    with pytest.raises(DataError, match="deg steep"):
        from_grid(npy(tmp_path, table), cell=WIDTH)
    spike = np.zeros((5, 5))
    spike[2, 2] = 57.0 * WIDTH
    assert from_grid(npy(tmp_path, spike), cell=WIDTH).z.max() == 57.0 * WIDTH
    spike[2, 2] = 57.5 * WIDTH
    with pytest.raises(DataError, match=r"1 at 14\.375"):
        from_grid(npy(tmp_path, spike), cell=WIDTH)


@pytest.mark.parametrize("code", [np.nan, -9999.0])
def test_filled_cells_continue_the_ground_around(tmp_path, code):
    """A hole of 6 x 8 cells: a membrane over a saddle is the saddle itself, whose Laplacian is zero."""
    saddle = 0.2 * EAST[None, :] * NORTH_FIRST[:, None] + 0.1 * EAST[None, :] - 0.05 * NORTH_FIRST[:, None]
    holed = saddle.copy()
    holed[10:16, 20:28] = code
    ground = from_grid(npy(tmp_path, holed), cell=WIDTH, missing="fill")
    z = ground.z.T[::-1]
    assert z - z[0, 0] == pytest.approx(saddle - saddle[0, 0], abs=0.02 * np.ptp(saddle[9:17, 19:29]))
    is_known = holed == saddle
    assert (z - z[0, 0])[is_known] == pytest.approx((saddle - saddle[0, 0])[is_known], abs=1e-12)


def test_a_cut_keeps_the_largest_rectangle_at_its_place(tmp_path):
    """By trying every rectangle of a small map; places are those of the whole map."""
    random = np.random.default_rng(3)
    for _ in range(30):
        rows, columns = random.integers(2, 8, 2)
        full = random.random((rows, columns)) > 0.15
        heights = np.where(full, random.normal(0.0, 0.1, full.shape), np.nan)
        squares = (full[t : t + 2, c : c + 2].all() for t in range(rows - 1) for c in range(columns - 1))
        best = max(
            ((b - t) * (r - left), t, b, left, r)
            for t in range(rows) for b in range(t + 2, rows + 1)
            for left in range(columns) for r in range(left + 2, columns + 1)
            if full[t:b, left:r].all()
        ) if any(squares) else None  # fmt: skip
        try:
            ground = from_grid(npy(tmp_path, heights), cell=1.0, missing="cut")
        except DataError:
            continue  # the largest rectangle is a row or column
        assert best is not None
        assert ground.z.size == best[0]
        z = ground.z.T[::-1]
        x, y = np.meshgrid(np.arange(columns) - (columns - 1) / 2, (rows - 1) / 2 - np.arange(rows))
        low_x, high_x, low_y, high_y = ground.extent
        stored = (x >= low_x) & (x <= high_x) & (y >= low_y) & (y <= high_y)
        assert ground.height(x[stored], y[stored]) == pytest.approx(heights[stored] - heights[stored].min())
        assert z.min() == 0.0


def test_what_cannot_be_filled_or_cut_is_refused(tmp_path):
    mostly = np.where(np.indices(MAP.shape)[0] > 12, np.nan, MAP)
    stripes = np.where(np.indices(MAP.shape)[0] % 2 == 0, np.nan, MAP)
    for heights, missing, says in (
        (mostly, "fill", "too many to fill"),
        (stripes, "cut", "no two rows"),
        (np.full_like(MAP, np.nan), "fill", "no cell"),
        (MAP, "mend", "fill or cut"),
    ):
        with pytest.raises(DataError, match=says):
            from_grid(npy(tmp_path, heights), cell=WIDTH, missing=missing)


# ESRI ASCII grids and bare matrices.


def test_an_esri_grid_is_read_by_its_content(tmp_path):
    """Centres instead of corners, capitals, numbers wrapped over lines, and any suffix."""
    words = " ".join(map(repr, MAP.ravel().tolist())).split()
    wrapped = "\n".join(" ".join(words[at : at + 7]) for at in range(0, len(words), 7))
    head = f"NCOLS {COLUMNS}\r\nNROWS {ROWS}\r\nXLLCENTER 0\r\nYLLCENTER 0\r\nCELLSIZE {WIDTH}\r\nNODATA_VALUE -1\r\n"
    (tmp_path / "dem.txt").write_text(head + wrapped)
    assert from_grid(tmp_path / "dem.txt") == from_grid(npy(tmp_path, MAP), cell=WIDTH)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("ncols 3\nnrows 2\ncellsize 1\n1 2 3\n4 5\n", "2 rows of 3 cells, and 5 numbers"),
        ("ncols 3\nnrows 2\n1 2 3\n4 5 6\n", "cellsize"),
        ("ncols 3\nnrows 2\ncellsize 1\n1 2 x\n4 5 6\n", "'x'"),
        ("ncols three\nnrows 2\ncellsize 1\n1 2 3\n4 5 6\n", "'three'"),
        ("ncols 100000\nnrows 100000\ncellsize 1\n1 2 3\n", "100000 rows of 100000"),
        ("ncols nan\nnrows 2\ncellsize 1\n1 2 3\n", "ncols"),
        ("ncols 1\nnrows 2\ncellsize 1\n1 2\n", "two rows and two columns"),
    ],
)
def test_esri_grids_that_are_refused(tmp_path, text, says):
    (tmp_path / "dem.asc").write_text(text)
    with pytest.raises(DataError, match=says):
        from_grid(tmp_path / "dem.asc")


@pytest.mark.parametrize(
    ("text", "z"),
    [
        ("0,1,2\n0,0,1\n", [[0, 1, 2], [0, 0, 1]]),
        ("0;0,5\n0;1,5\n", [[0, 0.5], [0, 1.5]]),
        ("0 1\n\n0 0.5\n", [[0, 1], [0, 0.5]]),
        ("0,1,\n0,0,\n", [[0, 1], [0, 0]]),
    ],
)
def test_a_matrix_of_text_has_any_delimiter(tmp_path, text, z):
    (tmp_path / "dem.csv").write_text(text)
    assert from_grid(tmp_path / "dem.csv", cell=1.0).z.T[::-1].tolist() == z


@pytest.mark.parametrize(
    ("text", "cell", "says"),
    [
        ("0,1\n0,1\n", 0.0, "terrain.cell"),
        ("0,1\n0\n", 1.0, "line 2: this line has 1 cells"),
        ("a,b\n0,1\n", 1.0, "'a'"),
        ("0,,1\n0,1,2\n", 1.0, "1 have none"),
        (",0,1\n0,1,2\n", 1.0, "1 have none"),
        ("", 1.0, "two rows"),
    ],
)
def test_matrices_that_are_refused(tmp_path, text, cell, says):
    (tmp_path / "dem.csv").write_text(text)
    with pytest.raises(DataError, match=says):
        from_grid(tmp_path / "dem.csv", cell=cell)


def test_a_mat_with_several_matrices_is_refused(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "two.mat", {"a": MAP, "b": MAP})
    with pytest.raises(DataError, match="a, b"):
        from_grid(tmp_path / "two.mat", cell=WIDTH)


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (1, 5), (0, 0)])
def test_a_map_without_cells_is_refused(tmp_path, shape):
    with pytest.raises(DataError, match="two rows"):
        from_grid(npy(tmp_path, np.zeros(shape)), cell=WIDTH)


# Size: what a file becomes, not its bytes.

READ = """
import resource, sys
from rover_pin.terrain.files import from_grid
from rover_pin.base.errors import DataError
import PIL.Image, importlib.util
importlib.util.find_spec("rasterio") and __import__("rasterio")
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    from_grid(sys.argv[1], **{name: float(value) for name, value in (word.split("=") for word in sys.argv[2:])})
except DataError as error:
    print(error)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


def peak_of(path, *words):
    """Return the last line of what reading says, and by how many MiB its memory grew."""
    done = subprocess.run([sys.executable, "-c", READ, str(path), *words], capture_output=True, text=True, check=True)
    *lines, grown = done.stdout.splitlines()
    return " ".join(lines), int(grown)


def large(kind, tmp_path, side):
    """Write a level map of this many rows and columns in a few kB, where the format can; return its path."""
    level = np.zeros((side, side), dtype=np.uint8)
    if kind == "png":
        Image.MAX_IMAGE_PIXELS, limit = None, Image.MAX_IMAGE_PIXELS
        path = grey(tmp_path, level)
        Image.MAX_IMAGE_PIXELS = limit
        return path
    rasterio = pytest.importorskip("rasterio")
    profile = {"width": side, "height": side, "count": 1, "dtype": "uint8", "compress": "deflate"}
    with rasterio.open(
        tmp_path / "a.tif",
        "w",
        driver="GTiff",
        crs="EPSG:32633",
        transform=rasterio.Affine(CELL, 0, WEST, 0, -CELL, NORTH),
        **profile,
    ) as file:
        file.write(level, 1)
    return tmp_path / "a.tif"


@pytest.mark.parametrize(("kind", "words"), [("png", ("cell=1", "relief=1")), ("tif", ())])
def test_a_map_beyond_the_limit_is_refused_before_it_is_decoded(kind, words, tmp_path):
    """11,000 x 11,000 cells in 0.5 MB took 5.7 GB."""
    lines, grown = peak_of(large(kind, tmp_path, 11_000), *words)
    assert "11000 rows of 11000 cells" in lines
    assert str(MAX_HEIGHTS) in lines
    assert grown < 100


@pytest.mark.nightly
@pytest.mark.parametrize(("kind", "words"), [("png", ("cell=1", "relief=1")), ("tif", ())])
def test_a_map_at_the_limit_takes_a_gibibyte(kind, words, tmp_path):
    side = math.isqrt(MAX_HEIGHTS)
    lines, grown = peak_of(large(kind, tmp_path, side), *words)
    assert not lines
    assert grown < 1024
