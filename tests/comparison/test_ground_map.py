"""Maps by the command: as single drives, symmetric as the ground is, no way where it is steep, where a DEM lies."""

import json

import numpy as np
import pandas as pd
import pytest

from rover_pin.scenarios.scenario import scenario
from rover_pin.simulation.model.toml_file import write_model
from rover_pin.terrain.files import to_grid
from rover_pin.terrain.terrain import HeightGrid


@pytest.fixture
def mapped(run):
    """Run `rover-pin map` on one core; return what it prints, its places and its drives."""

    def command(*words):
        code, out, err = run("map", *words, "--workers", "1", "--out", "here", "--json")
        assert code == 0, err
        return json.loads(out), pd.read_csv("here/map.csv"), pd.read_csv("here/results.csv")

    return command


def ground(path, formula, half=(2.0, 1.5), step=0.05):
    """Write a grid of heights around the origin."""
    x, y = (step * np.arange(-round(end / step), round(end / step) + 1) for end in half)
    return to_grid(path, HeightGrid(x[0], y[0], step, step, formula(*np.meshgrid(x, y, indexing="ij"))))


def test_a_map_of_a_plane_is_that_of_drives_up_a_slope(mapped):
    output, places, drives = mapped(
        "cross-slope", "--set", "terrain.angle_deg=10", "--headings", "4", "--box", "3,5,0,0", "--spacing", "2m"
    )  # fmt: skip
    trace = scenario("incline", **{"terrain.angle_deg": 10.0, "start.x": 3.0, "duration": "6.0s"}).drive()
    way = np.linalg.norm([trace[f"body_{axis}"][-1] - trace[f"body_{axis}"][0] for axis in "xyz"])
    rims = np.trapezoid(trace.stack("wheel_rate").mean(axis=1), trace.t) * trace.attrs["wheel_radii_m"][0]
    assert output["places"].startswith("2 by 1, every 2 m from x = 3 m, y = 0 m")
    assert np.ptp(places["slip"]) < 1e-4
    assert places["slip"][0] == pytest.approx(1.0 - way / rims, abs=0.01)
    assert places["energy_J_per_m"][0] == pytest.approx(trace["energy_electric"][-1] / way, rel=0.05)
    assert places["slope_deg"].to_numpy() == pytest.approx([10.0, 10.0])
    up = drives.loc[drives["slip"].idxmax()]
    assert np.degrees(up["start.yaw"]) == pytest.approx(90.0)
    assert output["max_slip"] == up["slip"]
    assert "one model" in output["stuck"]


@pytest.mark.slow
def test_a_symmetric_ground_has_a_symmetric_map(mapped, tmp_path):
    ground(tmp_path / "ridge.npz", lambda x, y: 0.2 * np.exp(-(y**2) - 0.2 * x**2))
    _, places, _ = mapped("grid", "--set", "terrain.path=ridge.npz", "--headings", "4", "--spacing", "0.8")
    maps = places.pivot(index="x_m", columns="y_m")
    for name in ("slip", "energy_J_per_m", "slope_deg", "roughness_mm"):
        numbers = maps[name].to_numpy()
        assert numbers.shape == (4, 3)
        assert numbers == pytest.approx(numbers[:, ::-1], rel=1e-4)
        assert np.ptp(numbers) > 0.0


def test_stuck_models_are_more_the_steeper_it_is(mapped, tmp_path):
    (tmp_path / "posterior").mkdir()
    for at, k in enumerate((0.01, 0.03, 0.06)):
        write_model(scenario("flat", **{"soil.k": k}).model, tmp_path / "posterior" / f"{at}.toml")
    ground(tmp_path / "bowl.npz", lambda x, y: 0.2 * (x + 2.0) ** 2 * (x > -2.0), (3.0, 1.0))
    output, places, drives = mapped(
        *("grid", "--set", "terrain.path=bowl.npz", "--model", "posterior", "--headings", "1"),
        *("--box", "-2.3,1.8,0,0", "--spacing", "0.4", "--set", "duration=4"),
    )
    assert (output["cases"], output["failed"]) == (3 * len(places), 0)
    shares = places["p_stuck"].to_numpy()
    assert np.all(np.diff(shares) >= 0.0)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    at = drives[drives["start.x"] == places["x_m"][3]]
    assert places["slip"][3] == pytest.approx(np.median(at["slip"]))
    assert places["slip_95"][3] == pytest.approx(at["slip"].max())
    again, *_ = mapped(
        *("grid", "--set", "terrain.path=bowl.npz", "--model", "posterior", "--headings", "1"),
        *("--box", "-2.3,1.8,0,0", "--spacing", "0.4", "--set", "duration=4"),
    )
    assert again["taken_over"] == again["cases"]


@pytest.mark.slow
def test_a_dem_is_mapped_in_its_own_coordinates(mapped, tmp_path):
    rasterio = pytest.importorskip("rasterio")
    rows, columns = np.indices((40, 60))
    heights = 1800.0 + 0.1 * np.sin(columns / 9.0) + 0.004 * rows
    transform = rasterio.Affine(0.1, 0.0, 300_000.0, 0.0, -0.1, 5_000_000.0)
    profile = {"width": 60, "height": 40, "count": 1, "dtype": "float64", "crs": "EPSG:32633", "transform": transform}
    with rasterio.open(tmp_path / "dem.tif", "w", driver="GTiff", **profile) as file:
        file.write(heights[None])
    output, places, _ = mapped("grid", "--set", "terrain.path=dem.tif", "--headings", "1", "--spacing", "1")
    assert output["files"] == ["here/map.csv", "here/map.png", "here/map.tif"]
    with rasterio.open("here/map.tif") as raster:
        slip, slope = (raster.read(1 + raster.descriptions.index(name)) for name in ("slip", "slope_deg"))
        for _, place in places.iterrows():
            at = raster.index(300_003.0 + place["x_m"], 4_999_998.0 + place["y_m"])
            assert (slip[at], slope[at]) == pytest.approx((place["slip"], place["slope_deg"]))
    assert slip.size == len(places) > 4


def test_a_drive_says_how_the_ground_under_it_lies(run):
    code, out, _ = run("drive", "cross-slope", "--set", "terrain.angle_deg=10", "--set", "duration=1", "--json")
    assert code == 0
    assert json.loads(out)["max_ground_slope_deg"] == pytest.approx(10.0)
    assert json.loads(out)["max_ground_roughness_mm"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("hills", "--box", "0,1,2"), "--box 0,1,2"),
        (("hills", "--box", "30,40,0,1"), "no place for a drive"),
        (("hills", "--set", "duration=1000"), "no place for a drive"),
        (("hills", "--headings", "0"), "1 to 360"),
        (("hills", "--spacing", "-1"), "spacing = -1 m"),
        (("hills", "--set", "terain.seed=2"), "terrain.seed"),
    ],
)
def test_maps_that_are_refused(run, words, says):
    code, _, err = run("map", *words)
    assert code == 2
    assert says in err
