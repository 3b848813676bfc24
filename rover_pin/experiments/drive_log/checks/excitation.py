"""Check whether the runs of a drive log contain enough manoeuvres to distinguish effects, and name the run to add.

The tables DUTY_DRIVEN, RATE_DRIVEN and OF_RUNS have one row for each channel or manoeuvre. If a log lacks this channel
or manoeuvre, the effects named in the row have equal influence on all measured channels. The rows come from trials with
a lumped six-wheel rover; 15 effects were hidden in turn.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.experiments.drive_log.checks.run_blocks import RunBlocks, degrees, spread
from rover_pin.experiments.drive_log.excluded_rows import SAME_DUTY
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_set import SAME_SLIP

MAX_LOW_DUTY = 0.15
"""If the smallest duty in a log is at most this value, the runs show the duty at which motion begins."""

OPPOSITE_ANGLE = np.radians(120.0)
"""Minimum angle between two directions of travel [rad] that count as opposite."""

MIN_PAUSE = 5.0
"""Minimum duration of a stop [s] that counts as a pause: a motor cools measurably in this time."""

MIN_DUTY_DIFFERENCE = 0.05
"""Minimum difference between two different duties of two wheels [-]. Duties with a smaller difference count as
equal."""

MIN_TIME_FRACTION = 0.1
"""Minimum fraction of the driven time that a manoeuvre must take, if the log is to count as containing it."""

MIN_RUNS, MIN_TIME = 2, 20.0
"""Minimum number of runs, and minimum driven time [s], of a log. For a smaller log, the search for missing effects
gives no answer. One run is held out; 20 s are 40 half-second blocks for about 20 uncertain numbers."""


def excitation_findings(runs: Sequence[RunBlocks], where: str) -> Iterator[Finding]:
    """Yield a finding for each missing channel or manoeuvre: the effects that cannot be distinguished without it, and
    the run to add.

    `where` is the name of the log, which is printed with each finding.
    """
    # Without duties, other manoeuvres matter, and motors cannot be identified at all.
    rate_driven = any(run.trace.rate_driven for run in runs)
    missing = [*_missing(RATE_DRIVEN if rate_driven else DUTY_DRIVEN, runs)]
    if not rate_driven:
        # Currents and the supply voltage distinguish the effects in the motors.
        currents = _missing_columns(
            runs, lambda run: [f"current_{wheel}_A" for wheel in run.trace.wheels], "motor currents are"
        )
        if currents:
            what = (
                f"{currents} not recorded, so friction of the gear and dead band, a weak motor and its "
                "tachometer's scale cannot be distinguished, and viscous friction is hidden"
            )
            missing.append((what, "record current_WHEEL_A"))
        supply = _missing_columns(runs, lambda run: ["battery_V"], "battery_V is")
        if supply:
            what = f"{supply} not recorded, so sag and run-down of the supply show in the wheel rates only"
            missing.append((what, "record it"))
    for what, todo in (*missing, *_missing(OF_RUNS, runs)):
        yield Finding(what, where, todo)


def too_poor(runs: Sequence[RunBlocks]) -> str:
    """Return why the runs cannot show a missing effect, with the remedy; an empty text if they can show one.

    Possible reasons are fewer than MIN_RUNS runs, less than MIN_TIME of driving, or no variation in duty, slope and
    slip.
    """
    if len(runs) < MIN_RUNS:
        return f"there is only {len(runs)} run, so no run can be held out; add two or more runs of 40 s each."
    driven = sum(run.moving_time for run in runs)
    if driven < MIN_TIME:
        return (
            f"the wheels turn for only {driven:.3g} s in all runs together; drive for {MIN_TIME:.0f} s at least, best "
            "in 6 runs of 40 s."
        )
    # Variation of at least one of the three is enough.
    if len(levels(runs)) < 2 and pitch_range(runs) < np.radians(2.0) and slip_range(runs) < 0.5 * SAME_SLIP:
        return (
            "all runs have one duty, no slope and no change of slip, so every effect looks like a change of soil or "
            "motor; change the duty every 2.5 to 5 s, between 0.4 and 0.85, and drive slopes of up to 8 deg up and "
            "down."
        )
    return ""


def levels(runs: Sequence[RunBlocks]) -> np.ndarray:
    """Return the distinct duties at which the wheels are driven (n,), rounded to multiples of SAME_DUTY.

    A duty that occurs in fewer than 1 % of the samples does not count. In a log without duties, the wheel rates are
    used instead, as fractions of the fastest rate.
    """
    # Only rows with a turning wheel count; a duty at standstill says nothing.
    driven_duties = [
        duty[run.moving[run.block]]
        for run in runs
        for duty in (run.duty[run.block] if run.trace.rate_driven else run.trace.stack("duty")).T
    ]
    duties = np.concatenate(driven_duties) if driven_duties else np.zeros(0)
    duties = duties[np.isfinite(duties)]
    grid, count = np.unique(np.round(duties / SAME_DUTY), return_counts=True)
    grid = grid[count > 0.01 * max(duties.size, 1)]
    # Neighbouring grid points are one level that noise distributes over both.
    distinct_levels: list[float] = []
    for level in grid:
        distinct_levels += [level] if not distinct_levels or level - distinct_levels[-1] > 1.5 else []
    return SAME_DUTY * np.array(distinct_levels)


def slip_range(runs: Sequence[RunBlocks]) -> float:
    """Return the range of the slip ratio while the rover drives steadily in all runs, from the 5th to the 95th
    percentile.
    """
    return spread(np.concatenate([run.slip for run in runs])) if runs else 0.0


def pitch_range(runs: Sequence[RunBlocks]) -> float:
    """Return the range of the pitch while the wheels turn in all runs [rad], from the 5th to the 95th percentile.

    If a run has no pitch, the climb angle of the tracked place is used instead.
    """

    # The pitch is measured directly; the climb angle of the tracked height is the second choice.
    def inclination(run: RunBlocks) -> np.ndarray:
        if "body_pitch" in run.trace:
            return run.mean(run.trace["body_pitch"])
        if "body_z" not in run.trace:
            return np.full(run.moving.shape, np.nan)
        return np.arctan2(run.slope(run.trace["body_z"]), np.maximum(np.abs(run.velocity), 1e-3))

    return spread(np.concatenate([inclination(run)[run.moving] for run in runs])) if runs else 0.0


def has_low_duty(runs: Sequence[RunBlocks]) -> bool:
    """Return whether the wheels are driven at a duty of at most MAX_LOW_DUTY other than zero."""
    # Duty 0 is no low duty: the motor then brakes.
    duties = np.abs(levels(runs))
    driving = duties[duties > 0.5 * SAME_DUTY]
    return bool(driving.size and driving.min() <= MAX_LOW_DUTY)


def opposite_fraction(runs: Sequence[RunBlocks]) -> float:
    """Return the fraction of the steadily driven time of travel away from the mean direction of travel.

    A direction counts if its angle to the mean direction is larger than half of OPPOSITE_ANGLE. If all runs go in one
    direction, the fraction is 0.
    """
    velocities = [run.velocity[run.steady & (np.abs(run.velocity) > 0.1 * np.abs(run.rim))] for run in runs]
    travel = np.concatenate(velocities) if velocities else np.zeros(0, dtype=complex)
    if not travel.size:
        return 0.0
    return float(np.mean(np.abs(np.angle(travel * np.conj(travel.mean()))) > 0.5 * OPPOSITE_ANGLE))


def has_pause(run: RunBlocks) -> bool:
    """Return whether the rover stops for at least MIN_PAUSE between two drives of the run."""
    # The number of still blocks between two moving ones, times the duration of a block.
    moving = np.flatnonzero(run.moving)
    return bool(np.any(np.diff(moving) - 1 >= MIN_PAUSE / run.length)) if moving.size else False


def has_reversal(run: RunBlocks) -> bool:
    """Return whether the duties of the run are positive at some times and negative at others."""
    signs = np.sign(run.duty)
    return bool(np.nanmin(signs, initial=1) < 0 < np.nanmax(signs, initial=-1))


def different_duty_fraction(runs: Sequence[RunBlocks]) -> float:
    """Return the fraction of the steadily driven time with duties of the wheels that differ by more than
    MIN_DUTY_DIFFERENCE.
    """
    ranges = np.concatenate([np.ptp(run.duty[run.steady], axis=1) for run in runs])
    return float(np.mean(ranges > MIN_DUTY_DIFFERENCE)) if ranges.size else 0.0


def are_replicates(a: RunBlocks, b: RunBlocks) -> bool:
    """Return whether one run repeats the other: both have equal duties and start in one direction."""
    # The shorter run must have at least 80 % of the length of the other one.
    rows = min(len(a.duty), len(b.duty))
    if rows < 0.8 * max(len(a.duty), len(b.duty)) or a.trace.wheels != b.trace.wheels or not rows:
        return False
    difference = np.abs(a.duty[:rows] - b.duty[:rows])
    angle = abs(float(np.angle(a.heading[0] * np.conj(b.heading[0]))))
    return bool(np.mean(difference[np.isfinite(difference)] < SAME_DUTY) > 1.0 - MIN_TIME_FRACTION) and angle < 0.5


def _missing_columns(runs: Sequence[RunBlocks], columns: Callable[[RunBlocks], list[str]], if_all: str) -> str:
    """Return the beginning of a sentence on missing columns, such as "current_fl_A of a.csv is"; empty if no column is
    missing.

    If all `columns` are missing in all runs, the beginning of the sentence is `if_all`.
    """
    missing = [
        (name, str(run.trace.attrs.get("file"))) for run in runs for name in columns(run) if name not in run.trace
    ]
    if not missing or len(missing) == sum(len(columns(run)) for run in runs):
        return if_all if missing else ""
    names, files = (", ".join(dict.fromkeys(column)) for column in zip(*missing, strict=True))
    return f"{names} of {files} {'is' if len(missing) == 1 else 'are'}"


class ExcitationCheck(NamedTuple):
    """A check whether the runs of a log contain a manoeuvre, by a statistic of all runs and the minimum of this
    statistic.

    If the statistic is below the minimum, the report states which effects cannot be distinguished (`consequence`) and
    which run to add (`remedy`).
    """

    statistic: Callable[[Sequence[RunBlocks]], float]
    minimum: float
    consequence: str
    """text with the placeholders {value} for the statistic, {degrees} for the statistic as an angle, and {s} for the
    plural ending"""
    remedy: str


OF_MOTION = (
    ExcitationCheck(slip_range, SAME_SLIP,
         "slips span {value:.2f} only, so effects that depend on slip look like other constants of the soil",
         "add a run up a slope that grows until the wheels slip by 0.3 or more"),
    ExcitationCheck(pitch_range, np.radians(5.0),
         "slopes span {degrees} only, so multi-pass, a shifted centre of mass and effects of the load cannot be "
         "distinguished",
         "add runs up and down a slope of about 8 deg, or repeat one with 1 kg more"),
    ExcitationCheck(opposite_fraction, 0.5 * MIN_TIME_FRACTION,
         "all runs go in one direction, so a wrong slope, the drag of a tether and rolling resistance cannot be "
         "distinguished",
         "repeat a run in the opposite direction"),
)  # fmt: skip
DUTY_DRIVEN = (
    ExcitationCheck(lambda runs: levels(runs).size, 3,
         "the duty has {value} level{s}, so friction of the gear, rolling resistance, supply and strength of the "
         "motors cannot be distinguished", "add a run with duties of 0.4 to 0.85, each held for 2.5 to 5 s"),
    ExcitationCheck(has_low_duty, 1,
         "no low duty, so friction of the gear and a dead band of the driver cannot be distinguished",
         "add a run whose duty falls in steps to 0.06, or record such steps with lifted wheels"),
    *OF_MOTION,
    ExcitationCheck(lambda runs: any(map(has_pause, runs)), 1,
         "no stop between two drives, so heating of the windings, sag of the supply and digging cannot be "
         "distinguished", "add a run that drives, pauses for a minute and drives on"),
    ExcitationCheck(lambda runs: any(map(has_reversal, runs)), 1,
         "no reversal, so multi-pass, tachometer scales and the wheel's radius cannot be distinguished",
         "add a run that drives back in its own ruts"),
    ExcitationCheck(different_duty_fraction, MIN_TIME_FRACTION,
         "all wheels get one duty, so one weak motor, a tachometer's scale and uneven loads cannot be distinguished",
         "add a run in which the wheels' duties differ by up to 0.1"),
)  # fmt: skip
"""Checks of a log with duties, whose simulations take the duties as their input."""
RATE_DRIVEN = (
    ExcitationCheck(lambda runs: 0, 1,
         "no duty is recorded, so the wheels are held to their measured rates: effects in the motors and gears "
         "(friction, weak motors, sag, heating, a dead band) do not show",
         "record duty_WHEEL, or current_WHEEL_A, if that matters"),
    ExcitationCheck(lambda runs: any("body_pitch" in run.trace or "body_z" in run.trace for run in runs), 1,
         "neither pitch nor height is recorded, so slip cannot be distinguished from an unknown slope",
         "record body_pitch or body_z, or declare the terrain"),
    *OF_MOTION,
)  # fmt: skip
"""Checks of a log without duties, whose simulations take the measured wheel rates as their input."""
OF_RUNS = (
    ExcitationCheck(len, 3, "{value} run{s}: results of so few held-out runs mean little",
         "add runs: best are 6 runs to fit and 3 to hold out"),
    ExcitationCheck(lambda runs: any(are_replicates(a, b) for i, a in enumerate(runs) for b in runs[:i]), 1,
         "no run is repeated, so a scatter from run to run and an error of the model cannot be distinguished",
         "repeat a run with the same commands on freshly raked soil"),
)  # fmt: skip
"""Checks of the number of runs and of repeated runs, for every log."""


def _missing(table: Sequence[ExcitationCheck], runs: Sequence[RunBlocks]) -> Iterator[tuple[str, str]]:
    """Yield the pair (consequence, remedy) of each check whose statistic is below its minimum in the runs of a log.

    The statistic of such a check is below the minimum.
    """
    for check in table:
        value = check.statistic(runs)
        if value < check.minimum:
            text = check.consequence.format(value=value, degrees=degrees(value), s="s" * (value != 1))
            yield text, check.remedy
