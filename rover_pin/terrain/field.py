"""The paper's test field: rocks, a sharp ditch and a smooth slope, one behind the other."""

import itertools
import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from rover_pin.base.arguments import check_arguments, spec
from rover_pin.terrain import shapes
from rover_pin.terrain.profile import Profile
from rover_pin.terrain.shapes import DEG
from rover_pin.terrain.terrain import Lanes

BETWEEN = 0.8
"""Level ground between two parts of the field [m] (assumed: two rover's lengths)."""


Size = Annotated[float, spec("", "assumed: 1 for the wheels of Nexus 6", 1e-3, 1000.0)]


@check_arguments("terrain")
def paper_field(
    seed: shapes.Seed = 1,
    count: shapes.Count = 6,
    depth: shapes.Depth = 0.05,
    width: shapes.Width = 0.2,
    wall_angle: shapes.WallAngle = 30.0 * DEG,
    rate: shapes.Rate = 10.0 * DEG,
    steepest: shapes.Steepest = 20.0 * DEG,
    rocks_length: shapes.RockLength = 1.5,
    size: Size = 1.0,
) -> Lanes:
    """Return rocks from 0.5 m on, then a ditch, then a slope that grows to `steepest` [rad] and goes on.

    `seed`, `count` and `rocks_length` [m] are those of `rocks`, which are of soil index 1; depth, width and wall angle
    those of `ditch`; `size` multiplies what is no argument, the distances between the parts and the rocks' diameters.
    `rate` [rad/m] and `steepest` [rad] those of `growing_slope`. Level ground lies between the parts.

    Source: paper, section 4: "The test filed includes a sharp ditch in the depth of 5 centimeters and smooth slopes up
    to the inclination of 20 degrees. In order to test obstacle negotiation, several rocks with the diameter of 5-10
    centimeters are scattered over the sand." Their order and distances are assumed, and what each part assumes; its
    rocks also lie on its slopes perhaps, here they do not.

    Raises ParameterError: a part that cannot be made as asked.
    """
    between = size * BETWEEN
    ditch_at = size * 0.5 + rocks_length + between
    slope_at = ditch_at + width + between
    parts = (
        shapes.rocks(seed, count, size * 0.5, rocks_length, (size * 0.05, size * 0.10)),
        shapes.ditch(depth, width, wall_angle, ditch_at),
        shapes.growing_slope(rate, slope_at, steepest),
    )
    sides = zip(*(_both_sides(part) for part in parts), strict=True)
    seams = (ditch_at - 0.5 * between, slope_at - 0.5 * between)
    return Lanes(tuple(_join_profiles(side, seams) for side in sides), (0.0,))


def _both_sides(part: Lanes) -> tuple[Profile, Profile]:
    return part.profiles[0], part.profiles[-1]


def _join_profiles(parts: Sequence[Profile], seams: Sequence[float]) -> Profile:
    """Return the first part up to the first seam, the second from there, and so on; at seams all is level sand."""
    ends = [-math.inf, *seams, math.inf]
    x, z, ground = [], [], []
    for part, (low, high) in zip(parts, itertools.pairwise(ends), strict=True):
        inside = (part.x > low) & (part.x < high)
        x += list(part.x[inside])
        z += list(part.z[inside])
        ground += list(part.ground[np.clip(np.flatnonzero(inside), 0, part.ground.size - 1)])
    return Profile(np.array(x), np.array(z), np.array(ground[:-1]))
