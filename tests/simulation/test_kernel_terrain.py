"""What the compiled step is given of a terrain: pieces with normals, bins that find them, room for what is met."""

import numpy as np
import pytest

from rover_pin.simulation.compiled.terrain_numbers import line_of, terrain_fields
from rover_pin.simulation.native.shared import N_FACET, N_PATCH
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.terrain import HeightGrid, Lanes

RANDOM = np.random.default_rng(2)
X = np.cumsum(RANDOM.uniform(0.01, 0.4, 40)) - 3.0
ROUGH = Profile(X, 0.1 * RANDOM.normal(size=40), RANDOM.integers(0, 2, 39))
STEP = Profile(np.array([-1.0, 0.5, 0.6, 2.0]), np.array([0.0, 0.0, 0.08, 0.08]))


@pytest.mark.parametrize("profile", [ROUGH, STEP], ids=["rough", "step"])
def test_normals_are_square_to_their_pieces_and_point_up(profile):
    line = line_of(profile)
    along = np.column_stack([np.diff(line.x), np.diff(line.z)])
    assert len(line.normals) == len(line.ground) == len(line.x) - 1
    np.testing.assert_allclose(np.linalg.norm(line.normals, axis=1), 1.0)
    np.testing.assert_allclose(np.sum(along * line.normals, axis=1), 0.0, atol=1e-9 * np.abs(along).max())
    assert np.all(line.normals[:, 1] > 0.0)


@pytest.mark.parametrize("profile", [ROUGH, STEP], ids=["rough", "step"])
def test_a_bin_begins_on_the_piece_from_which_a_place_is_sought(profile):
    """Of equal length from the first own point to the last; beyond them the first and the last piece."""
    line = line_of(profile)
    assert (line.begin, line.begin + (len(line.bins) - 1) / line.per_metre) == pytest.approx((line.x[1], line.x[-2]))
    assert len(line.bins) == len(line.x)
    for at, begin in enumerate(line.begin + np.arange(len(line.bins)) / line.per_metre):
        behind = np.flatnonzero(line.x <= begin + 1e-12)
        expected = {0: 0, len(line.bins) - 1: len(line.x) - 2}.get(at, behind[-1])
        assert line.bins[at] == expected
    for x in RANDOM.uniform(line.x[1], line.x[-2], 200):
        piece = line.bins[int((x - line.begin) * line.per_metre)]
        assert line.x[piece] <= x


@pytest.mark.parametrize("length", [0.05, 0.3, 1.0, 9.0])
def test_the_crowd_is_the_most_points_within_a_length(length):
    line = line_of(ROUGH)
    assert line.crowd(length) == max(np.sum((line.x >= x) & (line.x <= x + length)) for x in line.x)


def test_lanes_stand_one_behind_the_other():
    """A point more than pieces in each lane: its last piece is there twice."""
    lanes = Lanes((ROUGH, STEP), (0.25,))
    fields, lines = terrain_fields(lanes, 0.1), [line_of(ROUGH), line_of(STEP)]
    assert fields["n_lanes"] == 2
    assert fields["lane_borders"].tolist() == [0.25, np.inf]
    for name, starts, own in (("lane", "lane_start", "x"), ("bin", "bin_start", "bins")):
        lengths = [len(getattr(line, own)) for line in lines]
        assert fields[starts].tolist() == [0, lengths[0], sum(lengths)], name
    for at, line in enumerate(lines):
        mine = slice(*fields["lane_start"][at : at + 2])
        np.testing.assert_array_equal(fields["lane_x"][mine], line.x)
        np.testing.assert_array_equal(fields["lane_z"][mine], line.z)
        np.testing.assert_array_equal(fields["lane_normal"][mine], [*line.normals, line.normals[-1]])
        np.testing.assert_array_equal(fields["lane_ground"][mine], [*line.ground, line.ground[-1]])
        np.testing.assert_array_equal(fields["bin"][slice(*fields["bin_start"][at : at + 2])], line.bins)
        assert (fields["bin_x0"][at], fields["bin_per_metre"][at]) == (line.begin, line.per_metre)


def test_there_is_room_for_all_facets_that_a_wheel_can_meet():
    """Its ground is 2.1 radii long: the points in it, a piece at either end and one beyond; patches on all lanes."""
    fields = terrain_fields(Lanes((ROUGH, STEP), (0.25,)), 0.4)
    needed = [line_of(profile).crowd(2.1 * 0.4) + 4 for profile in (ROUGH, STEP)]
    assert needed[0] > needed[1]
    assert fields["facets"].shape == (needed[0], N_FACET)
    assert fields["patches"].shape == (sum(needed), N_PATCH)


def test_a_grid_is_given_as_it_is():
    z, ground = np.arange(12.0).reshape(3, 4)[:, ::-1], np.array([[0, 1, 0], [1, 0, 1]])
    fields = terrain_fields(HeightGrid(-1.0, 2.0, 0.5, 0.25, z, ground), 0.1)
    about = {name: fields[f"grid_{name}"] for name in ("nx", "ny", "x0", "y0", "per_x", "per_y")}
    assert about == {"nx": 3, "ny": 4, "x0": -1.0, "y0": 2.0, "per_x": 2.0, "per_y": 4.0}
    np.testing.assert_array_equal(fields["grid_z"].ravel(), z.ravel())
    np.testing.assert_array_equal(fields["grid_ground"].ravel(), ground.ravel())
    assert len(fields["facets"]) >= 8, "four cells of two triangles"
