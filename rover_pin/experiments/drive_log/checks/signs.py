"""Signs of a drive log: duty against wheel, wheel against travel, heading against course, pitch against climb."""

import math
from collections.abc import Iterator

import numpy as np

from rover_pin.experiments.drive_log.checks.driven import AT_LEAST, Driven, Remarks, degrees

OPPOSITE = -0.5
"""Correlation about zero from which two channels run against each other. Why: a right sign gives nearly 1, noise 0."""

CREEP = 0.1
"""Share of the rim speed below which the travel tells no direction. Why: then the course is the tracker's noise."""

ASTRAY = math.radians(75.0)
"""Angle [rad] between heading and course that is no crabbing. Why: that is half of it at most (assumed)."""

ALIGNED = 0.9
"""Length of the mean of unit vectors from which they all point one way. Why: the angles then scatter by 26 deg."""

FOLLOWS = 0.25
"""RMS angle [rad] between course and heading of a rover that goes where it points. Why: crabbing and noise, 14 deg."""

SLOPE = 0.3
"""Relative error of the course's turn over that of the yaw. Why: the course is noisy; radians would be 57 times off."""

ENOUGH_CLIMB = math.radians(1.5)
"""SD of the climb [rad] from which the pitch is held against it. Why: several times a tilt's noise (assumed)."""

SURE = 4.0
"""Student's t of a correlation that is no chance. Why: blocks are not independent, and pass CLEAR by chance."""

STEEPER = 5.0
"""Change of pitch over change of climb from which the pitch is in another unit. Why: 1 is radians; 57 is degrees."""

UNLEVEL = 0.02
"""Mean of rocker_l + rocker_r [rad] from which it is named: 1.1 deg, beyond a potentiometer's noise."""


def wheel_sign_faults(run: Driven) -> Remarks:
    """Yield duties, wheel rates and currents that run against each other, and rates against the travel.

    A heading that is off makes all wheels run against the travel: that is said of the heading alone.
    """
    drawn, astray = _drawn_current(run), run.trace.rate_driven and any(heading_faults(run))
    for i, wheel in enumerate(run.trace.wheels):
        current = f"current_{wheel}_A"
        if run.trace.rate_driven and not astray and _correlation(run.rate[:, i], run.speed) < OPPOSITE:
            what = f"wheel_rate_{wheel} runs against the travel"
            yield what, f"multiply wheel_rate_{wheel} by -1: positive is forward"
        if _correlation(run.duty[:, i], run.rate[:, i]) < OPPOSITE:
            against = _correlation(run.rate[:, i], run.speed) < OPPOSITE
            turned, reference_channel = ("wheel_rate", "duty") if against else ("duty", "wheel_rate")
            what = f"{turned}_{wheel} runs against {reference_channel}_{wheel}"
            yield what, f"multiply {turned}_{wheel} by -1: positive is forward"
        elif current in run.trace and _correlation(drawn[:, i], run.mean(run.trace[current])) < OPPOSITE:
            yield f"{current} runs against duty_{wheel}", "multiply it by -1: positive drives forward"


def _drawn_current(run: Driven) -> np.ndarray:
    """Return what motors of a kind draw (blocks, wheels), in some unit: a duty - b rate, a and b > 0 by all currents.

    Where these do not tell them, the duty: but a wheel that others push brakes them, and its motor gives current back.
    """
    names = [f"current_{wheel}_A" for wheel in run.trace.wheels]
    current_means = [
        run.mean(run.trace[name]) if name in run.trace else np.full(len(run.duty), np.nan) for name in names
    ]
    table, current = np.column_stack([run.duty.ravel(), -run.rate.ravel()]), np.column_stack(current_means).ravel()
    use = np.isfinite(table).all(axis=1) & np.isfinite(current) & np.repeat(run.steady, len(names))
    gains, residual_sum, rank, _ = np.linalg.lstsq(table[use], np.where(use, current, 0.0)[use], rcond=None)
    if rank < 2 or np.sum(use) < AT_LEAST:
        return run.duty
    sd = np.sqrt(np.diag(np.linalg.inv(table[use].T @ table[use])) * float(residual_sum[0]) / (np.sum(use) - 2))
    sure = np.prod(np.sign(gains)) > 0 and np.all(np.abs(gains) > SURE * sd)
    return np.asarray((table @ np.abs(gains)).reshape(run.duty.shape)) if sure else run.duty


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Return the correlation about zero of what both know; 0 where that is too little."""
    use = np.isfinite(a) & np.isfinite(b)
    size = math.sqrt(float(np.sum(a[use] ** 2)) * float(np.sum(b[use] ** 2)))
    return float(np.sum(a[use] * b[use])) / size if np.sum(use) >= AT_LEAST and size > 0.0 else 0.0


def heading_faults(run: Driven) -> Remarks:
    """Yield a yaw in degrees, or one that is off from the course by more than crabbing explains."""
    use = run.steady & np.isfinite(run.velocity) & (np.abs(run.velocity) > CREEP * np.abs(run.rim))
    use &= np.abs(run.rim) > 0.0
    if np.sum(use) < AT_LEAST:
        return
    course = run.velocity[use] / np.abs(run.velocity[use]) * np.sign(run.rim[use])
    mean = complex(np.mean(course * np.conj(run.heading[use])))
    off = abs(float(np.angle(mean)))
    if _in_degrees(run, course, use):
        yield "body_yaw looks like degrees", "give radians: multiply it by pi / 180"
    elif abs(mean) > ALIGNED and off > ASTRAY:
        todo = (
            "check the axes of body_x and body_y, which axis body_yaw is taken from, that it is in radians, and that "
            "its zero is theirs: else leave it out, and import-log takes the course"
        )
        if abs(off - math.pi) < 0.3:
            todo = "add pi to body_yaw, or turn the signs of duties and wheel rates"
        yield f"the rover travels {degrees(off)} off its heading, body_yaw", todo


def _in_degrees(run: Driven, course: np.ndarray, use: np.ndarray) -> bool:
    """Whether the heading follows the course if taken in degrees, does not as it is, and chance is no explanation.

    Noise about a straight course follows in degrees as well: numbers must be beyond one turn in radians, or the course
    must turn with them at pi / 180.
    """
    yaw = run.trace["body_yaw"]
    off, off_degrees = (np.angle(course * np.conj(run.direction(angles)[use])) for angles in (yaw, np.radians(yaw)))
    follows = _rms(off_degrees) < FOLLOWS and _rms(off) > _rms(off_degrees) + FOLLOWS
    exceeds_turn = float(np.nanmax(np.abs(yaw))) > 2.0 * math.pi
    return bool(follows and (exceeds_turn or _turns_in_degrees(course, run.mean(yaw)[use])))


def _turns_in_degrees(course: np.ndarray, yaw: np.ndarray) -> bool:
    """Whether the course turns with the yaw, by pi / 180 of its numbers, beyond chance."""
    turned = np.unwrap(np.angle(course))
    if len(yaw) < AT_LEAST or min(np.std(yaw), np.std(turned)) == 0.0:
        return False
    correlation = float(np.corrcoef(turned, yaw)[0, 1])
    slope = correlation * float(np.std(turned) / np.std(yaw))
    return _is_sure(correlation, len(yaw)) and abs(slope / math.radians(1.0) - 1.0) < SLOPE


def _is_sure(correlation: float, count: int) -> bool:
    """Whether Student's t of a positive correlation is beyond chance."""
    return correlation * math.sqrt(count - 2) > SURE * math.sqrt(max(1.0 - correlation**2, 0.0))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def pitch_faults(run: Driven) -> Remarks:
    """Yield a pitch that falls where the rover climbs, or rises too fast; nose down is positive.

    A rover as long as half a wave pitches down where its middle rises: what tracker and terrain tell must agree.
    """
    if "body_pitch" not in run.trace:
        return
    along = np.real(run.velocity * np.conj(run.heading))
    pitch = run.mean(run.trace["body_pitch"])
    use = run.steady & np.isfinite(along * pitch) & (np.abs(along) > 0.5 * CREEP * np.abs(run.rim))
    gains = [_gain(climb[use], pitch[use]) for climb in _climbs(run, along)]
    if gains and max(gains) < -0.5:
        yield "body_pitch rises where the rover climbs", "multiply it by -1: nose down is positive"
    elif gains and min(gains) > STEEPER:
        what = f"body_pitch changes {min(gains):.0f} times as much as the climb"
        yield what, "if it is in degrees multiply it by pi / 180"


def _gain(climb: np.ndarray, pitch: np.ndarray) -> float:
    """Return by how much the pitch falls with the climb; 0 where that is not sure."""
    use = np.isfinite(climb)
    if np.sum(use) < AT_LEAST or np.std(climb[use]) < ENOUGH_CLIMB:
        return 0.0
    climb, pitch = climb[use], pitch[use]
    together, size = float(np.cov(climb, pitch)[0, 1]), float(np.std(climb, ddof=1) * np.std(pitch, ddof=1))
    correlation = abs(together) / size if size > 0.0 else 0.0
    return -together / float(np.var(climb, ddof=1)) if _is_sure(correlation, len(climb)) else 0.0


def _climbs(run: Driven, along: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the climb [rad] (B,) as tracked, and as the declared ground rises from the rear axle to the front one."""
    if run.finite("body_z").size:
        yield np.arctan(run.slope(run.trace["body_z"]) / np.where(along == 0.0, np.nan, along))
    terrain, length = run.declared.terrain, run.declared.length
    if terrain is None:
        return
    x, y, yaw = (run.trace[f"body_{name}"] for name in ("x", "y", "yaw"))
    finite = np.isfinite(x + y + yaw)
    ahead = 0.5 * length * np.exp(1j * yaw[finite])
    rise = np.full(len(x), np.nan)
    rise[finite] = terrain.height(x[finite] + ahead.real, y[finite] + ahead.imag)
    rise[finite] -= terrain.height(x[finite] - ahead.real, y[finite] - ahead.imag)
    yield run.mean(np.arctan(rise / length))


def differential_findings(run: Driven) -> Remarks:
    """Yield rocker angles that do not add up to 0, as a differential makes them."""
    if not run.declared.has_differential or "rocker_l" not in run.trace or "rocker_r" not in run.trace:
        return
    total = run.trace["rocker_l"] + run.trace["rocker_r"]
    total = total[np.isfinite(total)]
    if total.size and abs(float(np.mean(total))) > UNLEVEL:
        what = f"rocker_l + rocker_r is {np.mean(total):.3f} rad in the mean (SD {np.std(total):.3f}), not 0"
        yield what, "take the potentiometers' zero on level ground, or expect a sensor bias"
