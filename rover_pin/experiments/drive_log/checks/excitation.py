"""Whether the runs of a drive log excite enough to tell effects apart, and which run to add where not.

Which effects look alike without what is measured in trials: a lumped six-wheel rover, 15 effects hidden in turn.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from rover_pin.experiments.drive_log.checks.driven import Driven, degrees, spread
from rover_pin.measurements.finding import Finding
from rover_pin.measurements.wheel_rig import SAME_SLIP

SAME_DUTY = 0.02
"""Duties that differ by less are one level."""

FEWEST_DUTIES = 3
"""Levels of duty with which a friction can be distinguished from a gain."""

LOW_DUTY = 0.15
"""A drive's lowest duty that still tells where motion begins."""

LEAST_SLOPE = np.radians(5.0)
"""Pitches that span less shift no load to speak of between the axles."""

APART = np.radians(120.0)
"""Directions of travel this far apart count as opposite."""

PAUSE = 5.0
"""A stop that lets a motor cool visibly [s]."""

UNLIKE = 0.05
"""Duties of the wheels that differ by less drive them alike."""

SHARE = 0.1
"""Share of the driven time that something must take up."""

LEAST_RUNS, LEAST_TIME = 2, 20.0
"""Runs, and driven time [s] in all, below which a log is too poor."""

HELD_OUT = 3
"""Runs from which some can be held out and others still compared."""


def excitation_findings(runs: Sequence[Driven], where: str) -> Iterator[Finding]:
    """Yield, for each missing excitation, the effects that cannot be distinguished without it and the run to add."""
    rate_driven = any(run.rate_driven for run in runs)
    checks = (_rates, _slips, _slopes, _headings, _runs) if rate_driven else CHECKS
    for check in checks:
        for what, todo in check(runs):
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
    return run.duty[run.block] if run.rate_driven else run.trace.stack("duty")


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


def _duties(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    duties = np.abs(levels(runs))
    if duties.size < FEWEST_DUTIES:
        yield (
            f"the duty has {duties.size} level{'s' * (duties.size != 1)}, so friction of the gear, rolling resistance, "
            "supply and strength of the motors look alike",
            "add a run with duties of 0.4 to 0.85, each held for 2.5 to 5 s",
        )
    driving = duties[duties > 0.5 * SAME_DUTY]
    if not driving.size or driving.min() > LOW_DUTY:
        yield (
            "no low duty, so friction of the gear and a dead band of the driver look alike",
            "add a staircase of duty down to 0.06, or lift the wheels and record one",
        )


def _rates(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    yield (
        "no duty is recorded, so the wheels are held to their measured rates: what acts in the motors and gears "
        "(friction, weak motors, sag, heating, a dead band) does not show",
        "record duty_WHEEL, or current_WHEEL_A, if that matters",
    )
    if not any("body_pitch" in run.trace or "body_z" in run.trace for run in runs):
        yield (
            "neither pitch nor height is recorded, so slip cannot be distinguished from an unknown slope",
            "record body_pitch or body_z, or declare the terrain",
        )


def _slips(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    span = slip_range(runs)
    if span < SAME_SLIP:
        yield (
            f"slips span {span:.2f} only, so what depends on slip cannot be distinguished from the soil's constants",
            "add a run up a slope that grows until the wheels slip by 0.3 or more",
        )


def _slopes(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    span = pitch_range(runs)
    if span < LEAST_SLOPE:
        yield (
            f"slopes span {degrees(span)} only, so multi-pass, a shifted centre of mass and effects of the load look "
            "alike",
            "add runs up and down a slope of about 8 deg, or repeat one with 1 kg more",
        )


def _headings(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    velocities = [run.velocity[run.steady & (np.abs(run.velocity) > 0.1 * np.abs(run.rim))] for run in runs]
    ways = np.concatenate(velocities) if velocities else np.zeros(0, dtype=complex)
    turned = np.abs(np.angle(ways * np.conj(ways.mean()))) if ways.size else np.zeros(0)
    if np.mean(turned > 0.5 * APART) < 0.5 * SHARE if turned.size else True:
        yield (
            "all runs go one way, so a wrong slope, the drag of a tether and rolling resistance look alike",
            "repeat a run in the opposite direction",
        )


def _stops(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    if not any(_pauses(run) for run in runs):
        yield (
            "no stop between two drives, so heating of the windings, sag of the supply and digging look alike",
            "add a run that drives, pauses for a minute and drives on",
        )
    if not any(np.nanmin(np.sign(run.duty), initial=1) < 0 < np.nanmax(np.sign(run.duty), initial=-1) for run in runs):
        yield (
            "no reversal, so multi-pass, tachometer scales and the wheel's radius look alike",
            "add a run that drives back in its own ruts",
        )


def _pauses(run: Driven) -> bool:
    moving = np.flatnonzero(run.moving)
    return bool(np.any(np.diff(moving) - 1 >= PAUSE / run.length)) if moving.size else False


def _wheels(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    gaps = np.concatenate([np.ptp(run.duty[run.steady], axis=1) for run in runs])
    if not gaps.size or np.mean(gaps > UNLIKE) < SHARE:
        yield (
            "all wheels get one duty, so one weak motor, a tachometer's scale and uneven loads look alike",
            "add a run in which the wheels' duties differ by up to 0.1",
        )


def _electric(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    currents = _lacking(runs, lambda run: [f"current_{wheel}_A" for wheel in run.wheels], "motor currents are")
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


def _runs(runs: Sequence[Driven]) -> Iterator[tuple[str, str]]:
    if len(runs) < HELD_OUT:
        many = f"{len(runs)} run{'s' * (len(runs) != 1)}"
        yield f"{many}: results of so few held-out runs mean little", "add runs, best 6 and 3 to hold out"
    if not any(_replicates(a, b) for i, a in enumerate(runs) for b in runs[:i]):
        yield (
            "no run is repeated, so what scatters and what the model cannot describe look alike",
            "repeat a run with the same commands on freshly raked soil",
        )


CHECKS = (_duties, _slips, _slopes, _headings, _stops, _wheels, _electric, _runs)


def _replicates(a: Driven, b: Driven) -> bool:
    """Whether two runs have the same duties and start in the same direction."""
    rows = min(len(a.duty), len(b.duty))
    if rows < 0.8 * max(len(a.duty), len(b.duty)) or a.wheels != b.wheels or not rows:
        return False
    duty_gap = np.abs(a.duty[:rows] - b.duty[:rows])
    turned = abs(float(np.angle(a.heading[0] * np.conj(b.heading[0]))))
    return bool(np.mean(duty_gap[np.isfinite(duty_gap)] < SAME_DUTY) > 1.0 - SHARE) and turned < 0.5
