"""The first and the last piece of a polyline continue as far as a rover may start."""

import numpy as np
import pytest

from rover_pin.scenarios.scenario import scenario
from rover_pin.terrain.terrain import Lanes, Profile


@pytest.mark.parametrize("x", [-9e5, -1500.0, 1000.9, 1001.5, 9e5])
def test_level_ground_has_no_end(x):
    """The ground must not end a kilometre beyond its last point, where a rover would seem to tip over or to sink."""
    there, at_point = (scenario("flat", rover="cart", **{"start.x": at, "duration": 2.0}).drive() for at in (x, 5.0))
    assert there["body_x"][-1] - x == pytest.approx(at_point["body_x"][-1] - 5.0, abs=1e-6)
    assert there["body_z"][-1] == pytest.approx(at_point["body_z"][-1], abs=1e-6)


def test_a_drive_goes_on_across_the_extra_points():
    """The additional points lie on the line of the last piece, so that nothing changes there."""
    across, at_point = (
        scenario("flat", rover="cart", **{"start.x": at, "duration": 8.0}).drive() for at in (1000.7, 5.0)
    )
    assert across["body_x"][-1] > 1001.0
    assert np.ptp(across["body_z"]) == pytest.approx(np.ptp(at_point["body_z"]), abs=1e-7)


def test_a_slope_goes_on_with_its_slope():
    x, z, ground = Profile([0.0, 2.0, 3.0], [0.0, 0.0, 0.2], [0, 1]).extended_points()
    assert np.all(np.diff(x) > 0.0)
    assert np.diff(z)[-3:] / np.diff(x)[-3:] == pytest.approx(0.2)
    assert np.diff(z)[:3] == pytest.approx(0.0)
    assert ground.tolist() == [0, 0, 0, 1, 1, 1]
    assert Lanes((Profile(x, z, ground),)).height(5e5, 0.0) == pytest.approx(0.2 * (5e5 - 2.0))
