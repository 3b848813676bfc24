"""Sensors of a drive log that are stuck, clipped, or show what cannot be."""

import numpy as np

from rover_pin.experiments.drive_log.checks.columns import longest_run, stretches
from rover_pin.experiments.drive_log.checks.driven import AT_LEAST, FAR_OFF, OFF, Driven, Remarks, degrees
from rover_pin.experiments.drive_log.readings.outliers import JUMPS, pose_outliers, without_poses
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.trace.channels import unit_of
from rover_pin.simulation.trace.trace import Trace

STUCK = 3.0
"""A channel that keeps one value so long [s] while others move is frozen or clipped."""

USUALLY = 10.0
"""A coarse converter repeats values as well: a stuck stretch is this many times its usual one."""

ROLLED = 0.1
"""Way of the rims [m] in which a tracker must show something. Why: ten times a poor tracker's noise (assumed)."""

TURN = 0.05
"""Smallest step of an angle [rad] from one sample to the next that counts as a jump; of a position an outlier's."""

NOISY = 12.0
"""Steps beyond this many times the usual one are jumps, after what the greatest speed allows."""

QUICKEST_TURN = 2.0
"""Rate [rad/s] at which a body may turn or pitch."""

MAX_LISTED_POSES = 5
"""Outlying poses whose times are reported."""

SPIKE = 4.0
"""A wheel rate this many times its own 99th percentile is a spike."""

AGAINST = 0.05
"""Share of driven time in which rim and travel may run against each other."""

OFF_SUPPLY = 0.3
"""Relative distance of the battery's median from the declared supply."""

MOST_CURRENT = 1.5
"""Times the declared stall current that a motor may draw."""


def frozen_faults(run: Driven) -> Remarks:
    """Yield needed channels that keep one value through the whole of a driven run."""
    rolled, travelled = (float(np.nansum(np.abs(speed))) * run.length for speed in (run.rim[run.moving], run.velocity))
    todo = "the sensor is stuck or unplugged: mend it, or leave the run out"
    constant = [wheel for wheel in run.trace.wheels if _is_constant(run.finite(f"wheel_rate_{wheel}"))]
    for wheel in constant if len(constant) < len(run.trace.wheels) or travelled > ROLLED else ():
        rate = run.finite(f"wheel_rate_{wheel}")[0]
        yield f"wheel_rate_{wheel} is {rate:g} rad/s all along while the rover drives", todo
    if rolled > ROLLED and _is_constant(run.finite("body_x")) and _is_constant(run.finite("body_y")):
        yield f"body_x and body_y stand still while the rims roll {rolled:.2g} m", todo


def _is_constant(values: np.ndarray) -> bool:
    return values.size > 1 and float(np.ptp(values)) == 0.0


def stuck_findings(run: Driven) -> Remarks:
    """Yield measured channels that keep one value for a while, or at their end of range, while others move."""
    rates = run.trace.stack("wheel_rate")
    for name, values in run.trace.channels.items():
        if not name.startswith(("wheel_rate_", "current_", "body_", "rocker_", "bogie_")):
            continue
        repeats = np.concatenate([[False], np.diff(values) == 0.0])
        others = [i for i, wheel in enumerate(run.trace.wheels) if name != f"wheel_rate_{wheel}"]
        moves = np.concatenate([[False], np.any(np.diff(rates[:, others], axis=0) != 0.0, axis=1)])
        if name != "body_x" and name.startswith(("rocker_", "bogie_", "body_")):
            if repeats[1:].all() and len(repeats) > 1 and moves.any():
                todo = "see whether it is measured: else leave the column out"
                yield f"{name} is {values[0]:g} {unit_of(name)} all along", todo
            continue
        yield from _stuck_remarks(run, name, repeats & (moves | ~moves.any()) & run.moving[run.block])


def _stuck_remarks(run: Driven, name: str, repeats: np.ndarray) -> Remarks:
    begin, count = longest_run(repeats)
    values, lasting = run.trace[name], count * run.period
    value, finite_values = values[begin], run.finite(name)
    lengths = np.diff(stretches(repeats & (values != value)))
    if lasting < STUCK or count < USUALLY * (float(np.median(lengths)) if len(lengths) > 1 else 1.0):
        return
    ends = {finite_values.min(), finite_values.max()}
    place = f"for {lasting:.3g} s from t = {run.trace.t[begin]:.4g} s on (row {begin + 1})"
    if value != 0.0 and value in ends and len(ends) > 1:
        what = f"{name} stays at its extreme, {value:.4g}, {place}"
        yield what, "it looks clipped: widen its range, or empty these cells"
    else:
        what = f"{name} stays at {value:.4g} {place} while others move"
        yield what, "it looks frozen: empty these cells, or leave the run out"


def jump_findings(run: Driven) -> Remarks:
    """Yield steps of the tracked pose that no rover makes, single outlying poses, and spikes of wheel rates."""
    outliers = pose_outliers(run.trace)
    yield from _outlier_findings(run, outliers)
    trace = without_poses(run.trace, outliers)
    rates = np.abs(run.trace.stack("wheel_rate"))
    fastest = run.radius * float(np.nanpercentile(rates, 99)) if np.isfinite(rates).any() else 0.0
    for name in ("body_x", "body_y", "body_z"):
        yield from _jumps(run, trace, name, JUMPS[name], fastest)
    for name in ("body_roll", "body_pitch", "body_yaw"):
        yield from _jumps(run, trace, name, TURN, QUICKEST_TURN)
    for wheel in run.trace.wheels:
        yield from _spikes(run, f"wheel_rate_{wheel}")


def _outlier_findings(run: Driven, outliers: np.ndarray) -> Remarks:
    rows = np.flatnonzero(outliers)
    if rows.size:
        times = ", ".join(f"{run.trace.t[row]:.4g}" for row in rows[:MAX_LISTED_POSES])
        more = f" and {rows.size - MAX_LISTED_POSES} more" if rows.size > MAX_LISTED_POSES else ""
        many = "single poses are outliers" if rows.size > 1 else "a single pose is an outlier"
        what = f"{many} among those before and after, at t = {times} s (row {rows[0] + 1}){more}"
        yield what, f"the loop leaves these {rows.size} of {len(run.trace.t)} poses out"


def _jumps(run: Driven, trace: Trace, name: str, least: float, fastest: float) -> Remarks:
    if name not in trace:
        return
    rows = np.flatnonzero(np.isfinite(trace[name]))
    t, steps = trace.t[rows], np.diff(trace[name][rows])
    if name in ("body_yaw", "body_roll"):
        steps = (steps + np.pi) % (2.0 * np.pi) - np.pi
    if not steps.size:
        return
    excess = np.abs(steps) - 3.0 * fastest * np.diff(t) - NOISY * float(np.median(np.abs(steps)))
    jumps = np.flatnonzero(excess > least)
    if jumps.size:
        worst = int(jumps[np.argmax(np.abs(steps[jumps]))])
        size = f"{1e3 * abs(steps[worst]):.3g} mm" if least != TURN else degrees(abs(float(steps[worst])))
        what = f"{name} jumps by {size} at t = {t[worst + 1]:.4g} s (row {rows[worst + 1] + 1}), {jumps.size} in all"
        yield what, "the tracker lost the rover: empty the cells that are off"


def _spikes(run: Driven, name: str) -> Remarks:
    rate, finite_rates = np.abs(run.trace[name]), np.abs(run.finite(name))
    typical_rate = float(np.percentile(finite_rates, 99)) if finite_rates.size else 0.0
    high = np.flatnonzero(rate > SPIKE * typical_rate)
    if high.size and typical_rate > 0.0:
        what = f"{name} spikes to {rate[high[0]]:.3g} rad/s at t = {run.trace.t[high[0]]:.4g} s (row {high[0] + 1})"
        yield what, f"usual is up to {typical_rate:.3g}: empty these {high.size} cells"


def range_findings(run: Driven) -> Remarks:
    """Yield slips that no wheel has for long."""
    rim, speed = run.rim[run.steady], run.speed[run.steady]
    slower = np.minimum(np.abs(rim), np.abs(speed))
    against = np.isfinite(slower) & (slower > 0.2 * np.nanmax(np.abs(run.rim), initial=0.0)) & (rim * speed < 0.0)
    share = float(np.sum(against)) / max(rim.size, 1)
    if rim.size >= AT_LEAST and share > AGAINST:
        what = f"the rover travels against its wheels in {100 * share:.0f} % of the driven time"
        yield what, "it slides, or a clock is shifted: compare the times of tracker and wheels"
    slip = run.slip
    if slip.size >= AT_LEAST and float(np.median(slip)) < -0.15:
        what = f"the rover outruns its rims (slip {np.median(slip):.2f} in the median)"
        yield what, "check the wheel's radius and the tracker's scale, unless it drives downhill"


def supply_findings(run: Driven) -> Remarks:
    """Yield battery voltages and currents that the declared motor does not allow."""
    motor = run.declared.motor
    if motor is None:
        return
    supply, stall = float(motor.supply), float(motor.supply / motor.resistance)
    voltage = float(np.median(run.finite("battery_V"))) if run.finite("battery_V").size else supply
    if abs(voltage - supply) > OFF_SUPPLY * supply:
        what = f"battery_V is {voltage:.3g} V in the median, the motor's supply {supply:.3g} V"
        yield what, "mend [motor] supply, or the voltage's scale"
    for name in (f"current_{wheel}_A" for wheel in run.trace.wheels):
        high = float(np.max(np.abs(run.finite(name)), initial=0.0))
        if high > MOST_CURRENT * stall:
            what = f"{name} reaches {high:.3g} A, {high / stall:.2g} times the declared motor's stall current"
            yield what, "mend [motor] resistance and supply, or the current's scale"


TELLING = 0.1
"""Share of the stall current from which the motor's equation tells the current. Why: below, friction and the
tachometer's error are as large (assumed)."""


def current_faults(run: Driven) -> Remarks:
    """Yield currents whose scale cannot be the motor's; raw counts or another unit."""
    yield from _off_by(FAR_OFF, run, "give amperes, or leave the currents out")


def current_findings(run: Driven) -> Remarks:
    """Yield currents that are hardly the motor's."""
    yield from _off_by(OFF, run, "check their scale, and supply, resistance, k_t and gear of [motor]")


def _off_by(limit: float, run: Driven, todo: str) -> Remarks:
    motor = run.declared.whole_motor
    times = None if motor is None or run.trace.rate_driven else _times(run, motor)
    if times is not None and not 1.0 / limit <= times <= limit:
        drawn = "what [motor] draws at these duties and rates, (duty V - K rate) / R"
        yield f"the currents are {times:.2g} times {drawn}", todo


def _times(run: Driven, motor: Motor) -> float | None:
    """Return the measured over the motor's current, the median of all wheels; None where that is not known."""
    ratios = [np.zeros(0)]
    for i, wheel in enumerate(run.trace.wheels):
        if f"current_{wheel}_A" in run.trace:
            drawn = np.abs(motor.drive(run.duty[:, i], run.rate[:, i]).current)
            measured = np.abs(run.mean(run.trace[f"current_{wheel}_A"]))
            use = run.steady & (drawn > TELLING * float(motor.supply / motor.resistance)) & np.isfinite(measured)
            ratios.append(measured[use] / drawn[use])
    joined = np.concatenate(ratios)
    return float(np.median(joined)) if joined.size >= AT_LEAST else None
