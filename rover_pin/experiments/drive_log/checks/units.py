"""Units of a drive log, read from the numbers: what turns and what moves must agree up to slip."""

import math

import numpy as np

from rover_pin.experiments.drive_log.checks.driven import AT_LEAST, FAR_OFF, Driven, Remarks

SLOWEST_SAMPLING = 1.0
"""Samples further apart [s] tell nothing of a drive, and milliseconds taken for seconds are. Why: a duty that is held
for 2.5 s then has two samples."""

FACTORS = {
    60.0 / (2.0 * math.pi): ("the wheel rates look like rpm", "give rad/s: multiply them by 2 pi / 60"),
    180.0 / math.pi: ("the wheel rates look like deg/s", "give rad/s: multiply them by pi / 180"),
    1.0 / (2.0 * math.pi): ("the wheel rates look like turns per second", "give rad/s: multiply them by 2 pi"),
    1e-3: ("body_x and body_y look like millimetres", "give metres: divide them by 1000"),
    1e-2: ("body_x and body_y look like centimetres", "give metres: divide them by 100"),
}
"""Rim speed over travel speed without slip -> what is wrong, and what to do."""

NEAR = 1.5
"""Ratios within this of a factor, either way, are taken for it. Why: slip and radius are off too; factors 6 apart."""

MAX_RATIO_SPREAD = 2.0
"""Median over tenth percentile of a ratio that is a unit's, and no slip's. Why: a slip of 0.5 doubles it."""

LARGEST = {"body_pitch": 0.5 * math.pi, "body_roll": math.pi, "rocker_": 2.0, "bogie_": 2.0, "steer_": 2.0 * math.pi}
"""Greatest angle [rad] that a channel can show; beyond it stand degrees."""

MOST_VOLTS, MOST_AMPERES = 1000.0, 100.0
"""Beyond this a rover's battery [V] or motor current [A] is in thousandths, as beyond FAR_OFF times the stall current.
Why: no rover's battery has 1 kV, nor its motors 100 A."""


def unit_faults(run: Driven) -> Remarks:
    """Yield channels of a run whose numbers are in another unit than theirs."""
    if run.period > SLOWEST_SAMPLING:
        what = f"samples lie {run.period:.3g} s apart"
        yield what, "if t_s is in milliseconds divide it by 1000, else log twice a second or more"
        return
    yield from _rates_or_positions(run)
    yield from _angles(run)
    yield from _thousandths(run)


def _rates_or_positions(run: Driven) -> Remarks:
    """Yield the unit that rim speed over travel speed tells; the tenth percentile, where grip is best."""
    rim, speed = np.abs(run.rim), np.abs(run.velocity)
    turning = run.steady & np.isfinite(rim * speed) & (rim > STILL_RIM * run.radius)
    use = turning & (speed > 0.004 * rim)
    if np.sum(use) < max(AT_LEAST, 0.5 * np.sum(turning)):
        return
    best, typical_ratio = np.percentile(rim[use] / speed[use], [10, 50])
    if 0.5 < best < 5.0 or typical_ratio > MAX_RATIO_SPREAD * best:
        return
    factor = min(FACTORS, key=lambda candidate: abs(math.log(best / candidate)))
    times = f"the rim runs {typical_ratio:.3g} times as fast as the rover all along"
    if abs(math.log(best / factor)) > math.log(NEAR):
        yield times, "check the units of wheel_rate_*, body_x and body_y, and the wheel's radius"
        return
    what, todo = FACTORS[factor]
    yield f"{times}: {what}", todo


STILL_RIM = 0.02
"""Wheel rate [rad/s] from which rim and travel are compared, whatever their unit. Why: slower servos step (assumed)."""


def _angles(run: Driven) -> Remarks:
    for name, values in run.trace.channels.items():
        limit = next((most for start, most in LARGEST.items() if name.startswith(start)), math.inf)
        if np.max(np.abs(run.finite(name)), initial=0.0) > limit:
            row = int(np.nanargmax(np.abs(values)))
            what = f"{name} reaches {abs(values[row]):.3g} rad at t = {run.trace.t[row]:.4g} s (row {row + 1})"
            yield what, "if it is in degrees multiply it by pi / 180"


def _thousandths(run: Driven) -> Remarks:
    motor = run.declared.motor
    stall = math.inf if motor is None else float(motor.supply / motor.resistance)
    limits = {"battery_V": (MOST_VOLTS, "V"), "current_": (min(MOST_AMPERES, FAR_OFF * stall), "A")}
    for name in run.trace.channels:
        limit, unit = next((limits[start] for start in limits if name.startswith(start)), (math.inf, ""))
        magnitudes = np.abs(run.finite(name))
        if np.any(magnitudes > limit) and (middle := float(np.median(magnitudes[magnitudes > 0.0]))) > limit:
            yield f"{name} is {middle:.3g} {unit} in the middle", f"if it is in m{unit} divide it by 1000"
