"""The estimated ground minimises the sum in its docstring. The test computes this sum without the matrices of the
package.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from rover_pin import Trace, load_rover
from rover_pin.logs.run_terrain import estimate_surface, level_on, run_terrain
from rover_pin.terrain.shapes import incline

CART = load_rover("cart")
LENGTH, TRACK, MIDDLE = 0.56, 0.52, (0.0, 0.0)
"""Between the cart's axles and its sides, and where their middle is from its base [m]."""
SLOPE, HEIGHT, BEND = math.radians(0.5), 0.03, 0.15


def drive(seconds=12.0, reach=1.0, without=()):
    """Return a winding drive over waves at 10 Hz with all channels, with gaps, and with an arbitrary zero of the
    tracker.
    """
    random, t = np.random.default_rng(4), 3.0 + 0.1 * np.arange(round(10 * seconds))
    x, y = reach * 0.1 * (t - 3.0), reach * 0.3 * np.sin(0.5 * t)
    channels = {
        "body_x": x + 2.0,
        "body_y": y - 1.0,
        "body_yaw": 0.3 * np.cos(0.5 * t) + 0.05 * random.normal(size=len(t)),
    }
    channels |= {
        "body_pitch": 0.2 * np.sin(3.0 * x) + 0.02 * random.normal(size=len(t)),
        "body_roll": 0.1 * np.cos(x + y),
    }
    channels |= {"body_z": 7.0 + 0.05 * np.sin(2.0 * x) + 0.01 * random.normal(size=len(t))}
    channels["body_pitch"][60:66] = channels["body_z"][30:36] = channels["body_yaw"][81:84] = channels["body_x"][
        90:95
    ] = np.nan
    channels["body_pitch"][:5] = 1.2  # steeper than any rover stands
    return Trace({"t_s": t, **{name: row for name, row in channels.items() if name not in without}}, {}, {})


def halves(run):
    """Return the means over half seconds in which x, y and yaw are known, from the rows in which they are known."""
    place = np.array([run[f"body_{name}"] for name in ("x", "y", "yaw")])
    is_known = np.isfinite(place).all(axis=0)
    group = np.floor((run.t - run.t[0] + 1e-5) / 0.5)[is_known]
    return {
        name: np.array([run[name][is_known][group == value].mean() for value in np.unique(group)])
        for name in run if name.startswith("body_")
    }  # fmt: skip


def sum_of_squares(ground, run, z):
    """Return the sum that the estimate minimises, for a ground with these heights."""
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
    """The sum is quadratic, so that its derivative along any change of the heights, computed by a difference, is zero
    up to round-off.
    """
    run = drive(without=without)
    ground, random = estimate_surface(run, CART), np.random.default_rng(0)
    z = np.array(ground.z)
    values = np.exp(
        -((np.arange(z.shape[0])[:, None] - z.shape[0] / 2) ** 2 + (np.arange(z.shape[1]) - 5.0) ** 2) / 8.0
    )
    for change in (*random.normal(size=(8, *z.shape)), values, np.eye(*z.shape), np.add.outer(np.arange(len(z)), z[0])):
        ends = [sum_of_squares(ground, run, z + step * change) for step in (0.01, -0.01)]
        least = sum_of_squares(ground, run, z)
        curvature = 0.5 * (ends[0] + ends[1]) - least
        assert curvature > 0.0
        assert abs(0.5 * (ends[0] - ends[1])) < 1e-5 * curvature
    assert z.mean() == pytest.approx(0.0, abs=1e-9)


def test_a_turn_in_place_has_a_ground_too():
    run = drive()
    still = {"body_x": np.full(len(run.t), 2.0), "body_y": np.full(len(run.t), -1.0)}
    ground = estimate_surface(dataclasses.replace(run, channels={**run.channels, **still}), CART)
    assert ground.z.shape in ((15, 15), (16, 16))
    assert np.isfinite(ground.z).all()


@pytest.mark.parametrize("slope", [0.12, -0.3])
def test_a_plank_lies_on_a_plane_as_the_plane_does(slope):
    """A plank that points uphill has its nose up, which is a negative pitch. A plank across the slope has its right or
    left side up.
    """
    ground, yaw = incline(slope, -50.0), np.array([0.0, math.pi, 0.5 * math.pi, -0.5 * math.pi])
    poses = level_on(ground, CART, np.column_stack([np.arange(4.0), 0.3 * np.ones(4), yaw]))
    np.testing.assert_allclose(poses["body_pitch"], [-slope, slope, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(poses["body_roll"], [0.0, 0.0, -slope, slope], atol=1e-9)
    np.testing.assert_allclose(np.diff(poses["body_z"]), np.tan(slope), atol=1e-9)


@pytest.mark.parametrize("lost", ["body_x", "body_y", "body_yaw"])
def test_declared_plane_begins_where_place_and_heading_are_known(lost):
    """Rows without a position or without a heading count for neither, as if the drive had begun after them."""
    run = drive(reach=3.0, without=("body_pitch", "body_roll", "body_z"))
    channels = {name: np.array(run[name]) for name in run}
    channels[lost][:20] = np.nan
    late = dataclasses.replace(run, channels={name: row[20:] for name, row in channels.items()})
    ground_early, ground_late = (
        run_terrain({"slope": 0.1}, run_part, CART, "")
        for run_part in (dataclasses.replace(run, channels=channels), late)
    )
    assert (ground_early.x0, ground_early.y0, ground_early.dx) == (ground_late.x0, ground_late.y0, ground_late.dx)
    np.testing.assert_array_equal(ground_early.z, ground_late.z)
    assert np.isfinite(ground_early.z).all()
