"""The shapes have the geometry that their docstrings say."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.terrain import shapes
from rover_pin.terrain.edits import with_ground

DEG = math.pi / 180.0


@given(st.floats(0.01, 1.0), st.floats(0.02, 1.2), st.floats(0.0, 1.0))
def test_growing_slope_grows_by_its_rate(rate, steepest, share):
    terrain = shapes.growing_slope(rate, 0.5, steepest)
    at = 0.5 + share * steepest / rate
    assert terrain.slope_at(at, 0.0) == pytest.approx(share * steepest, abs=0.51 * DEG)
    assert terrain.slope_at(1e3, 0.0) == pytest.approx(steepest)
    assert terrain.slope_at(0.49, 0.0) == 0.0


def test_growing_slope_reaches_12_degrees_when_the_paper_says():
    assert shapes.growing_slope().slope_at(0.5 + 25.0 * 0.05, 0.0) == pytest.approx(12 * DEG, abs=1 * DEG)


def test_ditch_of_the_paper():
    terrain = shapes.ditch(0.05, 0.2, 45 * DEG, at=0.5)
    x = np.array([0.5, 0.525, 0.55, 0.65, 0.7])
    assert terrain.height(x, 0.0) == pytest.approx([0.0, -0.025, -0.05, -0.05, 0.0])
    assert terrain.slope_at(np.array([0.51, 0.6, 0.69]), 0.0) == pytest.approx([-45 * DEG, 0.0, 45 * DEG])
    assert terrain.mirror_symmetric


@given(st.floats(0.01, 1.0), st.floats(1.0, 89.0))
def test_ditch_volume(depth, wall_deg):
    wall = depth / math.tan(wall_deg * DEG)
    terrain = shapes.ditch(depth, 2.0 * wall + 0.1, wall_deg * DEG)
    profile = terrain.profiles[0]
    assert -np.trapezoid(profile.z, profile.x) == pytest.approx(depth * (wall + 0.1))


@given(st.integers(0, 10_000), st.integers(1, 20))
def test_rocks_are_half_buried_and_apart(seed, count):
    terrain = shapes.rocks(seed, count, 0.5, 2.0)
    rock_places = []
    for profile in terrain.profiles:
        x, z, hard = profile.x, profile.z, profile.ground == 1
        assert z[0] == z[-1] == 0.0
        assert np.all(z[:-1][~hard] == 0.0)
        assert np.count_nonzero(hard) % shapes.ROCK_PIECES == 0
        rock_places += list(
            x[1:][hard][shapes.ROCK_PIECES - 1 :: shapes.ROCK_PIECES] - x[:-1][hard][:: shapes.ROCK_PIECES]
        )
        assert np.all((x[1:-1] >= 0.5 - 1e-9) & (x[1:-1] <= 2.5 + 1e-9))
        assert np.max(z) <= 0.05
    assert len(rock_places) == count
    assert 0.05 - 1e-9 <= min(rock_places) <= max(rock_places) <= 0.10 + 1e-9
    assert not terrain.mirror_symmetric


def test_all_is_sand_but_rocks_unless_it_is_said():
    for make in (shapes.flat, shapes.growing_slope, shapes.bump, shapes.one_sided_bump, shapes.ditch, shapes.step,
                 shapes.washboard, shapes.hills):  # fmt: skip
        assert make().ground_indices == {0}, make.__name__
    assert shapes.rocks().ground_indices == {0, 1}


def test_obstacles_are_as_high_as_they_usually_are():
    for terrain, place, height in (
        (shapes.bump(), 0.65, 0.04),
        (shapes.one_sided_bump(), 0.65, 0.04),
        (shapes.ditch(), 0.6, -0.05),
        (shapes.step(), 2.0, 0.05),
        (shapes.washboard(), 0.65, 0.02),
    ):
        assert terrain.height(place, 0.1) == pytest.approx(height, abs=1e-12)
    assert shapes.growing_slope().slope_at(9.0, 0.0) == pytest.approx(20 * DEG)
    assert shapes.ditch().slope_at(0.51, 0.0) == pytest.approx(-30 * DEG)


def test_walls_of_89_degrees_stand_wherever_they_are():
    """Rounded coordinates make some of them steeper in their last digits."""
    for height in np.linspace(0.01, 0.5, 40):
        for at in (0.1, 7.3, 55.0):
            assert shapes.step(float(height), at=at).height(at + 1.0, 0.0) == pytest.approx(height)


def test_a_seed_is_the_same_ground_in_every_version():
    """Studies and logs name their ground by its seed."""
    assert shapes.hills(0).height(1.0, 0.5) == pytest.approx(0.016238273894624556, abs=1e-12)
    assert shapes.hills(0).height(7.3, -2.1) == pytest.approx(0.0367874018692319, abs=1e-12)
    starts = [profile.x[np.flatnonzero(profile.ground)][:: shapes.ROCK_PIECES] for profile in shapes.rocks(0).profiles]
    assert starts[0] == pytest.approx([0.5396101467, 0.7556805696, 1.0645383315, 1.5055432487, 1.8725024665])
    assert starts[1] == pytest.approx([1.2885900958, 1.7440867664, 2.2221563198])


def test_hills_have_their_height_on_average():
    spread = [np.std(shapes.hills(seed, 0.05).z) for seed in range(8)]
    assert np.mean(spread) == pytest.approx(0.05, rel=0.15)


@given(st.floats(-3.0, 3.0), st.floats(0.1, 3.0), st.floats(-4.0, 4.0))
def test_a_stretch_of_other_soil_leaves_the_heights(x_from, length, x):
    terrain = shapes.bump(ground=1)
    laid = with_ground(terrain, x_from, x_from + length, 2)
    assert laid.height(x, 0.0) == pytest.approx(terrain.height(x, 0.0), abs=1e-12)
    if min(abs(x - x_from), abs(x - x_from - length)) > 1e-8:
        inside = x_from < x < x_from + length
        assert laid.ground_at(x, 0.0) == (2 if inside else terrain.ground_at(x, 0.0))


def test_a_stretch_on_a_grid():
    laid = with_ground(shapes.cross_slope(0.1), 1.0, 2.0, 1)
    assert laid.ground_at(np.array([0.95, 1.05, 1.95, 2.05]), 0.3).tolist() == [0, 1, 1, 0]
    for reach, last in ((1.048, 0), (1.052, 1)):
        edge = with_ground(shapes.cross_slope(0.1), 0.5, reach, 1)
        assert edge.ground_at(1.05, 0.0) == last
    assert laid.height(1.5, 0.7) == shapes.cross_slope(0.1).height(1.5, 0.7)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: shapes.incline(1.57), "terrain.angle = 1.57 rad"),
        (lambda: shapes.incline("steep"), "angle = 'steep'"),
        (lambda: shapes.growing_slope(0.0), "rate = 0"),
        (lambda: shapes.growing_slope(steepest=1.5), "steepest = 1.5"),
        (lambda: shapes.bump(length=0.0), "length = 0"),
        (lambda: shapes.bump(height=math.nan), "height = nan"),
        (lambda: shapes.ditch(depth=0.0), "depth = 0"),
        (lambda: shapes.ditch(wall_angle=1.57), "wall_angle = 1.57"),
        (lambda: shapes.step(wall_angle=0.0), "wall_angle = 0"),
        (lambda: shapes.washboard(count=0), "count = 0"),
        (lambda: shapes.washboard(count=2.5), "terrain.count = 2.5"),
        (lambda: shapes.rocks(-1), "seed = -1"),
        (lambda: shapes.rocks(0, 21), "0.1 m may"),
        (lambda: shapes.rocks(0, 30), "0.1 m may"),
        (lambda: shapes.rocks(0, diameters=(0.1, 0.05)), "largest diameter = 0.05"),
        (lambda: shapes.rocks(0, 1, diameters=(9.9e-4, 0.1)), "smallest diameter = 0.00099"),
        (lambda: shapes.rocks(0, 1, diameters=("small", 0.1)), "smallest diameter = 'small'"),
        (lambda: shapes.rocks(0, 1, length=500.0, diameters=(1.0, 101.0)), "largest diameter = 101"),
        (lambda: shapes.rocks(0, 1, length=500.0, diameters=(101.0, 101.0)), "smallest diameter = 101"),
        (lambda: shapes.cross_slope(1.5), "angle = 1.5"),
        (lambda: shapes.hills(0, wavelength=0.01), "wavelength = 0.01"),
        (lambda: with_ground(shapes.flat(), 1.0, 1.0, 1), "empty stretch"),
        (lambda: with_ground(shapes.cross_slope(0.1), 70.0, 80.0, 1), "covers"),
        (lambda: with_ground(shapes.flat(), 0.0, 1.0, -1), "whole numbers"),
    ],
)
def test_refusals(make, says):
    with pytest.raises(ParameterError, match=re.escape(says)):
        make()


@pytest.mark.parametrize("height", [0.05, -0.05])
def test_step(height):
    terrain = shapes.step(height, 60 * DEG, 0.5, ground=1)
    assert terrain.height(np.array([0.5, 2.0]), 0.0) == pytest.approx([0.0, height])
    assert terrain.slope_at(0.5 + 1e-4, 0.0) == pytest.approx(math.copysign(60 * DEG, height))
    assert terrain.ground_at(np.array([0.0, 0.51, 3.0]), 0.0).tolist() == [0, 1, 1]


def test_washboard():
    terrain = shapes.washboard(0.01, 0.3, 4, at=0.5)
    assert terrain.height(0.5 + 0.3 * np.array([0.5, 1.0, 3.5, 9.0]), 0.0) == pytest.approx([0.02, 0.0, 0.02, 0.0])


def test_bump_and_its_soil():
    terrain = shapes.bump(0.04, 0.2, 0.5, ground=1)
    assert terrain.height(np.array([0.5, 0.55, 0.6, 0.7]), 0.0) == pytest.approx([0.0, 0.02, 0.04, 0.0])
    assert terrain.ground_at(np.array([0.49, 0.5, 0.69, 0.7]), 0.0).tolist() == [0, 1, 1, 0]
    assert terrain.mirror_symmetric


def test_flat_and_incline():
    assert shapes.flat(2).ground_indices == {2}
    slope = shapes.incline(20 * DEG, start=1.0)
    assert slope.slope_at(np.array([0.0, 1.0, 50.0]), 0.3) == pytest.approx([0.0, 20 * DEG, 20 * DEG])
    assert slope.height(3.0, -1.0) == pytest.approx(2.0 * math.tan(20 * DEG))


def test_cross_slope_rises_to_the_left():
    terrain = shapes.cross_slope(10 * DEG)
    assert terrain.height(3.21, np.array([-0.5, 0.0, 0.5])) == pytest.approx(
        np.tan(10 * DEG) * np.array([-0.5, 0.0, 0.5])
    )
    assert not terrain.mirror_symmetric
    assert shapes.cross_slope(0.0).mirror_symmetric
