"""The paper's test field: each part as it is by itself, at its place, level ground between."""

import math

import numpy as np
import pytest

from rover_pin.base.errors import ParameterError
from rover_pin.scenarios.scenario import scenario
from rover_pin.terrain import shapes
from rover_pin.terrain.shapes import paper_field

TRACKS = (-0.16, 0.16)


@pytest.mark.parametrize("y", [*TRACKS, -1e-3, 1e-3])
@pytest.mark.parametrize(
    ("part", "stretch"),
    [
        (shapes.rocks(1, 6, 0.5, 1.5), (-0.5, 2.35)),
        (shapes.ditch(at=2.8), (2.45, 3.35)),
        (shapes.growing_slope(start=3.8), (3.45, 9.0)),
    ],
    ids=["rocks", "ditch", "slope"],
)
def test_a_part_is_what_it_is_alone(part, stretch, y):
    x, ground = np.linspace(*stretch, 700), paper_field()
    assert ground.height(x, y) == pytest.approx(part.height(x, y), abs=1e-12)
    assert np.array_equal(ground.ground_at(x, y), part.ground_at(x, y))


@pytest.mark.parametrize("y", TRACKS)
@pytest.mark.parametrize(("size", "count"), [(0.2, 60), (3.0, 6)])
def test_distances_and_rocks_grow_with_the_wheels(size, count, y):
    """Rocks from 0.5 on, 0.8 before and behind the ditch, rocks of 5 to 10 cm: each times the size."""
    ground, between = paper_field(count=count, size=size, rocks_length=2.0), 0.8 * size
    ditch = 0.5 * size + 2.0 + between
    slope = ditch + 0.2 + between
    for part, low, high in (
        (shapes.rocks(1, count, 0.5 * size, 2.0, (0.05 * size, 0.1 * size)), -9.0, ditch - 1e-9),
        (shapes.ditch(at=ditch), ditch - between, slope - 1e-9),
        (shapes.growing_slope(start=slope), slope - between, slope + 9.0),
    ):
        x = np.linspace(low, high, 2001)
        assert ground.height(x, y) == pytest.approx(part.height(x, y), abs=1e-12)
        assert np.array_equal(ground.ground_at(x, y), part.ground_at(x, y))


def test_it_has_what_the_paper_says():
    """'a sharp ditch in the depth of 5 centimeters', 'slopes up to the inclination of 20 degrees', 'rocks ... 5-10'."""
    ground, x = paper_field(), np.linspace(0.0, 12.0, 24001)
    heights = [ground.height(x, y) for y in TRACKS]
    assert min(map(np.min, heights)) == pytest.approx(-0.05)
    slope = [ground.gradient(x[x > 3.8], y)[0] for y in TRACKS]
    assert math.degrees(math.atan(np.max(slope))) == pytest.approx(20.0)
    tops = np.concatenate([z[x < 2.4][np.flatnonzero(np.diff(np.sign(np.diff(z[x < 2.4]))) < 0)] for z in heights])
    assert len(tops) == 6
    assert np.all((tops > 0.0249) & (tops < 0.0501)), "half of a rock is buried"


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"rocks_length": 0.0}, "rocks_length = 0"), ({"count": 40}, "40.*0.1.*1.5"), ({"wall_angle": 0.1}, "walls are")],
)
def test_a_part_that_cannot_be_made_is_refused(changes, message):
    with pytest.raises(ParameterError, match=message):
        paper_field(**changes)


@pytest.mark.slow
def test_the_rover_crosses_rocks_and_ditch_and_climbs():
    """On a sand of k = 10 mm, the scenario's; on Table 1's it stays at the rocks."""
    assert scenario("field").drive()["body_x"][-1] > 4.5
    assert scenario("field", soil="table-1").drive()["body_x"].max() < 2.3
