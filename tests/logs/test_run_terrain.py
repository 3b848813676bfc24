"""The ground of a single run: declared as a slope, or told by pitch, roll and height."""

import dataclasses
import math

import numpy as np
import pytest

from rover_pin import Trace, load_rover
from rover_pin.base.errors import DataError
from rover_pin.experiments.drive_log.features import logged_runs
from rover_pin.experiments.drive_log.model import LEVEL_SD, base_model, nuisances, with_spread
from rover_pin.logs.drive_log import LogMetadata, read_drive_log, write_drive_log
from rover_pin.logs.run_terrain import (
    BEND_SD,
    SLOPE_SD,
    estimate_ground,
    estimate_surface,
    level_on,
    run_terrain,
    shared_grounds,
)

CART = load_rover("cart")
DEG = math.pi / 180.0


def run(yaw=0.0, pitch=0.0, roll=0.0, seconds=40.0, curve=0.0, **more):
    """A drive of 0.1 m/s along a heading; pitch and roll as functions of the way, or constant."""
    t = np.arange(0.0, seconds, 0.1)
    heading = yaw + curve * t
    x, y = (np.cumsum(0.01 * angle(heading)) for angle in (np.cos, np.sin))
    tilt = [angle(x, y, heading) if callable(angle) else np.full(len(t), angle) for angle in (pitch, roll)]
    channels = {"t_s": t, "body_x": x, "body_y": y, "body_yaw": heading, "body_pitch": tilt[0], "body_roll": tilt[1]}
    return Trace({**channels, **{name: angle(x, y) for name, angle in more.items()}}, {}, {})


@pytest.mark.parametrize("yaw", [0.0, 2.0, -1.1])
def test_a_declared_slope_rises_along_the_heading_of_the_start(yaw):
    drive = run(yaw)
    ground = run_terrain({"slope": {"value": 12, "unit": "deg"}}, drive, CART, "here")
    x, y = drive["body_x"], drive["body_y"]
    rise = ground.height(x[-1:], y[-1:]) - ground.height(x[:1], y[:1])
    assert rise[0] == pytest.approx(np.hypot(x[-1] - x[0], y[-1] - y[0]) * math.tan(12 * DEG), rel=1e-9)
    beside = ground.height(x[:1] - math.sin(yaw), y[:1] + math.cos(yaw)) - ground.height(x[:1], y[:1])
    assert beside[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"slope": {"value": 12}}, "slope = 687.5.*45"),
        ({"slope": {"value": 12, "unit": "m"}}, "'m' does not fit"),
        ({"slope": "steep"}, "number"),
        ({"slope": 0.1, "estimated": True}, "either slope"),
        ({"estimated": False}, "either slope"),
        ({"estimated": True, "sl0pe": 3}, "unknown key 'sl0pe'"),
    ],
)
def test_a_slope_that_is_none_is_one_sentence(table, message):
    with pytest.raises(DataError, match=message):
        run_terrain(table, run(), CART, "here")


def slope_of(ground, drive, rows=slice(20, -20)):
    """Slope of a ground along the way [rad], over the wheelbase."""
    x, y, yaw = (drive[f"body_{name}"][rows] for name in ("x", "y", "yaw"))
    ahead = 0.28 * np.array([np.cos(yaw), np.sin(yaw)])
    rise = ground.height(x + ahead[0], y + ahead[1]) - ground.height(x - ahead[0], y - ahead[1])
    return np.arctan(rise / 0.56)


@pytest.mark.parametrize(("yaw", "curve"), [(0.0, 0.0), (2.5, 0.0), (0.3, 0.04)])
def test_the_ground_is_estimated_from_the_pitch(yaw, curve):
    """Nose down is positive: a ground that rises pitches the nose up. The truth is a wave of 3 m."""

    def pitch(x, y, heading):
        return -np.arctan(0.15 * np.sin(2 * math.pi * x / 3) * np.cos(heading))

    drive = run(yaw, pitch, curve=curve)
    slope = slope_of(estimate_surface(drive, CART), drive)
    assert slope == pytest.approx(-drive["body_pitch"][20:-20], abs=1.0 * DEG)


def test_a_frame_before_the_wheels_is_not_where_they_stand():
    """A level is that of the ground under the wheels, wherever a URDF puts the frame of the base."""
    shifted = CART.model.copy()
    for mount in CART.wheels:
        placement = shifted.jointPlacements[mount.joint].copy()
        placement.translation = placement.translation - np.array([0.4, 0.0, 0.0])
        shifted.jointPlacements[mount.joint] = placement
    behind = dataclasses.replace(CART, model=shifted)
    drive = run(0.0, lambda x, y, heading: -np.arctan(0.15 * np.sin(2.0 * x)))
    ground, x = estimate_surface(drive, behind), drive["body_x"][80:-40]
    rise = ground.height(x - 0.12, np.full(len(x), 0.26)) - ground.height(x - 0.68, np.full(len(x), 0.26))
    assert np.arctan(rise / 0.56) == pytest.approx(-drive["body_pitch"][80:-40], abs=0.5 * DEG)
    level = level_on(ground, behind, np.array([[2.0, 0.0, 0.0]]))["body_pitch"][0]
    assert level == pytest.approx(-math.atan(0.15 * math.sin(4.0)), abs=0.5 * DEG)


def wave(height, length=3.0):
    """Pitch of a cart on a ground that waves along x."""
    return lambda x, y, heading: -np.arctan(height * np.sin(2 * math.pi * x / length) * np.cos(heading))


def test_runs_over_one_ground_share_it_and_runs_over_raked_ground_do_not():
    """There and back over one wave; a third drive passes the same place after the sand was raked flat."""
    there = run(0.0, wave(0.15))
    way_back = {name: there[name][::-1] for name in ("body_x", "body_y", "body_roll")}
    turned = {"body_yaw": there["body_yaw"] + math.pi, "body_pitch": -there["body_pitch"][::-1]}
    back = Trace({**there.channels, **way_back, **turned}, {}, {})
    elsewhere = Trace({**there.channels, "body_y": there["body_y"] + 50.0}, {}, {})
    groups = shared_grounds([there, run(0.0), back, elsewhere], CART)
    assert sorted(members for members, _ in groups) == [[0, 2], [1], [3]]


def test_a_second_equal_pass_is_more_probable_than_the_first():
    """The ground is known from the first pass, so that the second one has less that is left open."""
    once, twice = (estimate_ground([run(0.0, wave(0.1), seconds=20.0)] * count, CART) for count in (1, 2))
    assert twice.log_evidence > 2.0 * once.log_evidence


def test_the_shapes_hold_the_bends_that_the_prior_allows():
    """Over one wheelbase, the slope of the field changes with the SD of the prior, and shapes are independent."""
    estimate, length = estimate_ground([run(0.0, wave(0.1))], CART), 0.56
    grid = estimate.terrain
    x, middle = np.arange(0.5, 2.5, 0.2), grid.y0 + 0.5 * grid.dy * (grid.z.shape[1] - 1)
    change = np.zeros((len(x), len(estimate.shapes)))
    for sense, place in ((1.0, x + length), (-1.0, x)):
        change += sense * estimate.slopes_along(place, np.full(len(x), middle), np.zeros(len(x)))
    sd = np.sqrt(np.sum(change**2, axis=1))
    assert np.all((sd > 0.5 * BEND_SD) & (sd < 2.0 * BEND_SD))
    assert sd.min() > SLOPE_SD


def test_where_nothing_tells_the_ground_is_flat():
    bare = run()
    drive = Trace({name: bare[name] for name in bare if name not in ("body_pitch", "body_roll")}, {}, {})
    ground = estimate_surface(drive, CART)
    assert np.ptp(ground.height(drive["body_x"], drive["body_y"])) == 0.0


def log(folder, terrain, traces=None, **rows):
    wheels = tuple(mount.name for mount in CART.wheels)
    runs = {}
    for name, drive in (traces or {"up": run(pitch=-5 * DEG), "down": run(math.pi, pitch=5 * DEG)}).items():
        rates = {f"wheel_rate_{wheel}": np.full(len(drive.t), 1.0) for wheel in wheels}
        runs[name] = Trace({**drive.channels, **rates}, {}, rows.get(name, {}))
    write_drive_log(folder, runs, LogMetadata("slopes", rover="cart", wheels=wheels, terrain=terrain))
    return read_drive_log(folder)


def test_each_run_may_have_a_ground_of_its_own(tmp_path):
    folder = tmp_path / "log"
    log(folder, {"slope": {"value": 5, "unit": "deg"}})
    toml = folder / "drive.toml"
    run_table = 'file = "down.csv"\nterrain = { slope = { value = -3, unit = "deg" } }'
    toml.write_text(toml.read_text().replace('file = "down.csv"', run_table))
    read = read_drive_log(folder)
    rises = [float(slope_of(read.terrain_of(run_read), run_read)[0]) / DEG for run_read in read.runs]
    assert rises == pytest.approx([5.0, -3.0], abs=1e-6)
    terrains = [run_read.commands.terrain for run_read in logged_runs(read, CART)]
    assert terrains[0] is not None
    assert not read.is_estimated(read.runs[0])


def test_the_zero_of_the_level_widens_the_resistance(tmp_path):
    narrow, wide = log(tmp_path / "a", {"slope": 0.1}), log(tmp_path / "b", {"estimated": True})
    sd = {}
    for name, log_folder in (("narrow", narrow), ("wide", wide)):
        model = with_spread(base_model(log_folder), motors=False)
        (parameter,) = (
            parameter for parameter in nuisances(log_folder, model) if parameter.name == "MotionResistance.R"
        )
        sd[name] = parameter.scale
    assert sd["wide"] == pytest.approx(math.hypot(sd["narrow"], LEVEL_SD))
