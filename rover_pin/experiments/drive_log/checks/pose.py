"""Checks of the tracked pose in a run: its units, heading and pitch, whether it agrees with the declared start and
terrain, and whether it was computed from wheel odometry instead of measured.

Each check is a function of a run and a limit that yields the faults of the run. `log.py` lists all checks with their
limits.
"""

import math
from collections.abc import Iterator
from itertools import groupby
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from rover_pin.experiments.drive_log.checks.run_blocks import (
    MAX_CHANCE,
    MIN_SAMPLES,
    Remarks,
    RunBlocks,
    degrees,
    independent_blocks,
    is_significant,
)
from rover_pin.simulation.trace.channels import ODOMETRY
from rover_pin.terrain.files import LARGEST

MAX_CHANCE_OF_RUN = 1e-4
"""Maximum probability that unrelated series have the observed correlation, if the correlation is to refuse a run. It
applies to channels that occur once in a run and is larger than MAX_CHANCE, which applies to the many channels of
wheels."""

MIN_SPEED_RATIO = 0.1
"""Minimum ratio of travel speed to rim speed in a block, if the course (direction of travel) of the block is to be
used. At a lower ratio, the noise of the tracker decides the direction."""

MAX_ASTRAY = math.radians(75.0)
"""Maximum angle between heading and course [rad] that a rover which drives partly sideways (crabs) may have. Real
drives are assumed to reach at most half of it."""

ALIGNED = 0.9
"""Minimum length of the mean of unit vectors that point in one direction. At this length, their angles scatter by 26
deg. The mean of n random unit vectors reaches the length R with the probability exp(-n R^2) (Rayleigh), which must also
be below MAX_CHANCE."""

MAX_FOLLOWING_ERROR = 0.25
"""Maximum RMS angle between course and heading [rad] of a rover that travels in the direction of its heading: 14 deg
for crabbing and noise."""

MAX_SLOPE_ERROR = 0.3
"""Maximum relative error of the ratio between changes of the course and changes of the yaw. Up to this value, the yaw
counts as being in the tested unit. The course is noisy; a yaw in the wrong unit differs by a factor of 57."""

MIN_CLIMB_SD = math.radians(1.5)
"""Minimum SD of the climb angle [rad] for a comparison with the pitch: several times the noise of a tilt sensor
(assumed)."""

MAX_UNIT_ERROR = 1.5
"""Maximum factor between a measured ratio and the ratio of two units, if a message is to name the unit. Slip and radius
change the ratio too; the ratios of the units differ by a factor of 6 or more."""

MAX_RATIO_SPREAD = 2.0
"""Maximum ratio of the median to the tenth percentile of (rim speed / travel speed), if a wrong unit is to be reported.
With a wrong unit, the ratio is nearly constant. A larger spread is caused by slip: a slip of 0.5 doubles the ratio."""

MIN_RATE = 0.02
"""Minimum wheel rate [rad/s] for a comparison of rim speed and travel speed: slower servos turn in steps (assumed). The
limit is applied in every possible unit of the logged rate."""

SPEED_UNITS = {
    60.0 / (2.0 * math.pi): ("the wheel rates look like rpm", "give rad/s: multiply the rates by 2 pi / 60"),
    180.0 / math.pi: ("the wheel rates look like deg/s", "give rad/s: multiply the rates by pi / 180"),
    1.0 / (2.0 * math.pi): ("the wheel rates look like turns per second", "give rad/s: multiply the rates by 2 pi"),
    1e-3: ("body_x and body_y look like millimetres", "give metres: divide body_x and body_y by 1000"),
    1e-2: ("body_x and body_y look like centimetres", "give metres: divide body_x and body_y by 100"),
}
"""Ratio of rim speed to travel speed without slip that a wrong unit gives -> the unit in words, and the remedy."""

VELOCITY_UNITS = {3.6: "km/h", 100.0: "cm/s", 1000.0: "mm/s"}
"""Factor -> name of a unit of speed; this number of the unit equals 1 m/s."""

MAX_VELOCITY_ANGLE = math.radians(60.0)
"""Maximum angle between the reported velocity and the change of the tracked position [rad]: twice the angle of crabbing
(assumed). A larger angle means that both have different axes."""

MIN_SPEED = 0.01
"""Minimum RMS speed of the tracked position [m/s] for a comparison with a reported velocity: ten times the error of a
block."""

START_TIME = 0.3
"""Time at the beginning of a run [s] over which the pose is averaged, to compare it with the declared start. This time
has several samples at 10 Hz and ends before the rover moves (assumed)."""

MIN_STEPS = 50
"""Minimum number of samples for a comparison of the pose with wheel odometry. In a run of this length, one of 60
unrelated pairs exceeds MIN_SHARED_NOISE by chance."""

MAX_DEVIATION = 2.0
"""Maximum SD of the distance between a pose from odometry and the travel of the rims, in units of the pose's noise: a
sum of noise wanders by more than one unit (assumed)."""

ROUND_OFF = 1e-6
"""Tolerance for the rounding of numbers in a log, as a fraction of the travel. If the SD of the difference between the
pose and the travel of the rims is below it, the pose counts as computed from the wheel rates, even if the pose shows no
noise."""

MAX_NOISE_SHARE = 0.001
"""Maximum ratio of the noise of a pose to its travel, for a comparison with odometry. At this limit, a slip that varies
by 1 % would still be ten times as large as the noise."""

MIN_SHARED_NOISE = 0.3
"""Minimum rank correlation between the noise of a pose and the noise of the rims. From this value on, the pose counts
as computed from the wheels (odometry). On level ground, wheels may slip as evenly as odometry assumes, but a tracker
has noise of its own. Equal noises give 1, independent noises 0."""


def wrong_heading(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the yaw is in degrees, or if heading and course (direction of travel) differ by more than
    `limit` [rad].
    """
    use = run.steady & np.isfinite(run.velocity) & (np.abs(run.velocity) > MIN_SPEED_RATIO * np.abs(run.rim))
    use &= np.abs(run.rim) > 0.0
    if np.sum(use) < MIN_SAMPLES:
        return
    # A rover that drives backwards points against its course, so that the sign of the rim speed is taken out.
    course = run.velocity[use] / np.abs(run.velocity[use]) * np.sign(run.rim[use])
    mean = complex(np.mean(course * np.conj(run.heading[use])))
    angle = abs(float(np.angle(mean)))
    if _in_degrees(run, course, use):
        yield "body_yaw looks like degrees", "give radians: multiply body_yaw by pi / 180"
    elif angle > limit and abs(mean) > ALIGNED and math.exp(-np.sum(use) * abs(mean) ** 2) < MAX_CHANCE:
        is_backwards = abs(angle - math.pi) < 0.3
        todo = "add pi to body_yaw, or turn the signs of duties and wheel rates" if is_backwards else ""
        yield f"the rover travels {degrees(angle)} off its heading, body_yaw", todo


def _in_degrees(run: RunBlocks, course: np.ndarray, use: np.ndarray) -> bool:
    """Return whether the yaw is in degrees, that is, whether it agrees with the course only after multiplication by pi
    / 180.

    `course` holds the direction of travel in the blocks that the mask `use` marks, as complex numbers of size 1. Noise
    around a straight course also agrees with the course if it is divided by 57. Therefore one of two further conditions
    must hold: the numbers exceed one turn in radians, or the course changes with the yaw at a ratio of pi / 180, beyond
    chance.
    """
    yaw = run.trace["body_yaw"]
    # Both readings of the yaw are compared with the course: as radians, and as degrees.
    off, off_degrees = (np.angle(course * np.conj(run.direction(angles)[use])) for angles in (yaw, np.radians(yaw)))
    rms, rms_degrees = (float(np.sqrt(np.mean(angles**2))) for angles in (off, off_degrees))
    if not (rms_degrees < MAX_FOLLOWING_ERROR and rms > rms_degrees + MAX_FOLLOWING_ERROR):
        return False
    if float(np.nanmax(np.abs(yaw))) > 2.0 * math.pi:
        return True
    course_angle, heading = np.unwrap(np.angle(course)), run.mean(yaw)[use]
    if len(heading) < MIN_SAMPLES or min(np.std(heading), np.std(course_angle)) == 0.0:
        return False
    correlation = float(np.corrcoef(course_angle, heading)[0, 1])
    # Regression slope of the course on the yaw; it is pi / 180 if the yaw is in degrees.
    slope = correlation * float(np.std(course_angle) / np.std(heading))
    is_certain = correlation > 0.0 and is_significant(correlation, independent_blocks(course_angle, heading))
    return is_certain and abs(slope / math.radians(1.0) - 1.0) < MAX_SLOPE_ERROR


def wrong_pitch(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the pitch has the wrong sign, or if its change is larger than `limit` times the change of the
    climb angle.

    Nose down is positive, so the pitch must decrease when the rover climbs. The climb angle is computed from the
    tracked height and from the declared terrain between the axles. If both are known, both must show that the pitch is
    wrong, because a rover whose length is half a wave of the terrain pitches down where its middle rises.
    """
    if "body_pitch" not in run.trace:
        return
    # Slow blocks are left out, because their climb angle is mostly noise.
    along = np.real(run.velocity * np.conj(run.heading))
    pitch = run.mean(run.trace["body_pitch"])
    use = run.steady & np.isfinite(along * pitch) & (np.abs(along) > 0.5 * MIN_SPEED_RATIO * np.abs(run.rim))
    climbs = []
    if run.finite("body_z").size:
        climbs.append(np.arctan(run.slope(run.trace["body_z"]) / np.where(along == 0.0, np.nan, along)))
    if (terrain := run.declared.terrain) is not None:
        x, y, yaw = (run.trace[f"body_{name}"] for name in ("x", "y", "yaw"))
        finite = np.isfinite(x + y + yaw)
        # The rise between the axles divided by their distance is the climb angle of the ground.
        ahead = 0.5 * run.declared.length * np.exp(1j * yaw[finite])
        rise = np.full(len(x), np.nan)
        rise[finite] = terrain.height(x[finite] + ahead.real, y[finite] + ahead.imag)
        rise[finite] -= terrain.height(x[finite] - ahead.real, y[finite] - ahead.imag)
        climbs.append(run.mean(np.arctan(rise / run.declared.length)))
    gains = [_pitch_gain(climb[use], pitch[use]) for climb in climbs]
    if gains and max(gains) < -0.5:
        yield "body_pitch rises where the rover climbs", "multiply body_pitch by -1: nose down is positive"
    elif gains and min(gains) > limit:
        what = f"body_pitch changes {min(gains):.0f} times as much as the climb"
        yield what, "if body_pitch is in degrees, multiply body_pitch by pi / 180"


def _pitch_gain(climb: np.ndarray, pitch: np.ndarray) -> float:
    """Return the regression slope of the negative pitch on the climb angle, both [rad] (blocks,); about 1 for a correct
    pitch.

    The result is 0 if the climb angle varies too little (MIN_CLIMB_SD), or if chance explains the correlation.
    """
    # A correct pitch falls by as much as the climb angle rises, so the gain is 1.
    use = np.isfinite(climb)
    if np.sum(use) < MIN_SAMPLES or np.std(climb[use]) < MIN_CLIMB_SD:
        return 0.0
    climb, pitch = climb[use], pitch[use]
    covariance = float(np.cov(climb, pitch)[0, 1])
    if not np.std(pitch) > 0.0:
        return 0.0
    # Either the angles or their changes must correlate. A slow drift of a tilt sensor does not affect the changes.
    pairs = (climb, pitch), (np.diff(climb), np.diff(pitch))
    is_certain = any(
        is_significant(float(np.corrcoef(a, b)[0, 1]), independent_blocks(a, b), MAX_CHANCE_OF_RUN) for a, b in pairs
    )
    return -covariance / float(np.var(climb, ddof=1)) if is_certain else 0.0


def unlevel_differential(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the mean of rocker_l + rocker_r exceeds `limit` [rad], although a differential holds this sum at
    0.
    """
    if not run.declared.has_differential or "rocker_l" not in run.trace or "rocker_r" not in run.trace:
        return
    # The differential turns both rockers by opposite angles, so their sum is the error of the sensors' zeros.
    total = run.trace["rocker_l"] + run.trace["rocker_r"]
    total = total[np.isfinite(total)]
    if total.size and abs(float(np.mean(total))) > limit:
        yield f"rocker_l + rocker_r is {np.mean(total):.3f} rad in the mean (SD {np.std(total):.3f}), not 0", ""


def wrong_speed_units(run: RunBlocks, limit: tuple[float, float]) -> Remarks:
    """Yield a fault if the ratio of rim speed to travel speed lies outside the interval `limit` throughout the run.

    Wheel rates or positions are then probably in a wrong unit. The tenth percentile of the ratio is compared, because
    the wheels slip least there. If the ratio varies strongly within the run, the cause is slip, and no fault is
    yielded.
    """
    # Sizes are compared, because the signs are checked elsewhere.
    rim, speed = np.abs(run.rim), np.abs(run.velocity)
    is_turning = run.steady & np.isfinite(rim * speed) & (rim > MIN_RATE * run.radius)
    use = is_turning & (speed > 0.004 * rim)
    if np.sum(use) < max(MIN_SAMPLES, 0.5 * np.sum(is_turning)):
        return
    lowest, median = np.percentile(rim[use] / speed[use], [10, 50])
    if limit[0] < lowest < limit[1] or median > MAX_RATIO_SPREAD * lowest:
        return
    # The wrong unit is named only if its ratio is near the measured one.
    factor = min(SPEED_UNITS, key=lambda candidate: abs(math.log(lowest / candidate)))
    times = f"the rim runs {median:.3g} times as fast as the rover all along"
    if abs(math.log(lowest / factor)) > math.log(MAX_UNIT_ERROR):
        yield times, ""
    else:
        unit, todo = SPEED_UNITS[factor]
        yield f"{times}: {unit}", todo


def wrong_velocity(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the reported velocity differs from the change of the tracked position in size or in direction.

    The sizes may differ by the factor `limit`, and the directions by MAX_VELOCITY_ANGLE. They are the absolute value
    and the argument of a complex factor. The tracked velocity times this factor fits the reported velocity, by least
    squares.
    """
    if "body_vx" not in run.trace or "body_vy" not in run.trace:
        return
    # A standing rover has no direction, so the tracked speed must be well above its noise.
    reported = run.mean(run.trace["body_vx"]) + 1j * run.mean(run.trace["body_vy"])
    use = run.steady & np.isfinite(reported) & np.isfinite(run.velocity)
    power = float(np.sum(np.abs(run.velocity[use]) ** 2))
    if np.sum(use) < MIN_SAMPLES or power == 0.0 or math.sqrt(power / np.sum(use)) < MIN_SPEED:
        return
    # The size of the complex gain is the ratio of the speeds, its angle the angle between the directions.
    gain = complex(np.sum(reported[use] * np.conj(run.velocity[use])) / power)
    has_size = 1.0 / limit < abs(gain) < limit
    if has_size and abs(np.angle(gain)) < MAX_VELOCITY_ANGLE:
        return
    ratio = min(VELOCITY_UNITS, key=lambda factor: abs(math.log(max(abs(gain), 1e-9) / factor)))
    what = f"body_vx and body_vy are {abs(gain):.3g} times the speed of body_x and body_y"
    if has_size:
        what = "body_vx and body_vy point in another direction than body_x and body_y move"
        yield what, "give body_vx and body_vy in the axes of body_x and body_y, or leave both out"
    elif ratio / MAX_UNIT_ERROR < abs(gain) < ratio * MAX_UNIT_ERROR:
        yield f"{what}: they look like {VELOCITY_UNITS[ratio]}", f"give m/s: divide both by {ratio:g}"
    else:
        yield what, ""


def racing_height(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the height changes more than `limit` times as fast as the rover travels, because no slope is so
    steep.
    """
    if "body_z" not in run.trace:
        return
    # Sums over the run are compared, so that a single bump is no fault.
    rising = np.abs(run.slope(run.trace["body_z"]))
    use = run.steady & np.isfinite(rising) & np.isfinite(run.velocity)
    distance = float(np.sum(np.abs(run.velocity[use])))
    if np.sum(use) >= MIN_SAMPLES and float(np.sum(rising[use])) > limit * distance > 0.0:
        yield f"body_z changes {np.sum(rising[use]) / distance:.3g} times as fast as the rover travels", ""


def start_offset(run: RunBlocks, limit: tuple[float, float]) -> Remarks:
    """Yield a fault if the declared start differs from the first tracked pose by more than `limit` = (distance [m],
    angle [rad]).
    """
    start, trace = run.trace.attrs.get("start"), run.trace
    if not start:
        return
    # Several samples are averaged, so that the noise of one sample does not count as an offset.
    first = trace.t <= trace.t[0] + START_TIME
    x, y, yaw = (trace[f"body_{name}"][first] for name in ("x", "y", "yaw"))
    place = (x - start.get("x", 0.0)) + 1j * (y - start.get("y", 0.0))
    heading = np.exp(1j * (yaw - start.get("yaw", 0.0)))
    place, heading = place[np.isfinite(place)], heading[np.isfinite(heading)]
    distance = float(np.abs(place.mean())) if place.size else 0.0
    angle = abs(float(np.angle(heading.mean()))) if heading.size else 0.0
    if distance > limit[0] or angle > limit[1]:
        yield f"the declared start is {1e3 * distance:.3g} mm and {degrees(angle)} off from the first tracked pose", ""


def far_places(run: RunBlocks, limit: float) -> Remarks:
    """Yield each coordinate whose median is farther than `limit` [m] from the origin.

    Coordinates of a map grid are so far from 0 that no declared terrain reaches them.
    """
    for name in ("body_x", "body_y", "body_z"):
        values = run.finite(name)
        median = float(np.median(values)) if values.size else 0.0
        if abs(median) > limit:
            todo = f"give metres from an origin on the declared ground, which lies within {LARGEST:g} m of 0"
            yield f"{name} is {median:.3g} m in the median", todo


def beyond_the_ground(run: RunBlocks, limit: float) -> Remarks:
    """Yield the rover's largest distance beyond the border of the declared terrain, if it exceeds `limit` [m]."""
    if run.declared.terrain is None:
        return
    # Beyond its borders, the terrain is continued, but its height there is not declared.
    box = run.declared.terrain.extent
    for axis, low, high in (("x", box.x_low, box.x_high), ("y", box.y_low, box.y_high)):
        values = run.finite(f"body_{axis}")
        overshoot = float(np.max(np.maximum(low - values, values - high), initial=0.0))
        if overshoot > limit:
            yield (
                f"body_{axis} goes {overshoot:.3g} m beyond the declared ground, which spans {low:.4g} to {high:.4g} m",
                "",
            )


class RimFit(NamedTuple):
    """Agreement of a tracked pose with the travel of the rims, from a linear fit of the travelled distance to the rim
    distance.
    """

    slip: float
    """mean slip of the wheels that the fit gives"""
    deviation: float
    """SD of the difference between travelled distance and rim distance after the mean slip is subtracted [m]"""
    noise: float
    """SD of the white noise of the pose, from the changes between samples [m]"""
    travel: float
    """total rim distance of the run [m]"""
    shared: float
    """rank correlation between the noise of the pose and the noise of the rims; about 0 for a tracker with noise of its
    own"""

    @classmethod
    def of(cls, step: np.ndarray, rolled: np.ndarray) -> "RimFit":
        """Fit the pose to the rims, given the distances of both between successive samples [m] (rows - 1,)."""
        # Distances are compared and not speeds, because the noise of a measured place does not add up.
        place, rims = np.cumsum(step), np.cumsum(rolled)
        centred = rims - rims.mean()
        square = float(centred @ centred)
        # Slope of the travelled distance over the rim distance: 1 minus the slip.
        ratio = float(centred @ (place - place.mean())) / square if square > 0.0 else 0.0
        residual = place - ratio * rims
        noise = float(np.std(np.diff(residual))) / np.sqrt(2.0)
        shared = float(spearmanr(np.diff(step), np.diff(rolled)).statistic) if np.ptp(np.diff(rolled)) > 0.0 else 0.0
        return cls(1.0 - ratio, float(np.std(residual)), float(noise), float(np.sum(np.abs(rolled))), shared)

    @property
    def is_equal(self) -> bool:
        """Whether the pose agrees with the rims within its noise, and this noise is small enough to show slip."""
        within = self.deviation < max(MAX_DEVIATION * self.noise, ROUND_OFF * self.travel)
        return within and self.noise < MAX_NOISE_SHARE * self.travel


def pose_of_the_wheels(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the pose was computed from the wheel rates, because the search for missing effects would then
    find a rover that never slips.

    The pose is taken as computed if it agrees with the rims with a mean slip below `limit`, and if it has the noise of
    the wheel rates. A log that declares `place = "odometry"` is not checked.
    """
    if run.trace.attrs.get("place") != ODOMETRY and any(
        fit.is_equal and abs(fit.slip) < limit and fit.shared > MIN_SHARED_NOISE for fit in _rim_fits(run)
    ):
        yield "body_x and body_y move as the wheels turn, within their noise: they are the wheels' odometry", ""


def pose_like_the_wheels(run: RunBlocks, limit: float) -> Remarks:
    """Yield a note if the pose is declared as odometry, or if it agrees with the rims with a mean slip below `limit`.

    A pose that agrees with the rims may be odometry with another wheel radius, or a measured pose of wheels that slip
    evenly.
    """
    if run.trace.attrs.get("place") == ODOMETRY:
        todo = (
            "slip is not measured, so numbers that depend on slip keep their assumed values; bumps are compared at a "
            "wrong place if the wheels slip"
        )
        yield "the pose is the wheels' odometry", todo
        return
    close = [fit for fit in _rim_fits(run) if fit.is_equal and abs(fit.slip) < limit]
    if close:
        yield f"body_x and body_y follow the wheels at an even slip of {100 * close[0].slip:.2g} %", ""


def _rim_fits(run: RunBlocks) -> Iterator[RimFit]:
    """Yield the agreement of the pose with each odometry that a user may have computed from the wheel rates.

    The odometry uses the mean of all recorded rims or of the rims of one axle. A recorded rate may hold before its row,
    after its row, or change linearly between rows.
    """
    trace, t = run.trace, run.trace.t
    yaw = trace["body_yaw"]
    # Steps of the pose along the mean heading of their two rows.
    half = np.exp(-0.5j * (yaw[1:] + yaw[:-1]))
    step = np.real((np.diff(trace["body_x"]) + 1j * np.diff(trace["body_y"])) * half)
    # Wheels of one axle have names with the same first letter.
    recorded = [wheel for wheel in trace.wheels if run.finite(f"wheel_rate_{wheel}").size]
    axles = [list(wheels) for _, wheels in groupby(recorded, key=lambda wheel: wheel[:1])]
    for wheels in filter(None, (recorded, *(axles if len(axles) < len(recorded) else ()))):
        rim = run.radius * np.mean([trace[f"wheel_rate_{wheel}"] for wheel in wheels], axis=0)
        for rate in (rim[:-1], rim[1:], 0.5 * (rim[:-1] + rim[1:])):
            rolled = rate * np.diff(t)
            use = np.isfinite(step + rolled)
            if np.sum(use) >= MIN_STEPS:
                yield RimFit.of(step[use], rolled[use])
