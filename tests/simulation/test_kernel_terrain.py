"""What the compiled step is given of a terrain: pieces with normals, bins that find them, room for what is met."""

import numpy as np
import pytest

from rover_pin.simulation.compiled.terrain_numbers import line_of, terrain_fields
from rover_pin.simulation.native.shared import N_FACET, N_PATCH
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.terrain import Lanes

RANDOM = np.random.default_rng(2)
X = np.cumsum(RANDOM.uniform(0.01, 0.4, 40)) - 3.0
ROUGH = Profile(X, 0.1 * RANDOM.normal(size=40), RANDOM.integers(0, 2, 39))
STEP = Profile(np.array([-1.0, 0.5, 0.6, 2.0]), np.array([0.0, 0.0, 0.08, 0.08]))


@pytest.mark.parametrize("length", [0.05, 0.3, 1.0, 9.0])
def test_the_crowd_is_the_most_points_within_a_length(length):
    line = line_of(ROUGH)
    assert line.crowd(length) == max(np.sum((line.x >= x) & (line.x <= x + length)) for x in line.x)


def test_there_is_room_for_all_facets_that_a_wheel_can_meet():
    """Its ground is 2.1 radii long: the points in it, a piece at either end and one beyond; patches on all lanes."""
    fields = terrain_fields(Lanes((ROUGH, STEP), (0.25,)), 0.4)
    needed = [line_of(profile).crowd(2.1 * 0.4) + 4 for profile in (ROUGH, STEP)]
    assert needed[0] > needed[1]
    assert fields["facets"].shape == (needed[0], N_FACET)
    assert fields["patches"].shape == (sum(needed), N_PATCH)
