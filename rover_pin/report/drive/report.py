"""The report of a drive log: the sections of all kinds of data, residuals against time, free runs, and a 3D view of a
run.

A free run is a simulation with the logged commands only, which the measurements never correct. The 3D view shows the
run with the largest deviation of the base model from the measurements.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import RoverPinError
from rover_pin.base.extras import install_command
from rover_pin.base.jobs.cluster import results
from rover_pin.control.open_loop import ConstantDuty
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.effect import SensorEffect
from rover_pin.estimation.wording import MIN_MENTIONED
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.free_runs import distances_of, extra_of
from rover_pin.experiments.drive_log.model import with_wheels
from rover_pin.logs.drive_log import DriveLog
from rover_pin.report.drive.residuals import (
    Sides,
    effect_picture,
    residual_panels,
    residual_section,
    telling_channels,
    words_of,
)
from rover_pin.report.page import AWAY, Picture, ReportTable, Section, TableRow, before_and_after
from rover_pin.report.verdict_page import VerdictPage, write_verdict
from rover_pin.report.words import Labels, listing, pair
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.shapes import flat
from rover_pin.view.film import Subject, mesh_folder
from rover_pin.view.page import page_of


def labels_of(verdict: Verdict) -> Labels:
    """Return the words that the report uses for a drive log: for its runs, its channels and the places of causes.

    If the free runs (simulated with the logged commands only) are closer to the measured path with the added effects
    than without them, the words include this as a reason to believe the verdict. A remark on the terrain is included if
    there is one.
    """
    extra, wheels = extra_of(verdict), [wheel.name for wheel in verdict.model.rover.wheels]
    evidence: tuple[str, ...] = ()
    # The free runs are mentioned only if their distance falls noticeably.
    was, now = distances_of(extra.free) if verdict.named and extra.free else (0.0, 0.0)
    if now < (1.0 - MIN_MENTIONED) * was:
        before, after = pair(was, now, "m")
        evidence = (
            f"the distance of free runs (simulated with the logged commands alone) from the measured path falls from "
            f"{before} to {after}",
        )
    return Labels(
        "in runs that were not fitted",
        "runs",
        words_of,
        partial(with_wheels, wheels=wheels, form="{name}[wheel {wheel}]"),
        evidence=evidence,
        besides=extra.ground.sentence if extra.ground else "",
    )


def write_report(verdict: Verdict, log: DriveLog, out: Path) -> list[Path]:
    """Write the report of a drive log, report.html, and its figures into the folder `out`, and return the paths of all
    files.
    """
    # The 3D view is started first, because another process makes it while the rest of the page is written here.
    labels, sides = labels_of(verdict), sides_of(verdict)
    scene = ghosts(verdict, log, sides)
    seconds = sum(float(trace.t[-1] - trace.t[0]) for trace in log.runs if len(trace.t))
    # Only a drive log has sections on free runs and on residuals along the drive, and a 3D view.
    page = VerdictPage(
        labels,
        log.metadata.name,
        f"{len(log.runs)} runs, {seconds:.0f} s",
        ("effect", effect_picture(sides) if sides else None),
        (free_runs_section(verdict), scene),
        where_wrong_section(sides),
        residual_section(verdict),
        lambda effect: at_full_duty(verdict.model, effect),
        log.metadata.source,
    )
    return write_verdict(verdict, page, out)


def sides_of(verdict: Verdict) -> Sides | None:
    """Return two fits for the report: the fit of the base model, and the fit of the model with added effects.

    If no effect was added, both are the fit of the base model. If no model was fitted, the result is None.
    """
    if verdict.before is None or verdict.after is None:
        return None
    return Sides(verdict.before.fit, verdict.after.fit if verdict.named else verdict.before.fit)


def free_runs_section(verdict: Verdict) -> Section | None:
    """Return the section with the distances between free runs and the measured path; None if no run was simulated.

    A free run is a simulation with the logged commands only.
    """
    free, added = extra_of(verdict).free, bool(verdict.named)
    if not free:
        return None
    # One row for each run, and a row for all runs together if there are several.
    rows = [
        _free_row(free_run.run, f"{free_run.distance:.2f} m", free_run.before, free_run.after, added)
        for free_run in free
    ]
    if len(free) > 1:
        rows.append(_free_row("all runs together", "", *distances_of(free), added))
    table = ReportTable(
        ("run", "distance driven", *before_and_after(added)), tuple(rows), "RMS distance from the measured position"
    )
    return Section("Free runs", "drive/free_runs.html", {"table": table})


def _free_row(run: str, driven: str, before: float, after: float, added: bool) -> TableRow:
    """Return the table row of one run, with the RMS distances of its free runs from the measured path.

    `before` and `after` are the distances [m] without and with the added effects, `driven` is the driven distance as
    text, and `added` is whether effects were added. The row is marked if the added effects increase the distance.
    """
    distances = (before, after) if added else (before,)
    cells = (f"{1e3 * distance:.1f} mm" if np.isfinite(distance) else "did not drive" for distance in distances)
    return TableRow((run, driven, *cells), AWAY * (added and not after <= before))


def where_wrong_section(sides: Sides | None) -> Section | None:
    """Return the section with the residuals of the worst-fitted runs against time; None if no model was fitted."""
    if sides is None:
        return None
    names = listing(words_of(sides.experiment.channels[row]) for row in telling_channels(sides))
    after = " and after" * sides.added
    alt = f"Measured minus model of {names} against time, before{after}."
    pictures = {"residuals": Picture(residual_panels(sides), alt)}
    return Section("Residuals against time", "drive/where_it_is_wrong.html", {"added": sides.added}, pictures)


DRIVE_DURATION, MEAN_DURATION = 8.0, 2.0
"""DRIVE_DURATION is the duration of a simulated drive that shows the influence of an effect [s]. The report states
means over the last MEAN_DURATION [s] of this drive only, because slip and sinkage change during the first seconds."""
MIN_RELATIVE_CHANGE = 0.005
"""Smallest change of a mean that the report mentions, as a fraction of the mean. Values are printed with two digits, so
that smaller changes would usually appear as two equal numbers."""
ROVER_MEANS = {"body_vx": ("speed", "m/s"), "battery_V": ("bus voltage", "V")}
WHEEL_MEANS = {"slip": ("slip", ""), "sinkage": ("sinkage", "m"), "current": ("current per motor", "A")}
"""Channels whose means the report compares without and with an effect, with their words and units: ROVER_MEANS for the
rover, and WHEEL_MEANS for channels that are averaged over all wheels."""


def at_full_duty(model: Model, effect: Any) -> str:
    """Return a sentence on how an effect changes a simulated drive at full duty on level ground.

    Two drives are simulated, without and with the effect. The sentence is empty if no mean changes by more than
    MIN_RELATIVE_CHANGE, if the effect acts on a sensor only, or if the rover cannot drive.
    """
    if isinstance(effect, SensorEffect):
        return ""
    level = model.replace(terrain=flat())
    # The first drive keeps the effect at its neutral values, so that both models have the same effects.
    bare = level.having(effect.replace(**effect.neutral))
    try:
        traces = [
            simulate(variant, ConstantDuty(1.0), DRIVE_DURATION, measure_error=False)
            for variant in (bare, level.having(effect))
        ]
    except RoverPinError:  # without a drive there is nothing to compare
        return ""

    def late_means(trace: Trace) -> dict[str, tuple[float, str]]:
        # Means over the last part of the drive with their units, by the channels' words.
        late = trace.t >= trace.t[-1] - MEAN_DURATION
        means = {
            words: (float(np.mean(trace[name][late])), unit)
            for name, (words, unit) in ROVER_MEANS.items()
            if name in trace
        }
        for name, (words, unit) in WHEEL_MEANS.items():
            means[words] = (float(np.mean(trace.stack(name)[late])), unit)
        return means

    before, after = (late_means(trace) for trace in traces)
    changes = []
    for words, (was, unit) in before.items():
        now = after[words][0]
        # Relative to the larger of the two means, so that their order does not matter.
        if abs(now - was) > MIN_RELATIVE_CHANGE * max(abs(was), abs(now)):
            first, second = pair(was, now, unit)
            relative = f" ({now / was - 1:+.0%})" if unit and was else ""
            changes.append(f"{words} goes from {first} to {second}{relative}")
    return f"At full duty on level ground {listing(changes)}." if changes else ""


def ghosts(verdict: Verdict, log: DriveLog, sides: Sides | None) -> Callable[[], Section | None]:
    """Start making the 3D view of the worst-predicted run, and return a function that waits for it and returns its
    section.

    This is the run with the largest deviation of the base model from the measurements. The view shows the measured
    drive as a solid rover, and the free runs of the base model and of the model with added effects as transparent
    rovers (ghosts). If the search for missing effects has worker processes, one of them makes the view while the rest
    of the report is written. The returned function returns None if no run was simulated.
    """
    free = [free_run for free_run in extra_of(verdict).free if np.isfinite(free_run.before)]
    if sides is None or not free:
        return lambda: None
    # The run whose free run by the base model is furthest from the measured path.
    run = max(free, key=lambda free_run: free_run.before).run
    if find_spec("viser") is None:
        return partial(_view_section, run, sides.added, None)
    # Solid: the measured drive. Ghosts: the free runs, orange for the base model and blue with the added effects.
    model, experiment = sides.before.model, sides.experiment
    measured = Subject(run, log.run(run), model.rover, model.ground, mesh_folder(log.rover))
    others = [(free_drive(experiment, model, run, measured, "base model"), "orange")]
    if sides.added:
        others.append((free_drive(experiment, sides.after.model, run, measured, "with added effects"), "blue"))
    # The work begins here; `_view_section` waits for the HTML page when the report needs it.
    processes = experiment.jobs if isinstance(experiment.jobs, int) else 1
    pages = results(page_of, [(replace(measured, name=f"{run}, as measured"), others)], processes)
    return partial(_view_section, run, sides.added, pages)


def _view_section(run: str, added: bool, pages: Iterator[str] | None) -> Section | None:
    """Return the section with the 3D view of a run, which is an HTML page inside the page; None if the run has no x and
    y.

    `pages` yields the HTML page when it is made. It is None if the package viser is not installed; then the section
    shows the command that installs the package. `added` is whether effects were added.
    """
    try:
        page = "" if pages is None else next(pages)
    except RoverPinError:  # a run without x and y has no view
        return None
    return Section(
        "3D view", "drive/ghost.html", {"run": run, "added": added, "page": page, "install": install_command("view")}
    )


def free_drive(experiment: DriveExperiment, model: Model, run: str, beside: Subject, name: str) -> Subject:
    """Return the free run of a model, which is simulated with the logged commands only, as a drive for the 3D view.

    Rover and terrain are taken from the drive `beside`, which this view also shows. `run` is the name of the run, and
    `name` is the name that the view shows.
    """
    alone = experiment.free.alone(run)
    # The replay may end early; channels that do not cover all times of the commands are left out.
    commands, (replay,) = alone.runs[0].commands, alone.replays(model)
    channels = {name: values for name, values in replay.channels.items() if len(values) == len(commands.t)}
    trace = Trace({"t_s": commands.t, **channels}, attrs={"wheels": beside.trace.wheels})
    return replace(beside, name=name, trace=trace)
