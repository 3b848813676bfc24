"""Heights, normals and soils of the two kinds of terrain, against hand-made values."""

import pickle
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_pin.base.errors import ParameterError
from rover_pin.terrain.terrain import HeightGrid, Lanes, Profile

RAMP = Profile([0.0, 1.0, 3.0], [0.0, 0.5, 0.5], [0, 1])
GRID = HeightGrid(0.0, -1.0, 1.0, 0.5, np.arange(12.0).reshape(3, 4) ** 1.1)


def test_profile_height_and_slope_inside_and_beyond():
    assert RAMP.height(np.array([-2.0, 0.0, 0.5, 1.0, 2.0, 9.0])) == pytest.approx([-1.0, 0.0, 0.25, 0.5, 0.5, 0.5])
    assert RAMP.slope(np.array([-2.0, 0.5, 1.0, 9.0])) == pytest.approx([0.5, 0.5, 0.0, 0.0])


@pytest.mark.parametrize("distance", [0.0, 3e3, 1e6])
def test_a_straight_run_is_straight_wherever_it_lies(distance):
    """Points amid a slope of 0.1 are off it by the last digit of the greatest coordinate: they are left out."""
    x = distance + np.array([0.0, 0.1, 0.3, 0.7, 1.0, 2.0])
    for ends in (x, -x[::-1]):
        for up in (0.0, distance):
            straight = Profile(ends, up + 0.1 * (ends - distance)).without_collinear_points()
            assert straight.x.tolist() == [ends[0], ends[-1]]
    bent = Profile(x, np.where(x > distance + 0.5, 1e-8 * max(1.0, distance), 0.0))
    assert bent.without_collinear_points().x.size == 4


def test_lanes_pick_the_profile_by_side():
    level = Profile([0.0, 1.0], [0.0, 0.0])
    terrain = Lanes((level, RAMP), (0.0,))
    y = np.array([-1.0, 0.0, 1e-9, 1.0])
    assert terrain.height(0.5, y) == pytest.approx([0.0, 0.0, 0.25, 0.25])
    assert terrain.ground_at(2.0, y).tolist() == [0, 0, 1, 1]
    assert terrain.ground_indices == {0, 1}
    assert not terrain.mirror_symmetric
    assert Lanes((RAMP, level, RAMP), (-0.1, 0.1)).mirror_symmetric
    assert not Lanes((RAMP, level, RAMP), (-0.1, 0.2)).mirror_symmetric
    assert not Lanes((RAMP, level, RAMP), (-0.1, 0.101)).mirror_symmetric


@given(st.floats(-0.5, 2.5), st.floats(-1.4, 0.9))
def test_gradient_is_the_derivative_of_the_height(x, y):
    step = 1e-6
    corners = np.array([0.0, 1.0, 2.0, 3.0]), np.array([-1.0, -0.5, 0.0, 0.5])
    if any(np.min(np.abs(value - at)) < 2 * step for value, at in zip((x, y), corners, strict=True)):
        return
    for terrain in (Lanes((RAMP,)), GRID):
        slope = (
            (terrain.height(x + step, y) - terrain.height(x - step, y)) / (2 * step),
            (terrain.height(x, y + step) - terrain.height(x, y - step)) / (2 * step),
        )
        assert terrain.gradient(x, y) == pytest.approx(slope, abs=1e-8)
        normal = terrain.normal(x, y)
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-14)
        assert normal @ [1.0, 0.0, slope[0]] == pytest.approx(0.0, abs=1e-8)


def test_grid_symmetry():
    z = np.array([[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]])
    assert HeightGrid(0.0, -1.0, 1.0, 1.0, z).mirror_symmetric
    assert not HeightGrid(0.0, 0.0, 1.0, 1.0, z).mirror_symmetric
    assert not HeightGrid(0.0, -1.0, 1.0, 1.0, z, [[0, 1]]).mirror_symmetric
    assert HeightGrid(0.0, 3.0, 1.0, 1.0, [[0.0, 0.0], [1.0, 1.0]]).mirror_symmetric
    level, mixed = np.zeros((3, 4)), np.array([[0.0, 1.0, 2.0, 0.0], [0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    for z, ground, symmetric in (
        (level, [[0, 1, 0], [2, 0, 2]], True),
        (np.array([[0.0, 0.0, 0.05, 0.0], [0.0, 0.0, 0.0, 0.0]]), 0, False),
        (level, [[0, 1, 2], [0, 0, 0]], False),
        (mixed, 0, False),
        (np.array([[1.0, 1.0, 1.05, 1.0], [1.0, 1.0, 1.0, 1.0]]), 0, False),
        (mixed[1:], 0, True),
    ):
        assert HeightGrid(0.0, -1.5, 1.0, 1.0, z, ground).mirror_symmetric is symmetric
        assert not HeightGrid(0.0, -1.5 + 1e-9, 1.0, 1.0, mixed[1:]).mirror_symmetric


@pytest.mark.parametrize("terrain", [Lanes((RAMP, RAMP), (0.1,)), GRID], ids=["lanes", "grid"])
def test_pickles_compares_and_hashes_by_value(terrain):
    again = pickle.loads(pickle.dumps(terrain))
    assert again == terrain
    assert hash(again) == hash(terrain)
    assert terrain != Lanes((RAMP,))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Profile([0.0], [0.0]), "2 numbers"),
        (lambda: Profile([0.0, 1.0], [0.0]), "same length"),
        (lambda: Profile([0.0, 1.0, 1.0], [0.0, 0.0, 1.0]), "point 2 at 1 m follows 1 m"),
        (lambda: Profile([0.0, np.nan], [0.0, 0.0]), "index (1,)"),
        (lambda: Profile([0.0, 1.0], ["a", "b"]), "numbers"),
        (lambda: Profile([0.0, 0.01], [0.0, 1.0]), "from x = 0 m to 0.01 m is 89.43 deg steep; at most 89 deg"),
        (lambda: Profile([0.0, 1.0], [0.0, 0.0], [-1]), "whole numbers"),
        (lambda: Profile([0.0, 1.0], [0.0, 0.0], [0.5]), "whole numbers"),
        (lambda: Profile([0.0, 1.0], [0.0, 0.0], [1000]), "whole numbers"),
        (lambda: Profile([0.0, 1.0], [0.0, 0.0], [0, 1]), "of shape (1,)"),
        (lambda: Lanes(()), "Lanes have 0 profiles"),
        (lambda: Lanes((RAMP, RAMP)), "Lanes have 2 profiles and borders at"),
        (lambda: Lanes((RAMP, RAMP, RAMP), (0.1, 0.0)), "increasing"),
        (lambda: HeightGrid(0.0, 0.0, 0.0, 1.0, np.zeros((2, 2))), "dx = 0 m"),
        (lambda: HeightGrid(0.0, np.inf, 1.0, 1.0, np.zeros((2, 2))), "not finite"),
        (lambda: HeightGrid(0.0, 0.0, 1.0, 1e-3, [[0.0, 0.0, 1.0]] * 2), "89.94 deg"),
        (lambda: HeightGrid(0.0, 0.0, 1.0, 1.0, np.zeros((1, 2))), "shape (1, 2)"),
        (lambda: HeightGrid(0.0, 0.0, 1.0, 1e-3, [[0.0, 0.0], [0.0, 1.0]]), "89.94 deg"),
        (lambda: HeightGrid(0.0, 0.0, 1.0, 1.0, np.zeros((2, 2)), [[0, 1]]), "cell"),
    ],
)
def test_refusals(make, says):
    with pytest.raises(ParameterError, match=re.escape(says)):
        make()
