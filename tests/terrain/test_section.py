"""Patches against a brute-force arc: every point of the rim, its depth below the terrain, its pressure summed."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_pin.terrain.section import _patches_of, lane_share, strips, wheel_frame
from rover_pin.terrain.section import patches as patches_and_sinkage
from rover_pin.terrain.shapes import ditch, flat, incline
from rover_pin.terrain.terrain import HeightGrid, Lanes, Profile

R, B = 0.045, 0.05


def patches(*value):
    return patches_and_sinkage(*value)[0]


def upright(x, z, yaw=0.0, y=0.0):
    return wheel_frame(np.array([x, y, z]), np.array([-math.sin(yaw), math.cos(yaw), 0.0]))


def resultant(expected):
    """Radial pressure in proportion to depth, summed over the patches: the exact resultant for n = 1."""
    total = np.zeros(3)
    for patch in expected:
        half_arc = math.acos(1.0 - patch.h / R)
        full = half_arc - math.sin(half_arc) * math.cos(half_arc)
        t = np.cross(np.array([0.0, 1.0, 0.0]), patch.facet.normal)
        total += R * full * (patch.share * patch.facet.normal - patch.tilt * t)
    return total


def brute_force(corners, centre, count=40001):
    """The same by the trapezoid rule; depth of a rim point = distance to the nearest line of a height profile."""
    theta = np.linspace(-math.pi / 2, math.pi / 2, count) * 1.3
    rim = centre + R * np.column_stack([np.sin(theta), -np.cos(theta)])
    below = rim[:, 1] < np.interp(rim[:, 0], corners[:, 0], corners[:, 1])
    depth = np.full(count, np.inf)
    for a, b in pairwise(corners):
        along = b - a
        share = np.clip((rim - a) @ along / (along @ along), 0.0, 1.0)
        depth = np.minimum(depth, np.linalg.norm(rim - a - share[:, None] * along, axis=1))
    depth[~below] = 0.0
    inward = np.column_stack([-np.sin(theta), np.cos(theta)])
    return np.trapezoid(depth[:, None] * inward, theta, axis=0)


@pytest.mark.parametrize("yaw", [0.0, 0.7, 1.5, 2.6, -1.0])
def test_a_slope_is_one_whole_patch_at_any_heading(yaw):
    terrain = incline(math.radians(12.0), start=-5.0)
    height = float(terrain.height(0.3, 0.0)) + 0.95 * R
    patch_list = patches(terrain, upright(0.3, height, yaw), R, B, [1.0])
    assert [patch.share for patch in patch_list] == [1.0]
    assert patch_list[0].facet.normal == pytest.approx(terrain.normal(0.3, 0.0))


@settings(max_examples=60)
@given(cut=st.floats(-0.02, 0.02), h=st.floats(1e-4, 0.02), n=st.floats(0.3, 1.6))
def test_parts_of_a_plane_add_up_to_the_plane(cut, h, n):
    """For any exponent: one sinkage, shares that add up to 1, leans that cancel."""
    split = Lanes((Profile(np.array([-1.0, cut - 0.011, cut, cut + 0.007, 1.0]), np.zeros(5)),))
    patch_list = patches(split, upright(0.0, R - h), R, B, [n])
    assert [patch.h for patch in patch_list] == pytest.approx([h] * len(patch_list))
    assert sum(patch.share for patch in patch_list) == pytest.approx(1.0, rel=1e-9)
    assert sum(patch.turn for patch in patch_list) == pytest.approx(1.0, rel=1e-9)
    assert sum(patch.tilt for patch in patch_list) == pytest.approx(0.0, abs=1e-9)
    assert max(patch.depth for patch in patch_list) == pytest.approx(h)


@pytest.mark.parametrize("wall", [20.0, 45.0, 70.0])
@pytest.mark.parametrize("x", [-0.03, -0.01, 0.0, 0.01, 0.02])
def test_a_lip_is_the_arc_integral(wall, x):
    corners = np.array([[-1.0, 0.0], [0.0, 0.0], [1.0, -math.tan(math.radians(wall))]])
    terrain = Lanes((Profile(corners[:, 0], corners[:, 1]),))
    centre = np.array([x, R - 0.008])
    total_force = resultant(patches(terrain, upright(*centre), R, B, [1.0]))
    assert total_force[[0, 2]] == pytest.approx(brute_force(corners, centre), rel=2e-3, abs=2e-7)


@pytest.mark.slow
@pytest.mark.parametrize(("wall", "depth"), [(30.0, 0.002), (30.0, 0.02), (60.0, 0.008), (60.0, 0.02), (85.0, 0.012)])
def test_forces_are_continuous_along_a_ditch(wall, depth):
    """The largest jump shrinks with the step. (Sunk by r / 2 and more, where drives stop, steep lips leave jumps.)"""
    terrain = ditch(wall_angle=math.radians(wall))

    def largest_jump(count):
        path = [resultant(patches(terrain, upright(x, R - depth), R, B, [1.0])) for x in np.linspace(0.4, 0.8, count)]
        return np.abs(np.diff(path, axis=0)).max() / np.abs(path).max()

    assert largest_jump(3201) < 0.6 * largest_jump(1601)


@pytest.mark.parametrize(
    ("gap", "sunk"), [(1.01, 0.9), (1.06, 0.9), (0.95, 0.65), (-0.5, 0.9), (-0.8, 0.9), (-0.8, 0.7)]
)
@pytest.mark.parametrize("fall", [1.0, -1.0])
@pytest.mark.parametrize("ahead", [1.0, -1.0])
def test_a_lip_at_the_wheel_s_reach_ends_the_ground_s_arc(gap, sunk, ahead, fall):
    """Of the rim only what is nearer to the level than to a wall of 80 deg that falls or rises presses on the level.

    From a lip beyond the reach a wall that falls is not touched.
    """
    lip, foot = ahead * gap * R, ahead * (gap * R + 0.02)
    x, z = [-ahead, lip, foot, foot + 0.3 * ahead], [0.0, 0.0, *[-fall * 0.02 * math.tan(math.radians(80.0))] * 2]
    profile = Profile(*zip(*sorted(zip(x, z, strict=True)), strict=True))
    patch_list = patches(Lanes((profile,)), upright(0.0, (1.0 - sunk) * R), R, B, [1.0])
    assert gap < 1.0 or fall < 0.0 or len(patch_list) == 1
    (level,) = (patch for patch in patch_list if patch.facet.normal[2] == 1.0)
    along = np.array([math.cos(math.radians(40.0)), -fall * ahead * math.sin(math.radians(40.0))])
    theta = np.linspace(-math.pi, math.pi, 200001)
    rim = np.column_stack([np.sin(theta), -np.cos(theta)])
    in_front = ahead * ((rim - [ahead * gap, sunk - 1.0]) @ along) < 0.0
    weight = np.maximum(np.cos(theta) - (1.0 - sunk), 0.0) * np.cos(theta)
    assert level.share == pytest.approx(weight[in_front].sum() / weight.sum(), rel=1e-3)


def test_a_level_height_grid_is_flat_ground():
    grid = HeightGrid(-1.0, -1.0, 0.1, 0.1, np.zeros((21, 21)))
    frame = upright(0.033, R - 0.007, 0.4)
    level = resultant(patches(flat(), frame, R, B, [1.0]))
    assert resultant(patches(grid, frame, R, B, [1.0])) == pytest.approx(level, rel=1e-9)


@pytest.mark.parametrize("kind", ["lane", "grid"])
@pytest.mark.parametrize("yaw", [0.0, 0.6, -2.1, 2.6])
@pytest.mark.parametrize("lean", [0.0, 0.4, -0.3])
def test_cut_corners_lie_on_the_ground_and_its_facets_along_it(yaw, lean, kind):
    """In the plane of a wheel that leans, at any heading; a grid's on waves, in three corrections."""
    if kind == "lane":
        terrain = Lanes((Profile([-1.0, -0.01, 0.02, 1.0], [0.3, 0.0, 0.005, 0.5]),))
    else:
        x, y = np.meshgrid(0.1 * np.arange(21) - 1.0, 0.1 * np.arange(21) - 1.0, indexing="ij")
        terrain = HeightGrid(-1.0, -1.0, 0.1, 0.1, 0.2 * x + 0.2 * y + 0.003 * np.sin(5.0 * x))
    axle = np.array([-math.sin(yaw) * math.cos(lean), math.cos(yaw) * math.cos(lean), math.sin(lean)])
    frame = wheel_frame(np.array([0.0, 0.0, terrain.height(0.0, 0.0) + 0.9 * R]), axle)
    (strip,) = strips(terrain, frame, R, B)
    for facet in strip.facets:
        places = [frame.centre + s * frame.forward + t * frame.up for s, t in (facet.start, facet.end)]
        for x, y, z in places:
            assert z == pytest.approx(terrain.height(x, y), abs=1e-12 * max(1.0, abs(y)) if kind == "lane" else 1e-12)
        assert facet.normal @ (places[1] - places[0]) == pytest.approx(0.0, abs=1e-9 * max(1.0, abs(places[0][1])))
        assert facet.normal[2] > 0.0


@pytest.mark.parametrize("yaw", [0.0, 0.4, 1.1, math.pi / 2, 2.5])
@pytest.mark.parametrize("at", [-0.6, -0.45, -0.2, 0.1, 0.48, 0.6])
def test_lane_share_is_the_integral_of_6s_1_minus_s(yaw, at):
    """The width is that of the rim, b |cos yaw|, and of about a contact's length, r |sin yaw|."""
    width = B * abs(math.cos(yaw)) + R * abs(math.sin(yaw))
    terrain, frame = Lanes((LEVEL, LEVEL), (0.02,)), upright(0.0, R, yaw, 0.02 + at * width)
    s = np.linspace(0.0, min(max(0.5 - at, 0.0), 1.0), 2001)
    share, slope = lane_share(terrain, frame, R, B, 0)
    assert share == pytest.approx(np.trapezoid(6.0 * s * (1.0 - s), s), abs=1e-6)
    assert slope == pytest.approx(-6.0 * s[-1] * (1.0 - s[-1]) / width, abs=1e-9)
    assert lane_share(terrain, frame, R, B, 1) == pytest.approx((1.0 - share, -slope))


LEVEL = Profile([-1.0, 1.0], [0.0, 0.0])
RAISED = Profile([-1.0, 1.0], [0.01, 0.01])


@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi / 2, math.pi])
def test_two_lanes_alike_are_one(yaw):
    twice, frame = Lanes((LEVEL, LEVEL, LEVEL), (-0.01, 0.012)), upright(0.0, R - 0.008, yaw)
    patch_list, sinkage = patches_and_sinkage(twice, frame, R, B, [1.0])
    assert len(patch_list) > 1
    assert resultant(patch_list) == pytest.approx(resultant(patches(flat(), frame, R, B, [1.0])), abs=1e-12)
    assert sinkage == pytest.approx(0.008, abs=1e-12)
    assert sum(patch.share for patch in patch_list) == pytest.approx(1.0, abs=1e-12)
    assert sum(patch.side for patch in patch_list) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi / 2])
def test_lanes_carry_by_their_share_of_the_width_over_an_edge(yaw):
    """With an edge under a wheel's middle half of it is 18 mm deep, half 8 mm; moved by 1 nm nothing jumps."""
    terrain = Lanes((LEVEL, RAISED), (0.0,))
    patch_list, sinkage = patches_and_sinkage(terrain, upright(0.0, R - 0.008, yaw), R, B, [1.0])
    assert sorted((round(patch.h, 9), round(patch.share, 9)) for patch in patch_list) == [(0.008, 0.5), (0.018, 0.5)]
    assert sinkage == pytest.approx(0.013)
    forces = [
        resultant(patches(terrain, upright(0.0, R - 0.008, yaw, y), R, B, [1.0])) for y in np.linspace(-0.06, 0.06, 241)
    ]
    steps = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    assert np.max(steps) < 0.02 * np.linalg.norm(forces[-1] - forces[0])


@pytest.mark.parametrize("n", [0.6, 1.0, 1.4])
def test_an_edge_pushes_by_what_moving_across_it_stores(n):
    """-dU/dy of both lanes' work of pressing in, int f_n dh by quadrature of the pressure; to 6 %.

    The edge stands at 0.3 of the width, where a millimetre carries 6 x 0.3 x 0.7 of the mean.
    """
    terrain, z = Lanes((LEVEL, RAISED), (0.0,)), R - 0.006

    def normal(h):
        edge = math.acos(1.0 - h / R)
        theta = np.linspace(-edge, edge, 2001)
        return R * np.trapezoid(np.maximum(R * (np.cos(theta) - np.cos(edge)), 0.0) ** n * np.cos(theta), theta)

    def stored(h):
        return np.trapezoid([normal(value) for value in np.linspace(0.0, h, 101)], np.linspace(0.0, h, 101))

    patch_list = patches(terrain, upright(0.0, z, y=0.01), R, B, [n])
    push = sum(patch.side * normal(patch.h) for patch in patch_list)
    assert push < 0.0, "away from the raised lane"
    assert push == pytest.approx(-1.26 * (stored(0.016) - stored(0.006)) / B, rel=0.06)


@settings(max_examples=40)
@given(
    at=st.floats(-0.1, 0.3),
    depth=st.floats(0.001, 0.015),
    yaw=st.floats(-3.0, 3.0),
    slopes=st.lists(st.floats(-0.6, 0.6), min_size=2, max_size=5),
    exponent=st.sampled_from([0.6, 1.0, 1.3]),
)
def test_parts_of_a_straight_run_add_up_to_it(at, depth, yaw, slopes, exponent):
    """On slopes to 30 deg and to a third of the radius: each facet cut in three, against whole; ends lie 1 km off."""
    x = 0.12 * np.arange(len(slopes) + 1) - 0.1
    z = np.concatenate([[0.0], np.cumsum(0.12 * np.array(slopes))])
    terrain = Lanes((Profile(x, z),))
    frame = upright(at, terrain.height(at, 0.0) + R - depth, yaw)
    (strip,) = strips(terrain, frame, R, B)
    thirds = []
    for facet in strip.facets:
        ends = [facet.start + share * (facet.end - facet.start) for share in (0.0, 1 / 3, 2 / 3, 1.0)]
        thirds += [facet._replace(start=a, end=b) for a, b in pairwise(ends)]
    full, parts = (
        _patches_of(strip._replace(facets=facets, slope=7.0), R, [exponent]) for facets in (strip.facets, thirds)
    )
    pull = [
        sum(np.append(p.share * p.facet.normal, [p.tilt, p.turn, p.side]) for p in facets) for facets in (full, parts)
    ]
    assert pull[0] == pytest.approx(pull[1], abs=1e-5 if exponent != 1.0 else 1e-11)
