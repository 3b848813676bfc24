"""The estimated ground is the least of the sum that its docstring states, worked out here without its matrices."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from rover_pin.logs.run_terrain import _Grid, estimated, level_on, run_terrain
from rover_pin.rover.rover import load_rover
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.shapes import incline

CART = load_rover("cart")
LENGTH, TRACK, MIDDLE = 0.56, 0.52, (0.0, 0.0)
"""Between the cart's axles and its sides, and where their middle is from its base [m]."""
SLOPE, HEIGHT, BEND = math.radians(0.5), 0.03, 0.15


def drive(seconds=12.0, reach=1.0, without=()):
    """A winding drive at 10 Hz over waves, whose channels were all measured, with gaps, at a tracker's own zero."""
    random, t = np.random.default_rng(4), 3.0 + 0.1 * np.arange(round(10 * seconds))
    x, y = reach * 0.1 * (t - 3.0), reach * 0.3 * np.sin(0.5 * t)
    made = {"body_x": x + 2.0, "body_y": y - 1.0, "body_yaw": 0.3 * np.cos(0.5 * t) + 0.05 * random.normal(size=len(t))}
    made |= {"body_pitch": 0.2 * np.sin(3.0 * x) + 0.02 * random.normal(size=len(t)), "body_roll": 0.1 * np.cos(x + y)}
    made |= {"body_z": 7.0 + 0.05 * np.sin(2.0 * x) + 0.01 * random.normal(size=len(t))}
    made["body_pitch"][60:66] = made["body_z"][30:36] = made["body_yaw"][81:84] = made["body_x"][90:95] = np.nan
    made["body_pitch"][:5] = 1.2  # steeper than any rover stands
    return Trace({"t_s": t, **{name: row for name, row in made.items() if name not in without}}, {}, {})


def halves(run):
    """Means of half seconds in which x, y and yaw are known, of the rows in which they are."""
    place = np.array([run[f"body_{name}"] for name in ("x", "y", "yaw")])
    known = np.isfinite(place).all(axis=0)
    group = np.floor((run.t - run.t[0] + 1e-5) / 0.5)[known]
    return {
        name: np.array([run[name][known][group == one].mean() for one in np.unique(group)])
        for name in run if name.startswith("body_")
    }  # fmt: skip


def sum_of_squares(ground, run, z):
    """Return what is minimised, of a ground with these heights."""
    nx, ny = z.shape
    axes = ground.x0 + ground.dx * np.arange(nx), ground.y0 + ground.dy * np.arange(ny)
    look = RegularGridInterpolator(axes, z)
    b = halves(run)
    x, y, yaw = (b[f"body_{name}"] for name in ("x", "y", "yaw"))
    under = {}
    for front in (1.0, -1.0):
        for left in (1.0, -1.0):
            ahead, aside = front * LENGTH / 2 + MIDDLE[0], left * TRACK / 2 + MIDDLE[1]
            under[front, left] = look((x + ahead * np.cos(yaw) - aside * np.sin(yaw),
                                       y + ahead * np.sin(yaw) + aside * np.cos(yaw)))  # fmt: skip
    rises = {
        "body_pitch": -sum(front * z for (front, _), z in under.items()) / (2.0 * LENGTH),
        "body_roll": sum(left * z for (_, left), z in under.items()) / (2.0 * TRACK),
    }
    total = 0.0
    for name, rise in rises.items():
        if name in b:
            total += np.nansum((rise - np.tan(np.clip(b[name], -math.pi / 4, math.pi / 4))) ** 2) / SLOPE**2
    if "body_z" in b:
        off = (sum(under.values()) / 4.0 - b["body_z"])[np.isfinite(b["body_z"])]
        total += np.sum((off - off.mean()) ** 2) / HEIGHT**2
    size = ground.dx
    straight = np.sum(np.diff(z, 2, axis=0) ** 2) + np.sum(np.diff(z, 2, axis=1) ** 2)
    twisted = np.sum(np.diff(np.diff(z, axis=0), axis=1) ** 2)
    return total + (straight + 2.0 * twisted) / (BEND * size) ** 2


@pytest.mark.parametrize("without", [(), ("body_roll", "body_z"), ("body_pitch", "body_roll"), ("body_z",)])
def test_no_change_of_its_heights_makes_the_sum_less(without):
    """The sum is quadratic: its slope along any change of the heights, by a difference, is that of round-off."""
    run = drive(without=without)
    ground, random = estimated(run, CART), np.random.default_rng(0)
    z = np.array(ground.z)
    near = np.exp(-((np.arange(z.shape[0])[:, None] - z.shape[0] / 2) ** 2 + (np.arange(z.shape[1]) - 5.0) ** 2) / 8.0)
    for change in (*random.normal(size=(8, *z.shape)), near, np.eye(*z.shape), np.add.outer(np.arange(len(z)), z[0])):
        ends = [sum_of_squares(ground, run, z + step * change) for step in (0.01, -0.01)]
        least = sum_of_squares(ground, run, z)
        curvature = 0.5 * (ends[0] + ends[1]) - least
        assert curvature > 0.0
        assert abs(0.5 * (ends[0] - ends[1])) < 1e-5 * curvature
    assert z.mean() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("reach", "size"), [(1.0, 0.56 / 7.0), (40.0, None)])
def test_grid_extends_one_base_beyond_the_path_in_its_cell_size(reach, size):
    run = drive(reach=reach)
    ground, b = estimated(run, CART), halves(run)
    ranges = [np.ptp(b[f"body_{name}"]) + 2.0 * LENGTH for name in ("x", "y")]
    size = size or max(ranges) / 100.0
    assert ground.dx == ground.dy == pytest.approx(size)
    assert (ground.x0, ground.y0) == pytest.approx([b[f"body_{name}"].min() - LENGTH for name in ("x", "y")])
    assert ground.z.shape == tuple(math.ceil(each / size - 1e-9) + 1 for each in ranges)


def test_a_turn_in_place_has_a_ground_too():
    run = drive()
    still = {"body_x": np.full(len(run.t), 2.0), "body_y": np.full(len(run.t), -1.0)}
    ground = estimated(dataclasses.replace(run, channels={**run.channels, **still}), CART)
    assert ground.z.shape in ((15, 15), (16, 16))
    assert np.isfinite(ground.z).all()


@pytest.mark.parametrize("slope", [0.12, -0.3])
def test_a_plank_lies_on_a_plane_as_the_plane_does(slope):
    """Along its way up it is nose up, which is a negative pitch; across it its right or left side is up."""
    ground, yaw = incline(slope, -50.0), np.array([0.0, math.pi, 0.5 * math.pi, -0.5 * math.pi])
    found = level_on(ground, CART, np.column_stack([np.arange(4.0), 0.3 * np.ones(4), yaw]))
    np.testing.assert_allclose(found["body_pitch"], [-slope, slope, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found["body_roll"], [0.0, 0.0, -slope, slope], atol=1e-9)
    np.testing.assert_allclose(np.diff(found["body_z"]), np.tan(slope), atol=1e-9)


def test_a_rover_stands_on_the_mean_of_its_corners():
    """On z = x^4 + y^4, heading along x: its ends rise by 4 x^3 + x L^2 of their distance, for either side alike."""
    bowl = type("Bowl", (), {"height": staticmethod(lambda x, y: x**4 + y**4)})
    x, y = np.array([0.5, -0.8]), np.array([0.7, 0.2])
    found = level_on(bowl, CART, np.column_stack([x, y, 0.0 * x]))
    np.testing.assert_allclose(np.tan(found["body_pitch"]), -(4 * x**3 + x * LENGTH**2))
    np.testing.assert_allclose(np.tan(found["body_roll"]), 4 * y**3 + y * TRACK**2)
    mean = [x**4 + 6 * x**2 * h**2 + h**4 for x, h in ((x, LENGTH / 2), (y, TRACK / 2))]
    np.testing.assert_allclose(found["body_z"], mean[0] + mean[1])


def test_declared_plane_extends_five_metres_around_the_drive():
    run = drive(reach=3.0)
    ground, known = run_terrain({"slope": 0.1}, run, CART, "here"), np.isfinite(run["body_x"] + run["body_yaw"])
    x, y = run["body_x"][known], run["body_y"][known]
    half = 5.0 + max(np.ptp(x), np.ptp(y))
    assert (ground.x0, ground.y0) == pytest.approx([(x.min() + x.max()) / 2 - half, (y.min() + y.max()) / 2 - half])
    assert ground.z.shape == (2, 2)
    assert (ground.dx, ground.dy) == pytest.approx((2.0 * half, 2.0 * half))
    assert ground.z.sum() == pytest.approx(0.0, abs=1e-9)
    yaw = run["body_yaw"][0]
    assert np.ptp(ground.z[:, 0]) / ground.dx == pytest.approx(math.tan(0.1) * math.cos(yaw))


@pytest.mark.parametrize("lost", ["body_x", "body_y", "body_yaw"])
def test_declared_plane_begins_where_place_and_heading_are_known(lost):
    """Rows at which one of them is unknown count for neither: as if the drive had begun behind them."""
    run = drive(reach=3.0, without=("body_pitch", "body_roll", "body_z"))
    channels = {name: np.array(run[name]) for name in run}
    channels[lost][:20] = np.nan
    late = dataclasses.replace(run, channels={name: row[20:] for name, row in channels.items()})
    found, same = (
        run_terrain({"slope": 0.1}, each, CART, "") for each in (dataclasses.replace(run, channels=channels), late)
    )
    assert (found.x0, found.y0, found.dx) == (same.x0, same.y0, same.dx)
    np.testing.assert_array_equal(found.z, same.z)
    assert np.isfinite(found.z).all()


def test_heights_between_grid_corners_are_bilinear_to_the_edges():
    grid, random = _Grid(-1.0, 2.0, 0.5, 4, 3), np.random.default_rng(3)
    z = random.normal(size=(4, 3))
    look = RegularGridInterpolator((-1.0 + 0.5 * np.arange(4), 2.0 + 0.5 * np.arange(3)), z)
    inside = [random.uniform(-1.0, 0.5, 50), random.uniform(2.0, 3.0, 50)]
    x, y = (
        np.append(a, b.ravel()) for a, b in zip(inside, np.meshgrid([-1.0, -0.6, 0.5], [2.0, 2.7, 3.0]), strict=True)
    )
    np.testing.assert_allclose(grid.at(x, y) @ z.ravel(), look((x, y)), atol=1e-12)


def test_grid_reaches_the_farthest_wheel_if_it_is_beyond_a_base():
    """A frame 0.4 m before the middle: the back wheels stand 0.68 m behind it, 0.26 m aside."""
    ahead = CART.model.copy()
    for mount in CART.wheels:
        placement = ahead.jointPlacements[mount.joint].copy()
        placement.translation = placement.translation - np.array([0.4, 0.0, 0.0])
        ahead.jointPlacements[mount.joint] = placement
    run = drive()
    ground, b = estimated(run, dataclasses.replace(CART, model=ahead)), halves(run)
    assert ground.x0 == pytest.approx(b["body_x"].min() - math.hypot(0.68, 0.26))


def test_a_kilometre_straight_ahead_has_a_ground_of_two_rows():
    """Its cells are longer than the rover: across the way there is no third row to bend."""
    t = np.arange(0.0, 2000.0, 0.5)
    channels = {"t_s": t, "body_x": t, "body_pitch": np.full(len(t), -0.05)}
    run = Trace({**channels, "body_y": 0.0 * t, "body_yaw": 0.0 * t}, {}, {})
    ground = estimated(run, CART)
    assert ground.z.shape == (101, 2)
    rise = ground.height(1500.0, 0.0) - ground.height(500.0, 0.0)
    assert rise / 1000.0 == pytest.approx(math.tan(0.05), rel=1e-4)
