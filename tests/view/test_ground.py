"""The drawn terrain: every vertex lies on the terrain, the whole rectangle is covered, and soils are at their
places."""

import numpy as np
import pytest

from rover_pin.terrain import shapes
from rover_pin.terrain.terrain import Extent
from rover_pin.view.triangles import patches, ruled_lines

BOX = Extent(-0.35, 1.65, -0.45, 0.55)
GROUNDS = {
    "flat": shapes.flat(),
    "ditch": shapes.ditch(),
    "rocks": shapes.rocks(),
    "one-sided": shapes.one_sided_bump(ground=1),
    "hills": shapes.hills(),
    "cross": shapes.cross_slope(0.1),
}


@pytest.fixture(params=GROUNDS, ids=str)
def terrain(request):
    return GROUNDS[request.param]


def test_the_box_is_covered_once(terrain):
    """Seen from above, the triangles have the area of the rectangle; walls have no area."""
    area = 0.0
    for patch in patches(terrain, BOX):
        a, b, c = (patch.vertices[patch.faces[:, i], :2] for i in range(3))
        area += 0.5 * np.sum(np.abs(np.cross(np.c_[b - a, np.zeros(len(a))], np.c_[c - a, np.zeros(len(a))])[:, 2]))
    assert area == pytest.approx((BOX.x_high - BOX.x_low) * (BOX.y_high - BOX.y_low), rel=1e-9)


def test_lines_lie_on_the_ground_a_decimetre_apart(terrain):
    lines = ruled_lines(terrain, BOX)
    x, y, z = lines.reshape(-1, 3).T
    assert np.allclose(x / 0.1, np.round(x / 0.1))
    assert z - 1e-3 == pytest.approx(terrain.height(x, y), abs=1e-9)
