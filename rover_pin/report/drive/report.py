"""A drive log's verdict as a page: the sections that any verdict has, its runs along time, and free runs."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.errors import RoverPinError
from rover_pin.control.constant import ConstantDuty
from rover_pin.discrepancy.held_out_errors import together
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.effect import SensorEffect
from rover_pin.estimation.fit import FEW
from rover_pin.estimation.wording import AT_FLOOR, WORTH
from rover_pin.experiments.drive_log.free_runs import FreeRun, distances_of, extra_of
from rover_pin.experiments.drive_log.parameters import with_wheels
from rover_pin.logs.drive_log import DriveLog
from rover_pin.report.drive.ghost import ghosts
from rover_pin.report.drive.residual import residual_section
from rover_pin.report.drive.runs import Sides, effect_picture, residual_panels, telling_channels, words_of
from rover_pin.report.page import AWAY, Picture, Row, Section, Table, before_and_after
from rover_pin.report.verdict_page import write_verdict
from rover_pin.report.words import Labels, listing, pair
from rover_pin.simulation.model.implausible import implausible
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.simulate import simulate
from rover_pin.simulation.trace.trace import Trace
from rover_pin.terrain.shapes import flat


def labels_of(verdict: Verdict) -> Labels:
    """Return what a drive log calls its parts, and what its free runs and its ground say."""
    extra, wheels = extra_of(verdict), [wheel.name for wheel in verdict.model.rover.wheels]
    return Labels(
        "on runs it never saw",
        "runs",
        words_of,
        partial(with_wheels, wheels=wheels, form="{name}[wheel {wheel}]"),
        evidence=tuple(_describe_free_runs(extra.free) if verdict.named else ()),
        besides=extra.ground.sentence if extra.ground else "",
    )


def write_report(verdict: Verdict, log: DriveLog, out: Path) -> list[Path]:
    """Write report.html and its figures, and return their paths."""
    labels, sides = labels_of(verdict), sides_of(verdict)
    scene = ghosts(verdict, log, sides)
    seconds = sum(float(trace.t[-1] - trace.t[0]) for trace in log.runs if len(trace.t))
    return write_verdict(
        verdict,
        labels,
        out,
        log.metadata.name,
        f"{len(log.runs)} runs, {seconds:.0f} s",
        ("effect", effect_picture(sides) if sides else None),
        (free_runs_section(verdict), scene),
        where_wrong_section(sides),
        residual_section(verdict),
        lambda effect: at_full_duty(verdict.model, effect),
        log.metadata.source,
    )


def sides_of(verdict: Verdict) -> Sides | None:
    """Return the fits before and after; the same where nothing was added, None where nothing could be fitted."""
    if verdict.before is None or verdict.after is None:
        return None
    return Sides(verdict.before.fit, verdict.after.fit if verdict.named else verdict.before.fit)


def _describe_free_runs(free: tuple[FreeRun, ...]) -> list[str]:
    """Return that free runs stay closer, where they do; where they do not, a caution says so."""
    was, now = distances_of(free) if free else (0.0, 0.0)
    if not now < (1.0 - WORTH) * was:
        return []
    before, after = pair(was, now, "m")
    return [f"left to drive by the logged commands alone it stays closer: {after} off the measured place, not {before}"]


def free_runs_section(verdict: Verdict) -> Section | None:
    """Return how far simulations diverge that are given the logged commands alone; None where nothing was driven."""
    free, added = extra_of(verdict).free, bool(verdict.named)
    if not free:
        return None
    rows = [
        _free_row(free_run.run, f"{free_run.distance:.2f} m", free_run.before, free_run.after, added)
        for free_run in free
    ]
    if len(free) > 1:
        rows.append(_free_row("all runs together", "", *distances_of(free), added))
    table = Table(("run", "driven", *before_and_after(added)), tuple(rows), "RMS distance from the logged place")
    return Section("Driven freely", "drive/free_runs.html", {"table": table})


def _free_row(run: str, driven: str, before: float, after: float, added: bool) -> Row:
    cells = (run, driven, _mm(before), *((_mm(after),) if added else ()))
    return Row(cells, AWAY * (added and not after <= before))


def _mm(distance: float) -> str:
    return f"{1e3 * distance:.1f} mm" if np.isfinite(distance) else "did not drive"


def where_wrong_section(sides: Sides | None) -> Section | None:
    """Return measured and modelled channels, and what is left of them, along the runs that are missed most."""
    if sides is None:
        return None
    names = listing(words_of(sides.experiment.channels[row]) for row in telling_channels(sides))
    after = " and after" * sides.added
    alt = f"Measured minus model of {names} against time, before{after}."
    pictures = {"residuals": Picture(residual_panels(sides), alt)}
    return Section("Where the error lives", "drive/where_it_is_wrong.html", {"added": sides.added}, pictures)


SECONDS, LAST = 8.0, 2.0
"""How long is driven, and over which end of it means are taken [s]."""
MIN_RELATIVE_CHANGE = 0.005
"""Relative change below which a mean is the same."""
WHOLE = {"body_vx": ("speed", "m/s"), "battery_V": ("bus voltage", "V")}
WHEELS = {"slip": ("slip", ""), "sinkage": ("sinkage", "m"), "current": ("current a motor", "A")}
"""Means that are said: of the rover, and over its wheels; words and unit."""


def at_full_duty(model: Model, effect: Any) -> str:
    """Return one sentence: what an effect of a model changes on level ground at full duty; empty where nothing."""
    if isinstance(effect, SensorEffect):
        return ""
    level = model.replace(terrain=flat())
    bare = level.having(effect.replace(**effect.neutral))
    try:
        traces = [
            simulate(variant, ConstantDuty(1.0), SECONDS, measure_error=False)
            for variant in (bare, level.having(effect))
        ]
    except RoverPinError:  # a drive that cannot be driven says nothing of the effect
        return ""
    changes = list(_changes(*(_means(trace) for trace in traces)))
    return f"At full duty on level ground {listing(changes)}." if changes else ""


def _means(trace: Trace) -> dict[str, tuple[float, str]]:
    """Return means over the end of a drive, with their unit, by what they are called."""
    late = trace.t >= trace.t[-1] - LAST
    means = {words: (float(np.mean(trace[name][late])), unit) for name, (words, unit) in WHOLE.items() if name in trace}
    for name, (words, unit) in WHEELS.items():
        means[words] = (float(np.mean(trace.stack(name)[late])), unit)
    return means


def _changes(before: dict[str, tuple[float, str]], after: dict[str, tuple[float, str]]) -> Iterator[str]:
    for words, (was, unit) in before.items():
        now = after[words][0]
        if abs(now - was) > MIN_RELATIVE_CHANGE * max(abs(was), abs(now)):
            first, second = pair(was, now, unit)
            share = f" ({now / was - 1:+.0%})" if unit and was else ""
            yield f"{words} goes from {first} to {second}{share}"


def cautions(verdict: Verdict, free: tuple[FreeRun, ...]) -> Iterator[str]:
    """Yield what a reader should be wary of, given how far free runs diverge; of nothing fitted nothing."""
    if verdict.after is None:
        return
    for number in verdict.drifted:
        yield f"{number.name} sits {number.away}: it may have absorbed an effect"
    for number in verdict.after.numbers:
        if number.at_bound:
            yield f"{number.name} lies at its bound: the form of the model is strained"
    yield from implausible(verdict.after.fit.model)
    misfit = together(verdict.runs)[1]
    if misfit > AT_FLOOR:
        yield f"runs left out are missed by {misfit:.1f} times the noise: more than noise is left"
    if len(verdict.runs) < FEW:
        yield f"{len(verdict.runs)} runs are few: what holds on one left out may not hold on the next"
    yield from _free(free, bool(verdict.named))


def _free(free: tuple[FreeRun, ...], added: bool) -> Iterator[str]:
    lost = [free_run.run for free_run in free if not np.isfinite(free_run.after)]
    if lost:
        yield f"driven freely, the model does not come to the end of {', '.join(lost)}"
    farther_runs = [free_run.run for free_run in free if added and free_run.after > free_run.before]
    if farther_runs:
        yield f"driven freely, the model diverges further than the base model in {', '.join(farther_runs)}"
