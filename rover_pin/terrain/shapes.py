"""Ready-made terrains: the slope, bump, ditch, rocks and test field of the paper, and further shapes.

Every shape begins at x = `at` or x = `start` [m] with level ground at z = 0 before it. Geometry that the paper does not
give is marked "assumed". Curves consist of straight pieces whose corners lie on the curve. Soil index 0 is the model's
default soil (sand), and soil index 1 is its hard ground.
"""

import itertools
import math
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np

from rover_pin.base.arguments import arguments_of, check_arguments, spec
from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import check
from rover_pin.terrain.terrain import MAX_STEEPNESS, HeightGrid, Lanes, Profile

LEAD = 1.0
"""Length of the level ground before and behind a shape [m]. Beyond this length, the first and last piece of the profile
continue in a straight line."""
PIECES = 24
"""Number of straight pieces of a bump, or of one wave of a washboard. With 24 pieces, the polyline deviates from the
curve by less than 1 % of the height of the bump or wave; more pieces would only make the contact slower to compute."""
ROCK_PIECES = 12
"""Number of straight pieces of a rock's half circle. With 12 pieces, neighbouring pieces differ by 15 deg, and the
polyline deviates from the circle by 1 % of the radius."""
FIELD_GAP = 0.8
"""Length of the level ground between two parts of the paper's test field [m] (assumed: two lengths of the rover)."""
DEG = math.pi / 180.0
"""One degree [rad]."""
FARTHEST = 1e6
"""Maximum absolute value of the position of a shape [m], and of the position [m] and yaw angle [rad] at which a rover
starts. Beyond this value, round-off exceeds a fraction of a millimetre or milliradian."""

FIG_10 = "paper, Fig 10 and section 4"
"""Source of the sizes of the paper's ditch."""
Ground = Annotated[int, spec("", "assumed: an index of the model's soils, 0 the sand, 1 the hard ground", 0, 255)]
Place = Annotated[float, spec("m", "assumed: level ground before it", -FARTHEST, FARTHEST)]
Seed = Annotated[int, spec("", "assumed: any number gives another ground", 0, 2**53)]
Angle = Annotated[float, spec("rad", "paper, section 4: up to 20 deg", -MAX_STEEPNESS, MAX_STEEPNESS)]
Tilt = Annotated[float, spec("rad", "paper, section 4: up to 20 deg", -80.0 * DEG, 80.0 * DEG)]
Rate = Annotated[float, spec("rad/m", "assumed: 12 deg after 25 s at 0.05 m/s, paper's Fig 8", 1e-6, 100.0)]
Steepest = Annotated[float, spec("rad", "paper, section 4: up to 20 deg", 1e-6, 80.0 * DEG)]
Height = Annotated[float, spec("m", "assumed: crossed on sand", -100.0, 100.0)]
BumpLength = Annotated[float, spec("m", "assumed: crossed on sand", 1e-3, 1000.0)]
Depth = Annotated[float, spec("m", FIG_10, 1e-6, 100.0)]
Width = Annotated[float, spec("m", FIG_10 + "; assumed: from lip to lip", 1e-6, 1000.0)]
WallAngle = Annotated[
    float, spec("rad", "assumed: 30 deg, the sand's friction angle phi in the paper's Table 1", 1e-3, MAX_STEEPNESS)
]
StepAngle = Annotated[float, spec("rad", "assumed: the steepest wall that a profile may have", 1e-3, MAX_STEEPNESS)]
Count = Annotated[int, spec("", "assumed: the paper speaks of several", 1, 10000)]
RockLength = Annotated[float, spec("m", "assumed: the paper speaks of scattered rocks", 1e-3, 1000.0)]
Diameters = Annotated[tuple[float, float], spec("m", "paper, section 4: 5 to 10 cm", 1e-3, 100.0)]
Left = Annotated[bool, spec("", "assumed: under the left wheels")]
Amplitude = Annotated[float, spec("m", "assumed: not in the paper", 0.0, 100.0)]
Wavelength = Annotated[float, spec("m", "assumed: not in the paper", 1e-3, 1000.0)]
HillHeight = Annotated[float, spec("m", "assumed: not in the paper; standard deviation", 0.0, 100.0)]
HillLength = Annotated[float, spec("m", "assumed: not in the paper", 0.2, 1000.0)]
Size = Annotated[float, spec("", "assumed: 1 for the wheels of Nexus 6", 1e-3, 1000.0)]


def flat(ground: Ground = 0) -> Lanes:
    """Return level ground of one soil."""
    return Lanes((_polyline([-LEAD, LEAD], [0.0, 0.0], ground),))


@check_arguments("terrain")
def incline(angle: Angle, start: Place = 1.0) -> Lanes:
    """Return level ground with a slope of `angle` [rad] from `start` [m] on; a negative angle leads down.

    Source: paper, section 4: the field has "smooth slopes up to the inclination of 20 degrees".
    """
    return Lanes((_polyline([start - LEAD, start, start + LEAD], [0.0, 0.0, LEAD * math.tan(angle)]),))


@check_arguments("terrain")
def growing_slope(rate: Rate = 10.0 * DEG, start: Place = 0.5, steepest: Steepest = 20.0 * DEG) -> Lanes:
    """Return a slope that begins at `start` [m] and becomes steeper by `rate` [rad/m] up to the inclination `steepest`
    [rad].

    The height is z = -ln(cos(rate s)) / rate with s = x - start, which is the integral of tan(rate s).

    Source: paper, Fig 8: "a slope that has an increasing inclination", 12 deg at t = 25 s, and section 4: up to 20 deg.
    The rate is assumed: 12 deg after 25 s at 0.05 m/s is about 10 deg a metre.
    """
    # The number of pieces is so large that the slope turns by at most half a degree at each corner.
    pieces = max(2, math.ceil(steepest / (0.5 * DEG)))
    s = np.linspace(0.0, steepest / rate, pieces + 1)
    z = -np.log(np.cos(rate * s)) / rate
    x = np.concatenate([[start - LEAD], start + s, [start + s[-1] + LEAD]])
    return Lanes((_polyline(x, np.concatenate([[0.0], z, [z[-1] + LEAD * math.tan(steepest)]])),))


@check_arguments("terrain")
def bump(height: Height = 0.04, length: BumpLength = 0.3, at: Place = 0.5, ground: Ground = 0) -> Lanes:
    """Return a bump across the whole terrain: a raised cosine of `height` [m] and `length` [m] that begins at x = `at`
    [m].

    z = height / 2 (1 - cos(2 pi s / length)), s = x - at. The bump has the soil index `ground`.

    Source: paper, Fig 7: "rover motion moving over a bump". Shape and size are assumed: the bump is steep enough to
    matter, and gentle enough to be crossed on sand, as in the paper's simulation, where "all the surface is modeled as
    dry sand". The paper supposes that the real obstacle was hard; for a hard bump, set `ground` = 1 and a harder soil.
    """
    return Lanes((_bump_profile(height, length, at, ground),))


@check_arguments("terrain")
def one_sided_bump(
    height: Height = 0.04, length: BumpLength = 0.3, at: Place = 0.5, ground: Ground = 0, *, left: Left = True
) -> Lanes:
    """Return a bump (a raised cosine, see `bump`) under the left wheels (y > 0) only, or under the right wheels only.

    The bump ends at y = 0 with a vertical edge. A wheel crosses the edge gradually, over its width, as
    `terrain.section` explains.
    """
    level, raised = flat().profiles[0], _bump_profile(height, length, at, ground)
    return Lanes((level, raised) if left else (raised, level), (0.0,))


@check_arguments("terrain")
def ditch(depth: Depth = 0.05, width: Width = 0.2, wall_angle: WallAngle = 30.0 * DEG, at: Place = 0.5) -> Lanes:
    """Return a ditch with straight walls and a level floor. `width` [m] is the width at the top, from lip to lip.

    The floor is width - 2 depth / tan(wall_angle) wide. It has no width if the walls meet at the depth.

    Source: paper, Fig 10: "a sandy ditch, which has 0.05 [m] depth and 0.2 [m] width"; section 4 calls the ditch sharp.
    Assumed: the paper's width is the width at the top. The paper does not state the wall angle [rad], although this
    angle decides whether the rover gets out of the ditch. 30 deg is the internal friction angle phi of Table 1, and at
    steeper angles this sand would slide down.

    Raises ParameterError: the walls are so gentle that they meet above the depth.
    """
    # `wall` is the horizontal length of one wall.
    wall = depth / math.tan(wall_angle)
    floor = width - 2.0 * wall
    if floor < -1e-9:
        raise ParameterError(
            f"The ditch's walls are inclined by {math.degrees(wall_angle):g} deg. They meet at a depth of "
            f"{0.5 * width * math.tan(wall_angle):.4g} m, which is less than the ditch's depth of {depth:g} m. Use a "
            f"wall angle of {math.degrees(math.atan(2.0 * depth / width)):.4g} deg or more, a wider ditch or a "
            "shallower ditch."
        )
    x = [at - LEAD, at, at + wall, at + width - wall, at + width, at + width + LEAD]
    z = [0.0, 0.0, -depth, -depth, 0.0, 0.0]
    if floor <= 1e-9:  # the walls meet at one point
        x[2:4], z[2:4] = [at + 0.5 * width], [-depth]
    return Lanes((_polyline(x, z),))


@check_arguments("terrain")
def step(height: Height = 0.05, wall_angle: StepAngle = MAX_STEEPNESS, at: Place = 0.5, ground: Ground = 0) -> Lanes:
    """Return a step up by `height` [m] with a wall inclined by `wall_angle` [rad]; a negative height gives a step down.

    `ground` is the soil index of the wall and of the ground behind the wall.
    """
    # The horizontal length of the wall; its minimum keeps the points of the profile apart if the height is 0.
    wall = max(abs(height) / math.tan(wall_angle), 1e-6)
    x = [at - LEAD, at, at + wall, at + wall + LEAD]
    return Lanes((_polyline(x, [0.0, 0.0, height, height], [0, ground, ground]),))


@check_arguments("terrain")
def rocks(
    seed: Seed = 0,
    count: Count = 8,
    start: Place = 0.5,
    length: RockLength = 2.0,
    diameters: Diameters = (0.05, 0.10),
    ground: Ground = 1,
) -> Lanes:
    """Return level ground with `count` half-buried rocks of soil index `ground`, at random under the left or the right
    wheels.

    A rock is a half cylinder across the whole left or right half of the terrain. Its outline in x and z is a half
    circle of ROCK_PIECES straight pieces. The rocks lie within `length` [m] from `start` [m] on, and rocks under the
    wheels of one side do not overlap. `diameters` are the smallest and the largest diameter [m].

    Source: paper, section 4: "several rocks with the diameter of 5-10 centimeters are scattered over the sand".
    Assumed: their number, that half of each rock is buried, and that they are harder than the sand (section 4.2).

    Raises ParameterError: rocks of the largest diameter would not fit into the length.
    """
    smallest, largest = diameters
    bounds = arguments_of(rocks)["diameters"].quantity
    check("terrain", "smallest diameter", smallest, bounds)
    check("terrain", "largest diameter", largest, bounds._replace(low=smallest))
    count = int(count)
    # The small tolerance admits rocks that fill the length exactly, in spite of round-off.
    if count * largest > length * (1.0 + 1e-12):
        raise ParameterError(
            f"{count} rocks with diameters of up to {largest:g} m may not fit into a stretch of {length:g} m: "
            "ask for fewer rocks, or for a longer stretch."
        )
    # The free length is divided at random between the rocks, so that no rock overlaps another. The order of the draws
    # is part of the result: a seed gives the same terrain in each version.
    rng = np.random.default_rng(int(seed))
    size, left = rng.uniform(smallest, largest, count), rng.random(count) < 0.5
    free = np.sort(rng.uniform(0.0, max(length - float(np.sum(size)), 0.0), count))
    begin = start + free + np.concatenate([[0.0], np.cumsum(size)[:-1]])
    # The outline of a rock of unit diameter, from its rear edge to its front edge; both edges lie exactly at z = 0.
    turn = np.linspace(math.pi, 0.0, ROCK_PIECES + 1)
    arch = np.concatenate([[0.0], np.sin(turn[1:-1]), [0.0]])
    profiles = []
    for side in (~left, left):
        x, z, soil = [start - LEAD], [0.0], list[int]()
        for low, diameter in zip(begin[side], size[side], strict=True):
            # Two rocks that touch share a point.
            skip = 1 if low - x[-1] <= 1e-9 else 0
            x.extend((low + 0.5 * diameter * (1.0 + np.cos(turn)))[skip:])
            z.extend((0.5 * diameter * arch)[skip:])
            soil.extend(([0] + [ground] * ROCK_PIECES)[skip:])
        profiles.append(_polyline([*x, start + length + LEAD], [*z, 0.0], [*soil, 0]))
    return Lanes(tuple(profiles), (0.0,))


@check_arguments("terrain")
def washboard(amplitude: Amplitude = 0.01, wavelength: Wavelength = 0.3, count: Count = 10, at: Place = 0.5) -> Lanes:
    """Return level ground with `count` waves along x; each wave is 2 `amplitude` [m] high and `wavelength` [m] long.

    z = amplitude (1 - cos(2 pi s / wavelength)) with s = x - at.
    """
    count = int(count)
    phase = np.linspace(0.0, float(count), count * PIECES + 1)
    x = np.concatenate([[at - LEAD], at + wavelength * phase, [at + wavelength * count + LEAD]])
    z = np.concatenate([[0.0], amplitude * (1.0 - np.cos(2.0 * math.pi * phase)), [0.0]])
    return Lanes((_polyline(x, z),))


@check_arguments("terrain")
def cross_slope(angle: Tilt) -> HeightGrid:
    """Return a plane that rises to the left (+y) by `angle` [rad]: z = y tan(angle), 20 m long and 8 m wide."""
    return _grid(lambda _, y: y * math.tan(angle), 0.1)


@check_arguments("terrain")
def hills(seed: Seed = 0, height: HillHeight = 0.05, wavelength: HillLength = 1.5) -> HeightGrid:
    """Return random rolling ground, 20 m long and 8 m wide, whose heights have the standard deviation `height` [m].

    The height is the sum of 32 plane waves in random directions. The lengths of the waves are drawn between
    `wavelength` [m] and three times `wavelength`.
    """
    rng = np.random.default_rng(int(seed))
    heading, phase = rng.uniform(0.0, 2.0 * math.pi, 32), rng.uniform(0.0, 2.0 * math.pi, 32)
    k = 2.0 * math.pi / (wavelength * rng.uniform(1.0, 3.0, 32))

    def waves(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the height [m] at (x, y). All waves have one amplitude, which is chosen so that the standard deviation
        of the height is `height`.
        """
        cosines = np.cos(k * (x[..., None] * np.cos(heading) + y[..., None] * np.sin(heading)) + phase)
        return height * math.sqrt(2.0 / 32.0) * np.sum(cosines, axis=-1)

    return _grid(waves, 0.05)


@check_arguments("terrain")
def paper_field(
    seed: Seed = 1,
    count: Count = 6,
    depth: Depth = 0.05,
    width: Width = 0.2,
    wall_angle: WallAngle = 30.0 * DEG,
    rate: Rate = 10.0 * DEG,
    steepest: Steepest = 20.0 * DEG,
    rocks_length: RockLength = 1.5,
    size: Size = 1.0,
) -> Lanes:
    """Return the paper's test field: rocks from x = 0.5 m on, then a ditch, then a slope up to `steepest` [rad].

    Level ground lies between the three parts, and the slope continues at the inclination `steepest`.

    Parameters
    ----------
    seed, count, rocks_length
        Random seed, number of rocks, and length of the stretch with rocks [m]; see `rocks`. Rocks have soil index 1.
    depth, width, wall_angle
        Depth [m], width at the top [m] and wall angle [rad] of the ditch; see `ditch`.
    rate, steepest
        Growth of the inclination [rad/m] and final inclination [rad]; see `growing_slope`.
    size : float
        Factor on the lengths that are no arguments: the start of the rocks, the distances between the parts, and the
        diameters of the rocks.

    Source: paper, section 4: "The test filed includes a sharp ditch in the depth of 5 centimeters and smooth slopes up
    to the inclination of 20 degrees. In order to test obstacle negotiation, several rocks with the diameter of 5-10
    centimeters are scattered over the sand." The order and the distances of the parts are assumed here, in addition to
    the assumptions of `rocks`, `ditch` and `growing_slope`. Rocks of the real field may also have lain on its slopes;
    here they do not.

    Raises ParameterError: the rocks do not fit into `rocks_length`, or the ditch's walls meet above its depth.
    """
    gap = size * FIELD_GAP
    ditch_at = size * 0.5 + rocks_length + gap
    slope_at = ditch_at + width + gap
    parts = (
        rocks(seed, count, size * 0.5, rocks_length, (size * 0.05, size * 0.10)),
        ditch(depth, width, wall_angle, ditch_at),
        growing_slope(rate, slope_at, steepest),
    )
    # The first part ends at the first seam, where the second part begins, and so on. All parts are level sand at z = 0
    # at the seams, so that they join without a step.
    ends = [-math.inf, ditch_at - 0.5 * gap, slope_at - 0.5 * gap, math.inf]
    profiles = []
    # A part with a single lane, such as the ditch, is the same under the right and the left wheels.
    for lane in (0, -1):
        x, z, ground = [], [], []
        for part, (low, high) in zip((part.profiles[lane] for part in parts), itertools.pairwise(ends), strict=True):
            inside = (part.x > low) & (part.x < high)
            x += list(part.x[inside])
            z += list(part.z[inside])
            ground += list(part.ground[np.clip(np.flatnonzero(inside), 0, part.ground.size - 1)])
        profiles.append(Profile(np.array(x), np.array(z), np.array(ground[:-1])))
    return Lanes(tuple(profiles), (0.0,))


def _polyline(x: Any, z: Any, ground: Any = 0) -> Profile:
    """Return the profile through the points (x, z) of two lists [m]. `ground` is the soil index of each straight piece,
    or one index for all pieces.
    """
    return Profile(np.asarray(x, dtype=float), np.asarray(z, dtype=float), np.asarray(ground))


def _bump_profile(height: float, length: float, at: float, ground: int) -> Profile:
    """Return the profile of a raised cosine from x = `at` [m] on, between level ground; `bump` gives its equation."""
    phase = np.linspace(0.0, 1.0, PIECES + 1)
    x = np.concatenate([[at - LEAD], at + length * phase, [at + length + LEAD]])
    z = np.concatenate([[0.0], 0.5 * height * (1.0 - np.cos(2.0 * math.pi * phase)), [0.0]])
    return _polyline(x, z, np.concatenate([[0], np.full(PIECES, ground), [0]]))


def _grid(height: Callable[[np.ndarray, np.ndarray], np.ndarray], spacing: float) -> HeightGrid:
    """Return the height grid of a function that returns the height [m] at (x, y).

    The grid is 20 m long from x = -2 m on and 8 m wide around y = 0, with the spacing `spacing` [m].
    """
    nx, ny = round(20.0 / spacing) + 1, round(8.0 / spacing) + 1
    x, y = np.meshgrid(-2.0 + spacing * np.arange(nx), spacing * (np.arange(ny) - (ny - 1) / 2), indexing="ij")
    return HeightGrid(-2.0, -4.0, spacing, spacing, height(x, y))
