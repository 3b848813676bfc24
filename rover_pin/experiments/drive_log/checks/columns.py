"""Which channels a drive log has, which it lacks, and where they have gaps."""

from collections.abc import Iterator

import numpy as np

from rover_pin.base.errors import closest
from rover_pin.estimation.profile import MOST
from rover_pin.experiments.drive_log.checks.driven import Driven, Remarks
from rover_pin.experiments.drive_log.readings.ambiguous_timing import ambiguous_steps
from rover_pin.logs.drive_log import DriveLog
from rover_pin.measurements.checks import Finding, first_names
from rover_pin.simulation.logged_inputs import MISSED
from rover_pin.simulation.trace.channels import WHOLE, is_column
from rover_pin.simulation.trace.trace import Trace

POSE = ("body_x", "body_y", "body_yaw")
"""What of the pose a comparison cannot do without."""

ABSURD = 1e12
"""No channel holds a number beyond this; codes for "no value" do. Why: no quantity of a rover is near it."""

NOTABLE_SHARE, NOTABLE_RUN = 0.01, 5
"""Gaps are named from this share of a run, or from this many samples in a row."""

OPTIONAL = {
    "body_z": ("effects that only the sinkage shows stay hidden", ("body_z",)),
    "body_pitch": ("the slope and the loads follow from the declared terrain alone", ("body_pitch",)),
    "body_roll": ("loads that differ between left and right are not identifiable", ("body_roll",)),
    "rocker and bogie angles": (
        "friction of the pivots, backlash of the differential and a wrong terrain cannot be distinguished",
        ("rocker_l", "rocker_r", "bogie_l", "bogie_r"),
    ),
}
"""Channels that a comparison can do without: name -> (what is then unknown, the columns)."""


def needed_channels(wheels: tuple[str, ...], rate_driven: bool = False) -> tuple[str, ...]:
    """Return the channels that a comparison with a simulated drive needs; without duties where rates are the input."""
    kinds = ("wheel_rate",) if rate_driven else ("duty", "wheel_rate")
    return (*(f"{kind}_{wheel}" for kind in kinds for wheel in wheels), *POSE)


def column_faults(log: DriveLog) -> Iterator[Finding]:
    """Yield needed channels that a run lacks, wholly or mostly."""
    for run in log.runs:
        where = str(run.attrs["file"])
        for name in needed_channels(log.metadata.wheels, run.rate_driven):
            if name not in run:
                yield Finding(f"there is no column '{name}'", where, _instead(name, run))
            elif not np.isfinite(run[name]).any():
                yield Finding(f"{name} has no value", where, "record it, or leave the run out")
            elif np.mean(~np.isfinite(run[name])) > MOST:
                share = 100.0 * float(np.mean(~np.isfinite(run[name])))
                todo = f"a run needs {100 * (1 - MOST):.0f} % of it at least: mend the log, or leave the run out"
                yield Finding(f"{name} is missing in {share:.0f} % of the run", where, todo)


def absurd_faults(log: DriveLog) -> Iterator[Finding]:
    """Yield numbers that no sensor gives, infinite ones among them."""
    for run in log.runs:
        for name, values in run.channels.items():
            wrong = np.flatnonzero(np.abs(values) > ABSURD)
            if wrong.size:
                what = f"{name} is {values[wrong[0]]:g} at t = {run.t[wrong[0]]:.4g} s (row {wrong[0] + 1})"
                yield Finding(what, str(run.attrs["file"]), "leave cells without a measurement empty")


def _instead(name: str, run: Trace) -> str:
    suggestion = closest(name, [column for column in run.channels if not is_column(column, ())])
    hint = suggestion.partition("?")[0] + "? rename it, or" if suggestion.startswith("did you mean") else ""
    return f"{hint} record it: duties, wheel rates and {', '.join(POSE)} are needed".strip()


def column_findings(log: DriveLog) -> Iterator[Finding]:
    """Yield what is not recorded and what then is not identifiable, and columns that nobody reads."""
    suspended, wheels = log.load_rover().differential is not None, log.metadata.wheels
    for name, (lost, columns) in OPTIONAL.items():
        for run in log.runs if suspended or "rocker_l" not in columns else ():
            if not any(column in run and np.isfinite(run[column]).any() for column in columns):
                yield Finding(f"{name} not recorded", str(run.attrs["file"]), lost)
    for run in log.runs:
        for name in run.channels:
            if not is_column(name, wheels):
                names = (*WHOLE, *needed_channels(wheels), *(f"current_{wheel}_A" for wheel in wheels))
                suggestion = closest(name, names)
                meant = (
                    f"did you mean {suggestion.split(chr(39))[1]}"
                    if suggestion.startswith("did you mean")
                    else "leave it out"
                )
                yield Finding(f"column '{name}' is not read", str(run.attrs["file"]), f"{meant}, if it matters")


def gap_findings(driven: Driven) -> Remarks:
    """Yield stretches that are missing from a channel, and samples that are missing from the log."""
    run, t = driven.trace, driven.trace.t
    channels_by_gap: dict[tuple[int, int, int], list[str]] = {}
    for name, values in run.channels.items():
        missing = ~np.isfinite(values)
        first, longest = longest_run(missing)
        share = float(np.mean(missing)) if missing.size else 0.0
        if not missing.all() and (longest >= NOTABLE_RUN or share >= NOTABLE_SHARE):
            channels_by_gap.setdefault((first, longest, int(np.sum(missing))), []).append(name)
    for (first, longest, count), names in channels_by_gap.items():
        lasting = float(t[min(first + longest, len(t) - 1)] - t[first])
        verb = "is" if len(names) == 1 else "are"
        what = f"{first_names(names)} {verb} missing for {lasting:.3g} s from t = {t[first]:.4g} s on (row {first + 1})"
        duty = "; the last duty before is taken to hold" if any(name.startswith("duty_") for name in names) else ""
        yield what, f"the {100 * count / len(t):.0f} % of the run without are passed over{duty}"


def ambiguous_step_findings(run: Driven) -> Remarks:
    """Yield how many steps of a duty fall between rows that are not evenly apart."""
    steps = ambiguous_steps(run.trace)
    if steps:
        longest = max(steps, key=lambda step: step.end - step.begin)
        what = (
            f"rows are not evenly apart, so the instants of {len(steps)} steps of the duty are unknown, to "
            f"{longest.end - longest.begin:.2g} s after t = {longest.begin:.4g} s"
        )
        yield what, "nothing is compared in the half-seconds around them"


def clock_findings(run: Driven) -> Remarks:
    """Yield samples that come late."""
    steps, t = np.diff(run.trace.t), run.trace.t
    late = np.flatnonzero(steps > MISSED * run.period)
    if late.size:
        worst = int(late[np.argmax(steps[late])])
        what = (
            f"{late.size} of {steps.size} samples come late, the latest {steps[worst]:.3g} s after t = "
            f"{t[worst]:.4g} s (row {worst + 1}), where {run.period:.3g} s are usual"
        )
        yield what, "look for dropped frames; nothing is known of what is between"


def stretches(flags: np.ndarray) -> np.ndarray:
    """Return where each stretch of true flags begins, and where it has ended (stretches, 2)."""
    return np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int))).reshape(-1, 2)


def longest_run(flags: np.ndarray) -> tuple[int, int]:
    """Return where the longest stretch of true flags begins, and its length."""
    begin, end = max(stretches(flags).tolist(), key=lambda ends: ends[1] - ends[0], default=(0, 0))
    return begin, end - begin
