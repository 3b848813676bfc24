"""Whether the runs of a drive log excite enough to tell effects apart, and which run to add where not.

Which effects look alike without what is measured in trials: a lumped six-wheel rover, 15 effects hidden in turn.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.experiments.drive_log.checks.driven import Driven, degrees, spread
from rover_pin.experiments.drive_log.readings.ambiguous_timing import SAME_DUTY
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.rig_set import SAME_SLIP

LOW_DUTY = 0.15
"""A drive's lowest duty that still tells where motion begins."""

APART = np.radians(120.0)
"""Directions of travel this far apart count as opposite."""

PAUSE = 5.0
"""A stop that lets a motor cool visibly [s]."""

UNLIKE = 0.05
"""Duties of the wheels that differ by less drive them alike."""

SHARE = 0.1
"""Share of the driven time that something must take up."""

LEAST_RUNS, LEAST_TIME = 2, 20.0
"""Runs, and driven time [s], that a log has at least. Why: one is left out; 20 s are 40 blocks for some 20 numbers."""


def excitation_findings(runs: Sequence[Driven], where: str) -> Iterator[Finding]:
    """Yield, for each missing excitation, the effects that cannot be distinguished without it and the run to add."""
    rate_driven = any(run.trace.rate_driven for run in runs)
    lacks = [*_lacks(RATE_DRIVEN, runs)] if rate_driven else [*_lacks(DUTY_DRIVEN, runs), *_electric(runs)]
    for what, todo in (*lacks, *_lacks(OF_RUNS, runs)):
        yield Finding(what, where, todo)


def too_poor(runs: Sequence[Driven]) -> str:
    """Return why the log can answer nothing and what would, or an empty string."""
    if len(runs) < LEAST_RUNS:
        return f"{len(runs)} run: none can be held out; add two or more, each of 40 s."
    driven = sum(run.moving_time for run in runs)
    if driven < LEAST_TIME:
        return f"the wheels turn for {driven:.3g} s in all; drive for {LEAST_TIME:.0f} s at least, best 6 runs of 40 s."
    if len(levels(runs)) < 2 and pitch_range(runs) < np.radians(2.0) and slip_range(runs) < 0.5 * SAME_SLIP:
        return (
            "one duty, no slope and no change of slip: every effect looks like a change of soil or motor; vary the "
            "duty in 0.4 to 0.85 every 2.5 to 5 s, and drive slopes of up to 8 deg both ways."
        )
    return ""


def levels(runs: Sequence[Driven]) -> np.ndarray:
    """Return duties of the driven time that lie a level apart, those of one sample in a hundred left out."""
    driven_duties = [duty[run.moving[run.block]] for run in runs for duty in _commands(run).T]
    duties = np.concatenate(driven_duties) if driven_duties else np.zeros(0)
    duties = duties[np.isfinite(duties)]
    grid, count = np.unique(np.round(duties / SAME_DUTY), return_counts=True)
    grid = grid[count > 0.01 * max(duties.size, 1)]
    distinct_levels: list[float] = []
    for level in grid:
        distinct_levels += [level] if not distinct_levels or level - distinct_levels[-1] > 1.5 else []
    return SAME_DUTY * np.array(distinct_levels)


def _commands(run: Driven) -> np.ndarray:
    """Return the duties, or the rates that are the input as shares of the fastest (T, wheels)."""
    return run.duty[run.block] if run.trace.rate_driven else run.trace.stack("duty")


def slip_range(runs: Sequence[Driven]) -> float:
    """Return the range of slip that the runs reach."""
    return spread(np.concatenate([run.slip for run in runs])) if runs else 0.0


def pitch_range(runs: Sequence[Driven]) -> float:
    """Return the range of pitch [rad] of the driven time; of the tracked climb where no pitch is recorded."""
    return spread(np.concatenate([_inclination(run)[run.moving] for run in runs])) if runs else 0.0


def _inclination(run: Driven) -> np.ndarray:
    if "body_pitch" in run.trace:
        return run.mean(run.trace["body_pitch"])
    if "body_z" not in run.trace:
        return np.full(run.moving.shape, np.nan)
    return np.arctan2(run.slope(run.trace["body_z"]), np.maximum(np.abs(run.velocity), 1e-3))


def _reaches_low_duty(runs: Sequence[Driven]) -> bool:
    duties = np.abs(levels(runs))
    driving = duties[duties > 0.5 * SAME_DUTY]
    return bool(driving.size and driving.min() <= LOW_DUTY)


def _opposite_share(runs: Sequence[Driven]) -> float:
    """Return the share of the steady travel that is far off the mean direction."""
    velocities = [run.velocity[run.steady & (np.abs(run.velocity) > 0.1 * np.abs(run.rim))] for run in runs]
    ways = np.concatenate(velocities) if velocities else np.zeros(0, dtype=complex)
    return float(np.mean(np.abs(np.angle(ways * np.conj(ways.mean()))) > 0.5 * APART)) if ways.size else 0.0


def _reverses(run: Driven) -> bool:
    signs = np.sign(run.duty)
    return bool(np.nanmin(signs, initial=1) < 0 < np.nanmax(signs, initial=-1))


def _pauses(run: Driven) -> bool:
    moving = np.flatnonzero(run.moving)
    return bool(np.any(np.diff(moving) - 1 >= PAUSE / run.length)) if moving.size else False


def _unlike_share(runs: Sequence[Driven]) -> float:
    """Return the share of the steady time in which the wheels get different duties."""
    gaps = np.concatenate([np.ptp(run.duty[run.steady], axis=1) for run in runs])
    return float(np.mean(gaps > UNLIKE)) if gaps.size else 0.0


def _electric(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    currents = _lacking(runs, lambda run: [f"current_{wheel}_A" for wheel in run.trace.wheels], "motor currents are")
    if currents:
        yield (
            f"{currents} not recorded, so friction of the gear and dead band, a weak motor and its "
            "tachometer's scale look alike, and viscous friction is hidden",
            "record current_WHEEL_A",
        )
    supply = _lacking(runs, lambda run: ["battery_V"], "battery_V is")
    if supply:
        yield f"{supply} not recorded, so sag and run-down of the supply show in the wheel rates only", "record it"


def _lacking(runs: Sequence[Driven], wanted: Callable[[Driven], list[str]], all_of_them: str) -> str:
    """Return what of the wanted columns is missing, with its verb: `all_of_them`, those of some runs, or nothing."""
    missing = [
        (name, str(run.trace.attrs.get("file"))) for run in runs for name in wanted(run) if name not in run.trace
    ]
    if not missing or len(missing) == sum(len(wanted(run)) for run in runs):
        return all_of_them if missing else ""
    names, files = (", ".join(dict.fromkeys(pair[at] for pair in missing)) for at in (0, 1))
    return f"{names} of {files} {'is' if len(missing) == 1 else 'are'}"


def _replicates(a: Driven, b: Driven) -> bool:
    """Whether two runs have the same duties and start in the same direction."""
    rows = min(len(a.duty), len(b.duty))
    if rows < 0.8 * max(len(a.duty), len(b.duty)) or a.trace.wheels != b.trace.wheels or not rows:
        return False
    duty_gap = np.abs(a.duty[:rows] - b.duty[:rows])
    turned = abs(float(np.angle(a.heading[0] * np.conj(b.heading[0]))))
    return bool(np.mean(duty_gap[np.isfinite(duty_gap)] < SAME_DUTY) > 1.0 - SHARE) and turned < 0.5


class Lack(NamedTuple):
    """What runs may lack: a statistic that is below its least value, what then looks alike, and the run to add."""

    statistic: Callable[[Sequence[Driven]], float]
    least: float
    what: str
    "with the statistic as {value}, in {degrees}, and {s} behind what is more than one"
    todo: str


OF_MOTION = (
    Lack(slip_range, SAME_SLIP,
         "slips span {value:.2f} only, so what depends on slip cannot be distinguished from the soil's constants",
         "add a run up a slope that grows until the wheels slip by 0.3 or more"),
    Lack(pitch_range, np.radians(5.0),
         "slopes span {degrees} only, so multi-pass, a shifted centre of mass and effects of the load look alike",
         "add runs up and down a slope of about 8 deg, or repeat one with 1 kg more"),
    Lack(_opposite_share, 0.5 * SHARE,
         "all runs go one way, so a wrong slope, the drag of a tether and rolling resistance look alike",
         "repeat a run in the opposite direction"),
)  # fmt: skip
DUTY_DRIVEN = (
    Lack(lambda runs: levels(runs).size, 3,
         "the duty has {value} level{s}, so friction of the gear, rolling resistance, supply and strength of the "
         "motors look alike", "add a run with duties of 0.4 to 0.85, each held for 2.5 to 5 s"),
    Lack(_reaches_low_duty, 1, "no low duty, so friction of the gear and a dead band of the driver look alike",
         "add a staircase of duty down to 0.06, or lift the wheels and record one"),
    *OF_MOTION,
    Lack(lambda runs: any(map(_pauses, runs)), 1,
         "no stop between two drives, so heating of the windings, sag of the supply and digging look alike",
         "add a run that drives, pauses for a minute and drives on"),
    Lack(lambda runs: any(map(_reverses, runs)), 1,
         "no reversal, so multi-pass, tachometer scales and the wheel's radius look alike",
         "add a run that drives back in its own ruts"),
    Lack(_unlike_share, SHARE,
         "all wheels get one duty, so one weak motor, a tachometer's scale and uneven loads look alike",
         "add a run in which the wheels' duties differ by up to 0.1"),
)  # fmt: skip
RATE_DRIVEN = (
    Lack(lambda runs: 0, 1,
         "no duty is recorded, so the wheels are held to their measured rates: what acts in the motors and gears "
         "(friction, weak motors, sag, heating, a dead band) does not show",
         "record duty_WHEEL, or current_WHEEL_A, if that matters"),
    Lack(lambda runs: any("body_pitch" in run.trace or "body_z" in run.trace for run in runs), 1,
         "neither pitch nor height is recorded, so slip cannot be distinguished from an unknown slope",
         "record body_pitch or body_z, or declare the terrain"),
    *OF_MOTION,
)  # fmt: skip
OF_RUNS = (
    Lack(len, 3, "{value} run{s}: results of so few held-out runs mean little", "add runs, best 6 and 3 to hold out"),
    Lack(lambda runs: any(_replicates(a, b) for i, a in enumerate(runs) for b in runs[:i]), 1,
         "no run is repeated, so what scatters and what the model cannot describe look alike",
         "repeat a run with the same commands on freshly raked soil"),
)  # fmt: skip


def _lacks(table: Sequence[Lack], runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    for lack in table:
        value = lack.statistic(runs)
        if value < lack.least:
            yield lack.what.format(value=value, degrees=degrees(value), s="s" * (value != 1)), lack.todo
