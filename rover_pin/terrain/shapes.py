"""Terrains to drive on: the paper's field (slope, bump, ditch, rocks) and a few more.

Every shape starts on level ground at z = 0 at its `at` or `start` [m along x]. Where the paper gives no geometry, a
docstring says "assumed". Curves are sampled by straight pieces, whose corners lie on the curve.
"""

import math
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np

from rover_pin.base.arguments import arguments_of, check_arguments, spec
from rover_pin.base.errors import ParameterError
from rover_pin.base.quantity import check
from rover_pin.terrain.checks import STEEPEST
from rover_pin.terrain.terrain import HeightGrid, Lanes, Profile, Terrain

LEAD = 1.0
"""Level ground described before and behind a shape [m]; it goes on without end."""
PIECES = 24
"""Straight pieces of a bump or of one wave of a washboard."""
ROCK_PIECES = 12
DEG = math.pi / 180.0
FARTHEST = 1e6
"""Place [m] or angle [rad] beyond which millimetres and milliradians are lost in round-off."""

FIG_10 = "paper, Fig 10 and section 4"
Ground = Annotated[int, spec("", "assumed: an index of the model's soils, 0 the sand, 1 the hard ground", 0, 255)]
Place = Annotated[float, spec("m", "assumed: level ground before it", -FARTHEST, FARTHEST)]
Seed = Annotated[int, spec("", "assumed: any number gives another ground", 0, 2**53)]
Angle = Annotated[float, spec("rad", "paper, section 4: up to 20 deg", -STEEPEST, STEEPEST)]
Tilt = Annotated[float, spec("rad", "paper, section 4: up to 20 deg", -80.0 * DEG, 80.0 * DEG)]
Rate = Annotated[float, spec("rad/m", "assumed: 12 deg after 25 s at 0.05 m/s, paper's Fig 8", 1e-6, 100.0)]
Steepest = Annotated[float, spec("rad", "paper, section 4: up to 20 deg", 1e-6, 80.0 * DEG)]
Height = Annotated[float, spec("m", "assumed: crossed on sand", -100.0, 100.0)]
BumpLength = Annotated[float, spec("m", "assumed: crossed on sand", 1e-3, 1000.0)]
Depth = Annotated[float, spec("m", FIG_10, 1e-6, 100.0)]
Width = Annotated[float, spec("m", FIG_10 + "; assumed: from lip to lip", 1e-6, 1000.0)]
WallAngle = Annotated[float, spec("rad", "assumed: 30 deg is Table 1's phi", 1e-3, STEEPEST)]
StepAngle = Annotated[float, spec("rad", "assumed: the steepest that a profile may have", 1e-3, STEEPEST)]
Count = Annotated[int, spec("", "assumed: the paper says several", 1, 10000)]
RockLength = Annotated[float, spec("m", "assumed: the paper says scattered", 1e-3, 1000.0)]
Diameters = Annotated[tuple[float, float], spec("m", "paper, section 4: 5 to 10 cm", 1e-3, 100.0)]
Left = Annotated[bool, spec("", "assumed: under the left wheels")]
Amplitude = Annotated[float, spec("m", "assumed: not in the paper", 0.0, 100.0)]
Wavelength = Annotated[float, spec("m", "assumed: not in the paper", 1e-3, 1000.0)]
HillHeight = Annotated[float, spec("m", "assumed: not in the paper; standard deviation", 0.0, 100.0)]
HillLength = Annotated[float, spec("m", "assumed: not in the paper", 0.2, 1000.0)]
End = Annotated[float, spec("m", "none: no stretch of hard ground is laid")]


def flat(ground: Ground = 0) -> Lanes:
    """Return level ground of one soil."""
    return Lanes((_polyline([-LEAD, LEAD], [0.0, 0.0], ground),))


@check_arguments("terrain")
def incline(angle: Angle, start: Place = 1.0) -> Lanes:
    """Return level ground that turns into a slope of `angle` [rad] at `start` [m]; negative goes down.

    Source: paper, section 4: the field has "smooth slopes up to the inclination of 20 degrees".
    """
    return Lanes((_polyline([start - LEAD, start, start + LEAD], [0.0, 0.0, LEAD * math.tan(angle)]),))


@check_arguments("terrain")
def growing_slope(rate: Rate = 10.0 * DEG, start: Place = 0.5, steepest: Steepest = 20.0 * DEG) -> Lanes:
    """Return a slope whose inclination grows by `rate` [rad/m] from `start` [m], until it stays at `steepest` [rad].

    z = -ln(cos(rate s)) / rate over s = x - start, the integral of tan(rate s).

    Source: paper, Fig 8: "a slope that has an increasing inclination", 12 deg at t = 25 s, and section 4: up to
    20 deg. The rate is assumed: 12 deg after 25 s at 0.05 m/s is about 10 deg a metre.
    """
    pieces = max(2, math.ceil(steepest / (0.5 * DEG)))
    s = np.linspace(0.0, steepest / rate, pieces + 1)
    z = -np.log(np.cos(rate * s)) / rate
    x = np.concatenate([[start - LEAD], start + s, [start + s[-1] + LEAD]])
    return Lanes((_polyline(x, np.concatenate([[0.0], z, [z[-1] + LEAD * math.tan(steepest)]])),))


@check_arguments("terrain")
def bump(height: Height = 0.04, length: BumpLength = 0.3, at: Place = 0.5, ground: Ground = 0) -> Lanes:
    """Return a raised cosine of `height` over `length` [m] across the whole width, of soil index `ground`.

    z = height / 2 (1 - cos(2 pi s / length)), s = x - at.

    Source: paper, Fig 7: "rover motion moving over a bump". Shape and size are assumed: steep enough to
    matter, gentle enough to be crossed on sand, as in the paper's simulation, where "all the surface is modeled as
    dry sand". The paper supposes that the real obstacle was hard: give `ground` = 1 and a harder soil.
    """
    return Lanes((_bump_profile(height, length, at, ground),))


@check_arguments("terrain")
def one_sided_bump(
    height: Height = 0.04, length: BumpLength = 0.3, at: Place = 0.5, ground: Ground = 0, *, left: Left = True
) -> Lanes:
    """Return the same bump under the left wheels (y > 0) only, or under the right ones.

    It ends at y = 0 with a sheer edge, which a wheel meets over its width: see `terrain.section`.
    """
    level, raised = flat().profiles[0], _bump_profile(height, length, at, ground)
    return Lanes((level, raised) if left else (raised, level), (0.0,))


@check_arguments("terrain")
def ditch(depth: Depth = 0.05, width: Width = 0.2, wall_angle: WallAngle = 30.0 * DEG, at: Place = 0.5) -> Lanes:
    """Return a ditch with straight walls and a level floor; `width` [m] is measured at the top, from lip to lip.

    The floor is width - 2 depth / tan(wall_angle) wide, or nothing, when the walls meet at the depth.

    Source: paper, Fig 10: "a sandy ditch, which has 0.05 [m] depth and 0.2 [m] width"; section 4 calls it sharp.
    Assumed: the width is that at the top; the paper does not state the wall angle [rad], which decides whether the
    rover gets out; 30 deg is Table 1's phi, the steepest at which its sand stands by itself.

    Raises ParameterError: walls so gentle that they meet above the depth.
    """
    wall = depth / math.tan(wall_angle)
    floor = width - 2.0 * wall
    if floor < -1e-9:
        raise ParameterError(
            f"The ditch's walls at {math.degrees(wall_angle):g} deg meet {0.5 * width * math.tan(wall_angle):.4g} m "
            f"down, above its depth of {depth:g} m: use {math.degrees(math.atan(2.0 * depth / width)):.4g} deg "
            "or more, a wider ditch or a shallower one."
        )
    x = [at - LEAD, at, at + wall, at + width - wall, at + width, at + width + LEAD]
    z = [0.0, 0.0, -depth, -depth, 0.0, 0.0]
    if floor <= 1e-9:
        x[2:4], z[2:4] = [at + 0.5 * width], [-depth]
    return Lanes((_polyline(x, z),))


@check_arguments("terrain")
def step(height: Height = 0.05, wall_angle: StepAngle = STEEPEST, at: Place = 0.5, ground: Ground = 0) -> Lanes:
    """Return a step up by `height` [m], or down where it is negative; its wall leans at `wall_angle` [rad].

    `ground` is the soil index of the wall and of what lies behind it.
    """
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
    """Return half-buried round rocks of soil index `ground`, each at random under the left or the right wheels.

    A rock is a half circle in x and z, of 12 straight pieces, and reaches across its side: a half cylinder, not a ball.
    `count` rocks lie within `length` [m] from `start` [m]; those of one side do not overlap.

    Source: paper, section 4: "several rocks with the diameter of 5-10 centimeters are scattered over the sand".
    Assumed: their number, that half of each is buried, and that they are harder than the sand (section 4.2).

    Raises ParameterError: rocks that may not fit into the length.
    """
    smallest, largest = diameters
    bounds = arguments_of(rocks)["diameters"].quantity
    check("terrain", "smallest diameter", smallest, bounds)
    check("terrain", "largest diameter", largest, bounds._replace(low=smallest))
    count = int(count)
    if count * largest > length * (1.0 + 1e-12):  # their sum may be off in its last digits
        raise ParameterError(
            f"{count} rocks of up to {largest:g} m may not fit into {length:g} m: "
            "ask for fewer, or for a longer stretch."
        )
    rng = np.random.default_rng(int(seed))
    size, left = rng.uniform(smallest, largest, count), rng.random(count) < 0.5
    free = np.sort(rng.uniform(0.0, max(length - float(np.sum(size)), 0.0), count))
    begin = start + free + np.concatenate([[0.0], np.cumsum(size)[:-1]])
    sides = (
        _rock_row(begin[side], size[side], (start - LEAD, start + length + LEAD), ground) for side in (~left, left)
    )
    return Lanes(tuple(sides), (0.0,))


@check_arguments("terrain")
def washboard(amplitude: Amplitude = 0.01, wavelength: Wavelength = 0.3, count: Count = 10, at: Place = 0.5) -> Lanes:
    """Return `count` waves z = amplitude (1 - cos(2 pi s / wavelength)) [m], each twice the amplitude high."""
    count = int(count)
    phase = np.linspace(0.0, float(count), count * PIECES + 1)
    x = np.concatenate([[at - LEAD], at + wavelength * phase, [at + wavelength * count + LEAD]])
    z = np.concatenate([[0.0], amplitude * (1.0 - np.cos(2.0 * math.pi * phase)), [0.0]])
    return Lanes((_polyline(x, z),))


@check_arguments("terrain")
def cross_slope(angle: Tilt) -> HeightGrid:
    """Return a plane that rises to the left by `angle` [rad]: z = y tan(angle), 20 m long and 8 m wide."""
    return _grid(lambda _, y: y * math.tan(angle), 0.1)


@check_arguments("terrain")
def hills(seed: Seed = 0, height: HillHeight = 0.05, wavelength: HillLength = 1.5) -> HeightGrid:
    """Return random rolling ground, 20 m long and 8 m wide, of standard deviation `height` [m].

    The sum of 32 plane waves in random directions, of lengths between `wavelength` [m] and three times that.
    """
    rng = np.random.default_rng(int(seed))
    heading, phase = rng.uniform(0.0, 2.0 * math.pi, 32), rng.uniform(0.0, 2.0 * math.pi, 32)
    k = 2.0 * math.pi / (wavelength * rng.uniform(1.0, 3.0, 32))

    def waves(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        cosines = np.cos(k * (x[..., None] * np.cos(heading) + y[..., None] * np.sin(heading)) + phase)
        return height * math.sqrt(2.0 / 32.0) * np.sum(cosines, axis=-1)

    return _grid(waves, 0.05)


def with_ground(terrain: Terrain, x_from: End, x_to: End, index: int) -> Terrain:
    """Return the terrain with soil index `index` from `x_from` to `x_to` [m], over all y; either may be infinite.

    In a height grid these are the cells whose middle lies in between.

    Raises ParameterError: a stretch that is empty or holds no cell.
    """
    if not x_from < x_to:
        raise ParameterError(f"Soil {index} from x = {x_from:g} m to {x_to:g} m is an empty stretch: swap its ends.")
    if isinstance(terrain, Lanes):
        return Lanes(tuple(_lay_ground(profile, x_from, x_to, index) for profile in terrain.profiles), terrain.borders)
    assert isinstance(terrain, HeightGrid)
    middle = terrain.x0 + terrain.dx * (np.arange(terrain.ground.shape[0]) + 0.5)
    inside = (middle >= x_from) & (middle <= x_to)
    if not np.any(inside):
        raise ParameterError(
            f"Soil {index} from x = {x_from:g} m to {x_to:g} m covers no cell of the height grid, "
            f"which has one each {terrain.dx:g} m from {terrain.extent.x_low:g} to {terrain.extent.x_high:g} m."
        )
    ground = np.where(inside[:, None], index, terrain.ground)
    return HeightGrid(terrain.x0, terrain.y0, terrain.dx, terrain.dy, terrain.z, ground)


def _polyline(x: Any, z: Any, ground: Any = 0) -> Profile:
    return Profile(np.asarray(x, dtype=float), np.asarray(z, dtype=float), np.asarray(ground))


def _lay_ground(profile: Profile, x_from: float, x_to: float, index: int) -> Profile:
    """Cut the profile at the stretch's ends; one outside the profile keeps the old ground beyond it."""
    x = profile.x
    for end in (x_from, x_to):
        if math.isfinite(end):
            new = [end] if x[0] < end < x[-1] else [end - LEAD, end, end + LEAD]
            x = np.append(x, [cut for cut in new if np.min(np.abs(x - cut)) > 1e-9])
    x = np.sort(x)
    middle = 0.5 * (x[1:] + x[:-1])
    ground = np.where((middle > x_from) & (middle < x_to), index, profile.ground[profile.piece(middle)])
    return _polyline(x, profile.height(x), ground)


def _bump_profile(height: float, length: float, at: float, ground: int) -> Profile:
    phase = np.linspace(0.0, 1.0, PIECES + 1)
    x = np.concatenate([[at - LEAD], at + length * phase, [at + length + LEAD]])
    z = np.concatenate([[0.0], 0.5 * height * (1.0 - np.cos(2.0 * math.pi * phase)), [0.0]])
    return _polyline(x, z, np.concatenate([[0], np.full(PIECES, ground), [0]]))


def _rock_row(begin: np.ndarray, size: np.ndarray, ends: tuple[float, float], ground: int) -> Profile:
    turn = np.linspace(math.pi, 0.0, ROCK_PIECES + 1)
    arch = np.concatenate([[0.0], np.sin(turn[1:-1]), [0.0]])
    x, z, soil = [ends[0]], [0.0], list[int]()
    for low, diameter in zip(begin, size, strict=True):
        skip = 1 if low - x[-1] <= 1e-9 else 0
        x.extend((low + 0.5 * diameter * (1.0 + np.cos(turn)))[skip:])
        z.extend((0.5 * diameter * arch)[skip:])
        soil.extend(([0] + [ground] * ROCK_PIECES)[skip:])
    return _polyline([*x, ends[1]], [*z, 0.0], [*soil, 0])


def _grid(height: Callable[[np.ndarray, np.ndarray], np.ndarray], spacing: float) -> HeightGrid:
    nx, ny = round(20.0 / spacing) + 1, round(8.0 / spacing) + 1
    x, y = np.meshgrid(-2.0 + spacing * np.arange(nx), spacing * (np.arange(ny) - (ny - 1) / 2), indexing="ij")
    return HeightGrid(-2.0, -4.0, spacing, spacing, height(x, y))
