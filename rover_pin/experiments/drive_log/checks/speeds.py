"""Speeds of a drive log against each other: velocity and height against place, wheel rate against duty."""

import math

import numpy as np

from rover_pin.experiments.drive_log.checks.driven import AT_LEAST, OFF, Driven, Remarks
from rover_pin.experiments.drive_log.checks.units import NEAR

TIMES = 2.0
"""A velocity that is as many times that of the place, or less, has another unit. Why: units differ by 3.6 or more."""

TURNED = math.radians(60.0)
"""Angle [rad] of a velocity to that of the place that no noise makes. Why: crabbing is half of it (assumed)."""

VELOCITY_UNITS = {3.6: "km/h", 100.0: "cm/s", 1000.0: "mm/s"}
"""Numbers of the unit that make 1 m/s."""

SLOWEST = 0.01
"""Speed [m/s] from which the tracked place tells a velocity beyond its noise. Why: ten times BLOCK's error."""


def velocity_faults(run: Driven) -> Remarks:
    """Yield a velocity that is not that of the tracked place, as a complex gain of the one on the other."""
    if "body_vx" not in run.trace or "body_vy" not in run.trace:
        return
    reported_velocity = run.mean(run.trace["body_vx"]) + 1j * run.mean(run.trace["body_vy"])
    use = run.steady & np.isfinite(reported_velocity) & np.isfinite(run.velocity)
    power = float(np.sum(np.abs(run.velocity[use]) ** 2))
    if np.sum(use) < AT_LEAST or power == 0.0 or math.sqrt(power / np.sum(use)) < SLOWEST:
        return
    gain = complex(np.sum(reported_velocity[use] * np.conj(run.velocity[use])) / power)
    if 1.0 / TIMES < abs(gain) < TIMES and abs(np.angle(gain)) < TURNED:
        return
    ratio = min(VELOCITY_UNITS, key=lambda factor: abs(math.log(max(abs(gain), 1e-9) / factor)))
    what = f"body_vx and body_vy are {abs(gain):.3g} times the speed of body_x and body_y"
    if 1.0 / TIMES < abs(gain) < TIMES:
        what = "body_vx and body_vy point elsewhere than body_x and body_y move"
        yield what, "give them in the axes of body_x and body_y, not in the rover's, or leave them out"
    elif ratio / NEAR < abs(gain) < ratio * NEAR:
        yield f"{what}: they look like {VELOCITY_UNITS[ratio]}", f"give m/s: divide them by {ratio:g}"
    else:
        yield what, "give m/s, or leave them out"


def height_faults(run: Driven) -> Remarks:
    """Yield a height that changes faster than any rover climbs."""
    if "body_z" not in run.trace:
        return
    rising = np.abs(run.slope(run.trace["body_z"]))
    use = run.steady & np.isfinite(rising) & np.isfinite(run.velocity)
    way = float(np.sum(np.abs(run.velocity[use])))
    if np.sum(use) >= AT_LEAST and float(np.sum(rising[use])) > OFF * way > 0.0:
        what = f"body_z changes {np.sum(rising[use]) / way:.3g} times as fast as the rover travels"
        yield what, "give metres: if it is in mm divide it by 1000"


def racing_faults(run: Driven) -> Remarks:
    """Yield wheels that turn faster than their motors would without load."""
    motor = run.declared.motor
    if motor is None or run.trace.rate_driven:
        return
    duty, rate = np.abs(run.duty[run.steady]), np.abs(run.rate[run.steady])
    use = np.isfinite(duty * rate) & (duty > 0.0)
    if np.sum(use) < AT_LEAST:
        return
    times = float(np.median(rate[use] / (duty[use] * float(motor.no_load_rate))))
    if times > OFF:
        what = f"the wheels turn {times:.3g} times as fast as [motor] would at their duty without load"
        yield what, "give duties from -1 to 1, and mend [motor]"
