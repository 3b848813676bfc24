"""Checks of single channels of a drive log: missing channels, gaps in time, and stuck, clipped or mis-scaled sensors.

The functions of a run and a limit are listed as checks in the tables of `log.py`. They yield pairs (fault, remedy). The
functions of a whole log yield findings directly. In messages, rows are counted from 1, as in a spreadsheet without its
header.
"""

import math
from collections.abc import Iterator

import numpy as np

from rover_pin.base.errors import closest
from rover_pin.estimation.profile import MAJORITY as MAX_MISSING_SHARE
from rover_pin.experiments.drive_log.checks.run_blocks import WRONG_RATIO, Remarks, RunBlocks, degrees
from rover_pin.experiments.drive_log.excluded_rows import JUMPS, ambiguous_steps, pose_outliers, without_poses
from rover_pin.logs.drive_log import DriveLog
from rover_pin.measurements.checks import Finding, first_names
from rover_pin.simulation.logged_inputs import MISSING_ROW_RATIO
from rover_pin.simulation.trace.channels import WHOLE, is_column, unit_of
from rover_pin.simulation.trace.trace import Trace

POSE = ("body_x", "body_y", "body_yaw")
"""Channels of the pose. Without these channels, a run cannot be compared with a simulation."""

NOTABLE_SHARE, NOTABLE_LENGTH = 0.01, 5
"""The gaps of a channel are reported if at least this fraction of the run is missing, or at least this number of
samples in sequence."""

OPTIONAL = {
    "body_z is": ("effects that show only in the sinkage cannot be found", ("body_z",)),
    "body_pitch is": ("slope and wheel loads are computed from the declared terrain alone", ("body_pitch",)),
    "body_roll is": ("different loads of the left and right wheels cannot be identified", ("body_roll",)),
    "rocker and bogie angles are": (
        "friction of rockers and bogies, backlash of the differential and a wrong terrain cannot be distinguished",
        ("rocker_l", "rocker_r", "bogie_l", "bogie_r"),
    ),
}
"""Channel that a comparison does not need -> the consequence if it is not recorded, and the names of its columns."""

MIN_STUCK_RATIO = 10.0
"""Minimum length of a stretch of equal values of a stuck sensor, as a multiple of the usual length of such stretches. A
shorter stretch counts as chance. A coarse converter repeats values too."""

MIN_ANGLE_JUMP = 0.05
"""Minimum change of an angle between two samples [rad] that counts as a jump."""

JUMP_RATIO = 12.0
"""A change of the pose between two samples counts as a jump only if it is large enough in this sense: it exceeds three
times the distance that the rover can drive meanwhile at its greatest speed, plus this multiple of the median change."""

MAX_TURN_RATE = 2.0
"""Maximum rate at which a rover turns or pitches [rad/s]. A faster change of an angle counts as a jump of the
tracker."""

MAX_LISTED_POSES = 5
"""Maximum number of outlying poses whose times a message lists."""

MAX_ANGLES = {"body_pitch": 0.5 * math.pi, "body_roll": math.pi, "rocker_": 2.0, "bogie_": 2.0, "steer_": 2.0 * math.pi}
"""Beginning of a channel name -> largest possible angle [rad]. A larger number is taken as an angle in degrees."""

MAX_VOLTS, MAX_AMPERES = 1000.0, 100.0
"""Largest possible voltage of a rover's battery and largest possible current of its motors. Larger numbers are taken as
mV and mA, and so are currents above WRONG_RATIO times the stall current."""

MAX_LATE_PERIODS = MISSING_ROW_RATIO
"""A sample counts as late if it comes more than this number of median periods after the sample before. A replay treats
the rows in such an interval as missing."""


def needed_channels(wheels: tuple[str, ...], rate_driven: bool = False) -> tuple[str, ...]:
    """Return the names of the channels without which a run cannot be compared with its simulation.

    These are the pose, the rate of each wheel and the duty of each wheel. If `rate_driven` is True, the wheel rates are
    the input of the simulation, and no duties are needed.
    """
    kinds = ("wheel_rate",) if rate_driven else ("duty", "wheel_rate")
    return (*(f"{kind}_{wheel}" for kind in kinds for wheel in wheels), *POSE)


def missing_channels(log: DriveLog) -> Iterator[Finding]:
    """Yield a finding for each needed channel that a run does not have, or that has no value in most rows of the
    run.
    """
    for run in log.runs:
        where = str(run.attrs["file"])
        unrecorded = {f"wheel_rate_{wheel}" for wheel in unrecorded_rates(log, run)}
        for name in needed_channels(log.metadata.wheels, run.rate_driven):
            # The rate of a wheel may be missing. But if an unknown column has nearly its name, the name is misspelt.
            if name in unrecorded and (name in run or not _instead(name, run).startswith("did you mean")):
                continue
            if name not in run:
                yield Finding(f"there is no column '{name}'", where, _instead(name, run))
            elif not np.isfinite(run[name]).any():
                yield Finding(f"{name} has no value", where, "record it, or leave the run out")
            elif np.mean(~np.isfinite(run[name])) > MAX_MISSING_SHARE:
                share = 100.0 * float(np.mean(~np.isfinite(run[name])))
                needed = 100 * (1 - MAX_MISSING_SHARE)
                todo = (
                    f"a run needs a value in {needed:.0f} % of its rows or more: correct the log, or leave the run out"
                )
                yield Finding(f"{name} is missing in {share:.0f} % of the rows", where, todo)


def unrecorded_rates(log: DriveLog, run: Trace) -> tuple[str, ...]:
    """Return the wheels whose rate is missing in most rows of a run, if the other wheels determine speed and turn rate.

    At least half of the wheels, with at least one on each side of the rover, must have a rate. If fewer wheels have
    one, the result is empty and `missing_channels` reports the missing rates as faults.
    """
    missing = [
        wheel
        for wheel in log.metadata.wheels
        if not np.mean(np.isfinite(run.get(f"wheel_rate_{wheel}", np.full(1, np.nan)))) >= 1.0 - MAX_MISSING_SHARE
    ]
    mounts = [mount for mount in log.load_rover().wheels if mount.name not in missing]
    sides = {mount.side for mount in log.load_rover().wheels}
    enough = 2 * len(mounts) >= len(log.metadata.wheels) and {mount.side for mount in mounts} == sides
    return tuple(missing) if enough else ()


def absurd_numbers(log: DriveLog, limit: float) -> Iterator[Finding]:
    """Yield a finding for each channel with numbers larger than `limit` or infinite: codes of a program for missing
    values.
    """
    for run in log.runs:
        for name, values in run.channels.items():
            # Infinity exceeds every limit; NaN does not, because it marks a missing value.
            wrong = np.flatnonzero(np.abs(values) > limit)
            if wrong.size:
                what = f"{name} is {values[wrong[0]]:g} at t = {run.t[wrong[0]]:.4g} s (row {wrong[0] + 1})"
                yield Finding(what, str(run.attrs["file"]), "leave cells without a measurement empty")


def _instead(name: str, run: Trace) -> str:
    """Return the remedy for a missing column: to rename an unknown column with a similar name, or to record the
    channel.
    """
    suggestion = closest(name, [column for column in run.channels if not is_column(column, ())])
    hint = suggestion.partition("?")[0] + "? rename it, or" if suggestion.startswith("did you mean") else ""
    return f"{hint} record it: duties, wheel rates and {', '.join(POSE)} are needed".strip()


def unrecorded_channels(log: DriveLog) -> Iterator[Finding]:
    """Yield a finding for each optional channel that a run lacks, with the consequence, and for each column that is not
    read.
    """
    # Rovers without a differential have no rockers, so these angles are not expected from them.
    suspended, wheels = log.load_rover().differential is not None, log.metadata.wheels
    for name, (lost, columns) in OPTIONAL.items():
        for run in log.runs if suspended or "rocker_l" not in columns else ():
            if not any(column in run and np.isfinite(run[column]).any() for column in columns):
                yield Finding(f"{name} not recorded", str(run.attrs["file"]), lost)
    for run in log.runs:
        where = str(run.attrs["file"])
        if missing := unrecorded_rates(log, run):
            mean = "each of these wheels is taken to turn at the mean rate of the other wheels on its side"
            todo = mean if run.rate_driven else "their rates are not compared"
            yield Finding(f"no wheel rate of {', '.join(missing)} is recorded", where, todo)
        for name in run.channels:
            if not is_column(name, wheels):
                # Optional channels with a misspelt name are the usual reason for an unknown column.
                names = (*WHOLE, *needed_channels(wheels), *(f"current_{wheel}_A" for wheel in wheels))
                suggestion = closest(name, names)
                known = suggestion.startswith("did you mean")
                meant = f"did you mean {suggestion.split(chr(39))[1]}? If so, rename the column" if known else ""
                yield Finding(f"column '{name}' is not read", where, meant or "no channel of a drive log has this name")


def gaps(run: RunBlocks, limit: tuple[float, int]) -> Remarks:
    """Yield the channels with gaps: at least the fraction limit[0] of a run, or at least limit[1] samples in sequence,
    is missing.
    """
    trace, t = run.trace, run.trace.t
    # Channels of one sensor have the same gaps and are reported together.
    channels_by_gap: dict[tuple[int, int, int], list[str]] = {}
    for name, values in trace.channels.items():
        missing = ~np.isfinite(values)
        first, longest = longest_run(missing)
        # A channel without any value is reported elsewhere, as not recorded.
        share = float(np.mean(missing)) if missing.size else 0.0
        if not missing.all() and (longest >= limit[1] or share >= limit[0]):
            channels_by_gap.setdefault((first, longest, int(np.sum(missing))), []).append(name)
    for (first, longest, count), names in channels_by_gap.items():
        duration = float(t[min(first + longest, len(t) - 1)] - t[first])
        verb = "is" if len(names) == 1 else "are"
        what = (
            f"{first_names(names)} {verb} missing for {duration:.3g} s from t = {t[first]:.4g} s on (row {first + 1})"
        )
        duty = "; a duty keeps its last value until the next one" if any(n.startswith("duty_") for n in names) else ""
        yield what, f"the {100 * count / len(t):.0f} % of the rows without a value are not compared{duty}"


def late_samples(run: RunBlocks, limit: float) -> Remarks:
    """Yield the number of samples that come more than `limit` median periods after the sample before, and the longest
    delay.
    """
    steps, t = np.diff(run.trace.t), run.trace.t
    late = np.flatnonzero(steps > limit * run.period)
    if late.size:
        worst = int(late[np.argmax(steps[late])])
        what = (
            f"{late.size} of {steps.size} samples come late, the latest {steps[worst]:.3g} s after t = "
            f"{t[worst]:.4g} s (row {worst + 1}), while {run.period:.3g} s is the usual time between samples"
        )
        yield what, ""


def slow_sampling(run: RunBlocks, limit: float) -> Remarks:
    """Yield a fault if the median time between two samples exceeds `limit` [s], for example because times are in
    milliseconds.
    """
    if run.period > limit:
        yield f"samples lie {run.period:.3g} s apart", ""


def ambiguous_duty_steps(run: RunBlocks, limit: int) -> Remarks:
    """Yield the number of duty steps whose instant is unknown because the rows are unevenly spaced.

    Nothing is yielded for fewer than `limit` such steps.
    """
    steps = ambiguous_steps(run.trace)
    if len(steps) >= limit:
        longest = max(steps, key=lambda step: step.end - step.begin)
        what = (
            f"rows are unevenly spaced in time, so the instants of {len(steps)} steps of the duty are unknown, by up "
            f"to {longest.end - longest.begin:.2g} s after t = {longest.begin:.4g} s"
        )
        yield what, ""


def frozen_sensors(run: RunBlocks, limit: float) -> Remarks:
    """Yield wheel rates and positions that never change although rims or rover travel farther than `limit` [m] in the
    run.
    """
    # The rims may turn although the place is constant, and the place may change although a rate is constant.
    rolled, travelled = (float(np.nansum(np.abs(speed))) * run.length for speed in (run.rim[run.moving], run.velocity))
    constant = [wheel for wheel in run.trace.wheels if _is_constant(run.finite(f"wheel_rate_{wheel}"))]
    # If all wheel rates are constant, the rover stands, unless the tracked place moves.
    for wheel in constant if len(constant) < len(run.trace.wheels) or travelled > limit else ():
        rate = run.finite(f"wheel_rate_{wheel}")[0]
        yield f"wheel_rate_{wheel} is {rate:g} rad/s all along while the rover drives", ""
    if rolled > limit and _is_constant(run.finite("body_x")) and _is_constant(run.finite("body_y")):
        yield f"body_x and body_y stand still while the rims roll {rolled:.2g} m", ""


def _is_constant(values: np.ndarray) -> bool:
    """Return whether an array has at least two values and all of its values are equal."""
    return values.size > 1 and float(np.ptp(values)) == 0.0


def stuck_channels(run: RunBlocks, limit: float) -> Remarks:
    """Yield channels that keep one value for more than `limit` seconds while other channels change.

    If the value is the largest or smallest of the channel, the sensor is probably clipped. Otherwise it is probably
    frozen.
    """
    rates = run.trace.stack("wheel_rate")
    for name, values in run.trace.channels.items():
        if not name.startswith(("wheel_rate_", "current_", "body_", "rocker_", "bogie_")):
            continue
        # A standing rover repeats all values, so a sensor is suspect only while other wheels' rates change.
        repeats = np.concatenate([[False], np.diff(values) == 0.0])
        others = [i for i, wheel in enumerate(run.trace.wheels) if name != f"wheel_rate_{wheel}"]
        changes = np.concatenate([[False], np.any(np.diff(rates[:, others], axis=0) != 0.0, axis=1)])
        # On level ground, angles and heights may rest for a while. Only a constant in the whole run is suspect.
        if name != "body_x" and name.startswith(("rocker_", "bogie_", "body_")):
            if repeats[1:].all() and len(repeats) > 1 and changes.any():
                todo = "check whether it is measured, and otherwise leave the column out"
                yield f"{name} is {values[0]:g} {unit_of(name)} all along", todo
            continue
        repeats &= (changes | ~changes.any()) & run.moving[run.block]
        begin, count = longest_run(repeats)
        value, duration = values[begin], count * run.period
        # The usual length of repeats is taken from the other values of the same channel.
        lengths = np.diff(stretches(repeats & (values != value)))
        usual = float(np.median(lengths)) if len(lengths) > 1 else 1.0
        if duration < limit or count < MIN_STUCK_RATIO * usual:
            continue
        finite = run.finite(name)
        ends = {finite.min(), finite.max()}
        place = f"for {duration:.3g} s from t = {run.trace.t[begin]:.4g} s on (row {begin + 1})"
        if value != 0.0 and value in ends and len(ends) > 1:
            what = f"{name} stays at its extreme, {value:.4g}, {place}"
            yield what, "the sensor looks clipped: widen its range, or empty these cells"
        else:
            what = f"{name} stays at {value:.4g} {place} while other channels change"
            yield what, "the sensor looks frozen: empty these cells"


def outlying_poses(run: RunBlocks, limit: int) -> Remarks:
    """Yield the times of single poses that are outliers among their neighbours. Nothing is yielded for fewer than
    `limit` poses.
    """
    rows = np.flatnonzero(pose_outliers(run.trace))
    if rows.size >= limit:
        times = ", ".join(f"{run.trace.t[row]:.4g}" for row in rows[:MAX_LISTED_POSES])
        more = f" and {rows.size - MAX_LISTED_POSES} more" if rows.size > MAX_LISTED_POSES else ""
        many = "single poses are outliers" if rows.size > 1 else "a single pose is an outlier"
        what = f"{many} among those before and after, at t = {times} s (row {rows[0] + 1}){more}"
        yield what, f"the loop leaves these {rows.size} of {len(run.trace.t)} poses out"


def jumps(run: RunBlocks, limit: float) -> Remarks:
    """Yield changes of the tracked pose that are too large for a rover, after single outlying poses have been left out.

    `limit` is the minimum change of an angle [rad] between two samples. The minimum changes of coordinates are listed
    in JUMPS.
    """
    trace = without_poses(run.trace, pose_outliers(run.trace))
    rates = np.abs(run.trace.stack("wheel_rate"))
    # The 99th percentile ignores spikes of the wheel rates.
    fastest = run.radius * float(np.nanpercentile(rates, 99)) if np.isfinite(rates).any() else 0.0
    smallest = {name: (JUMPS[name], fastest) for name in ("body_x", "body_y", "body_z")}
    smallest |= {name: (limit, MAX_TURN_RATE) for name in ("body_roll", "body_pitch", "body_yaw")}
    for name, (min_step, speed) in smallest.items():
        if name not in trace:
            continue
        rows = np.flatnonzero(np.isfinite(trace[name]))
        t, steps = trace.t[rows], np.diff(trace[name][rows])
        if not steps.size:
            continue
        if name in ("body_yaw", "body_roll"):  # from 180 deg to -180 deg is no step
            steps = (steps + np.pi) % (2.0 * np.pi) - np.pi
        # The rover may move at three times its greatest speed, and usual steps are noise.
        excess = np.abs(steps) - 3.0 * speed * np.diff(t) - JUMP_RATIO * float(np.median(np.abs(steps)))
        rows_of_jumps = np.flatnonzero(excess > min_step)
        if rows_of_jumps.size:
            worst = int(rows_of_jumps[np.argmax(np.abs(steps[rows_of_jumps]))])
            length = abs(float(steps[worst]))
            size = degrees(length) if name in ("body_roll", "body_pitch", "body_yaw") else f"{1e3 * length:.3g} mm"
            count = f"{rows_of_jumps.size} jump{'s' * (rows_of_jumps.size > 1)} in the run"
            where = f"at t = {t[worst + 1]:.4g} s (row {rows[worst + 1] + 1}); {count}"
            yield f"{name} jumps by {size} {where}", ""


def spikes(run: RunBlocks, limit: float) -> Remarks:
    """Yield wheel rates with single values larger than `limit` times the 99th percentile of that wheel's rate."""
    for name in (f"wheel_rate_{wheel}" for wheel in run.trace.wheels if f"wheel_rate_{wheel}" in run.trace):
        # The 99th percentile is the usual largest rate, which single spikes do not change.
        rate, finite_rates = np.abs(run.trace[name]), np.abs(run.finite(name))
        usual = float(np.percentile(finite_rates, 99)) if finite_rates.size else 0.0
        high = np.flatnonzero(rate > limit * usual)
        if high.size and usual > 0.0:
            what = f"{name} spikes to {rate[high[0]]:.3g} rad/s at t = {run.trace.t[high[0]]:.4g} s (row {high[0] + 1})"
            yield what, f"its usual rate is up to {usual:.3g} rad/s: empty these {high.size} cells"


def angles_in_degrees(run: RunBlocks, limit: dict[str, float]) -> Remarks:
    """Yield the angles that are larger than physically possible and are therefore probably in degrees.

    `limit` maps the beginning of a channel name to the largest possible angle [rad].
    """
    for name, values in run.trace.channels.items():
        # The message names the row with the largest angle.
        largest = next((angle for start, angle in limit.items() if name.startswith(start)), math.inf)
        if np.max(np.abs(run.finite(name)), initial=0.0) > largest:
            row = int(np.nanargmax(np.abs(values)))
            yield f"{name} reaches {abs(values[row]):.3g} rad at t = {run.trace.t[row]:.4g} s (row {row + 1})", ""


def thousandths(run: RunBlocks, limit: tuple[float, float]) -> Remarks:
    """Yield voltages and currents that are probably in mV or mA, because their median exceeds `limit` = (volts,
    amperes).

    If the motor is declared, currents above WRONG_RATIO times its stall current are yielded too.
    """
    # A current cannot exceed the stall current by much, so a declared motor gives the tighter limit.
    motor = run.declared.motor
    stall = math.inf if motor is None else float(motor.supply / motor.resistance)
    limits = {"battery_V": (limit[0], "V"), "current_": (min(limit[1], WRONG_RATIO * stall), "A")}
    for name in run.trace.channels:
        largest, unit = next((limits[start] for start in limits if name.startswith(start)), (math.inf, ""))
        magnitudes = np.abs(run.finite(name))
        if np.any(magnitudes > largest) and (middle := float(np.median(magnitudes[magnitudes > 0.0]))) > largest:
            yield (
                f"{name} is {middle:.3g} {unit} in the median",
                f"if the channel is in m{unit}, divide the channel by 1000",
            )


def stretches(flags: np.ndarray) -> np.ndarray:
    """Return the stretches of True in a mask (rows,), each as (first row, row after the last one), in an array
    (stretches, 2).
    """
    return np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int))).reshape(-1, 2)


def longest_run(flags: np.ndarray) -> tuple[int, int]:
    """Return (first row, number of rows) of the longest stretch of True in a mask (rows,); (0, 0) if the mask is False
    everywhere.
    """
    # Of several stretches of equal length, the first one counts.
    begin, end = max(stretches(flags).tolist(), key=lambda ends: ends[1] - ends[0], default=(0, 0))
    return begin, end - begin
