"""Terrain files come back as they were written, and say where they are wrong."""

import re

import numpy as np
import pytest

from rover_pin.base.errors import DataError
from rover_pin.terrain import shapes
from rover_pin.terrain.edits import with_ground
from rover_pin.terrain.files import from_grid, from_polyline, to_grid, to_polyline


@pytest.fixture
def write(tmp_path):
    def make(text, name="ground.csv"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return make


def test_polyline_there_and_back(tmp_path):
    terrain = with_ground(shapes.bump(at=1 / 3), 0.1, 0.4, 2)
    assert from_polyline(to_polyline(tmp_path / "new" / "bump.csv", terrain.profiles[0])) == terrain


def test_polyline_from_parquet(tmp_path):
    pandas = pytest.importorskip("pandas")
    path = tmp_path / "ground.parquet"
    pandas.DataFrame({"x_m": [0, 1], "z_m": [0.0, 0.1]}).to_parquet(path)
    assert from_polyline(path).height(0.5, 0.0) == pytest.approx(0.05)


def test_grid_there_and_back(tmp_path):
    terrain = with_ground(shapes.hills(1), 1.0, 2.0, 1)
    assert from_grid(to_grid(tmp_path / "hills.npz", terrain)) == terrain


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "rows"),
        ("x_m,z_m\n", "rows"),
        ("x,z_m\n0,0\n1,0\n", "you mean 'z_m'? Known: x, z_m."),
        ("x_m,x_m\n0,0\n1,0\n", "two columns 'x_m'"),
        ("x_m,z_m\n0,0\n1,\n", "3: column 'z_m' is nan; every row"),
        ("x_m,z_m\n0,0\n1,inf\n", "line 3: column 'z_m' is inf"),
        ("x_m,z_m,ground\n0,0,\n1,0,0\n", "line 2: column 'ground' is nan"),
        ("x_m,z_m\n0,0\n1,low\n", "3: column 'z_m' has 'low'"),
        ("x_m,z_m\n0,0\n1\n", "line 3: 1 cells under 2 column names"),
        ("# a\nx_m,z_m\n0,0\n1,0\n0.5,0\n", "5: column 'x_m'"),
        ("x_m,z_m\n0,0\n1500,50\n", "column 'x_m' reaches 1500"),
        ("x_m,z_m\n0,0\n1,5000\n", "column 'z_m' reaches 5000 m"),
        ("x_m,z_m\n0,0\n", "shape (1,)"),
        ("x_m,z_m,ground\n0,0,0.5\n1,0,0\n", "whole numbers"),
        ("x_m,z_m\n0,0\n0.001,1\n", "89.94 deg steep"),
    ],
)
def test_polyline_refusals(write, text, says):
    with pytest.raises(DataError, match=re.escape(says)):
        from_polyline(write(text))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x_m,z_m\n0,0\n1,0\n", "no column 'y_m'"),
        ("x_m,y_m,z_m\n0,0,0\n0,1,0\n", "column 'x_m' is 0 m everywhere"),
        ("x_m,y_m,z_m\n0,0,0\n0,1,0\n1,0,0\n", "x = 1 m, y = 1"),
        ("x_m,y_m,z_m\n0,0,0\n0,1,0\n1,0,0\n1,1,0\n1,1,0\n", "x = 1 m, y = 1"),
        ("x_m,y_m,z_m\n3,5,0\n3,9,0\n5,9,0\n7,5,0\n7,9,0\n", "x = 5 m, y = 5"),
        ("x_m,y_m,z_m\n3,5,0\n3,9,0\n5,5,0\n7,5,0\n7,9,0\n", "x = 5 m, y = 9"),
        ("x_m,y_m,z_m\n3,5,0\n3,9,0\n3,9,0\n7,5,0\n", "x = 3 m, y = 9"),
        ("x_m,y_m,z_m\n3,5,0\n7,5,0\n7,9,0\n7,9,0\n", "x = 3 m, y = 9"),
        ("x_m,y_m,z_m\n0,0,0\n0,1,0\n1,0,0\n1,1,0\n2.5,0,0\n2.5,1,0\n", "4: column 'x_m' = 1"),
        ("x_m,y_m,z_m\n0,0,0\n0,1,nan\n1,0,0\n1,1,0\n", "line 3: column 'z_m' is nan"),
        ("x_m,y_m,z_m\n0,0,0\n0,1,2e3\n1,0,0\n1,1,0\n", "column 'z_m' reaches 2000 m"),
        ("x_m,y_m,z_m\n0,0,0\n0,1,800\n1,0,0\n1,1,0\n", "between points 0 and 1 along"),
    ],
)
def test_grid_refusals(write, text, says):
    with pytest.raises(DataError, match=re.escape(says)):
        from_grid(write(text))


def test_coordinates_reach_a_kilometre(write):
    assert from_polyline(write("x_m,z_m\n-1000,0\n1000,5\n")).extent.x_high == 1000.0
    with pytest.raises(DataError, match="column 'x_m' reaches 1001 m"):
        from_polyline(write("x_m,z_m\n0,0\n1001,5\n"))


@pytest.mark.parametrize(("off", "refused"), [(0.95e-3, False), (1.05e-3, True), (-0.95e-3, False), (-1.05e-3, True)])
def test_grid_line_may_be_off_by_a_thousandth_of_the_spacing(write, off, refused):
    """The spacing is 2 m; places that differ by round-off are one."""
    x = (1.0, 3.0 + 2.0 * off, 5.0, 7.0)
    rows = "".join(f"{at!r},{y!r},0\n" for at in x for y in (0.5, 0.8))
    file = write("x_m,y_m,z_m\n" + rows.replace("5.0,0.8", f"5.000000000000001,{0.5 + 0.1 + 0.2!r}"))
    if refused:
        with pytest.raises(DataError, match=r"'x_m' =.*spacing 2.*1"):
            from_grid(file)
    else:
        assert from_grid(file).extent == pytest.approx((1.0, 7.0, 0.5, 0.8))


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"x0": 0.0, "y0": 0.0, "dx": 1.0, "dy": 1.0}, "no array 'z'"),
        ({"x0": 0.0, "y0": 0.0, "dx": 1.0, "dy": 1.0, "z": [[0.0, np.nan], [0.0, 0.0]]}, "index (0, 1)"),
        ({"x0": 0.0, "y0": 0.0, "dx": 1.0, "dy": 1.0, "z": np.full((2, 2), 2e3)}, "like millimetres"),
        ({"x0": 0.0, "y0": 0.0, "dx": 1.0, "dy": 1.0, "z": np.array([[None]])}, ".npz"),
    ],
)
def test_npz_refusals(tmp_path, arrays, says):
    path = tmp_path / "grid.npz"
    np.savez(path, **arrays)
    with pytest.raises(DataError, match=re.escape(says)):
        from_grid(path)


def test_files_that_are_not_there_or_something_else(tmp_path, write):
    for read, name in (
        (from_polyline, "no.csv"),
        (from_grid, "no.csv"),
        (from_grid, "no.npz"),
        (from_grid, "no.parquet"),
    ):
        with pytest.raises(DataError, match=re.escape(name) + ": .*No such file"):
            read(tmp_path / name)
    with pytest.raises(DataError, match=r".npz.*arrays"):
        from_grid(write("x", "text.npz"))
    with pytest.raises(DataError, match="is not Parquet"):
        from_polyline(write("x", "text.parquet"))
    (tmp_path / "latin.csv").write_bytes(b"x_m,z_m\n0,\xe9\n")
    with pytest.raises(DataError, match=r"column 'z_m'.*'é'"):
        from_polyline(tmp_path / "latin.csv")
