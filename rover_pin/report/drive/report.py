"""A drive log's verdict as a page: the sections that any verdict has, its runs along time, and free runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.experiments.drive_log.free_runs import FreeRun
from rover_pin.experiments.drive_log.parameters import with_wheels
from rover_pin.logs.drive_log import DriveLog
from rover_pin.report.drive.full_duty import at_full_duty
from rover_pin.report.drive.ghost import Ghosts
from rover_pin.report.drive.residual import LeftOver
from rover_pin.report.drive.runs import (
    Sides,
    free_panels,
    measured_panels,
    residual_panels,
    telling_channels,
    words_of,
    worst_runs,
)
from rover_pin.report.first_screen import FirstScreen
from rover_pin.report.headline import WORTH, headline
from rover_pin.report.page import Head, write_page
from rover_pin.report.section import AWAY, Picture, Row, Section, Table, before_and_after
from rover_pin.report.sections.closing import DataCheck, Repeat, Warnings
from rover_pin.report.sections.held_out import HeldOut
from rover_pin.report.sections.numbers import Numbers
from rover_pin.report.sections.physics import Physics
from rover_pin.report.sections.sensitivity import Untold
from rover_pin.report.sections.which_cause import WhichCause
from rover_pin.report.words import Labels, brief, listing, pair

SHOWN = 2
"""Channels in the picture of the first screen."""


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
    seconds = sum(float(trace.t[-1] - trace.t[0]) for trace in log.runs if len(trace.t))
    sections = [
        FirstScreen(verdict, labels, _picture(sides), "worst_run"),
        FreeRuns(verdict),
        Ghosts.of(verdict, log, sides),
        HeldOut(verdict, labels),
        WhereItIsWrong(verdict),
        Physics(verdict, labels, lambda effect: at_full_duty(verdict.model, effect)),
        WhichCause(verdict, labels),
        Numbers(verdict),
        LeftOver(verdict),
        Untold(verdict, labels),
        Warnings(verdict, labels),
        DataCheck(verdict, log.metadata.source),
        Repeat(verdict, labels),
    ]
    head = Head(log.metadata.name, f"{len(log.runs)} runs, {seconds:.0f} s", headline(verdict, labels))
    return write_page(head, sections, out)


def sides_of(verdict: Verdict) -> Sides | None:
    """Return the fits before and after; the same where nothing was added, None where nothing could be fitted."""
    if verdict.before is None or verdict.after is None:
        return None
    return Sides(verdict.before.fit, verdict.after.fit if verdict.named else verdict.before.fit)


def _picture(sides: Sides | None) -> Picture | None:
    """Return the channels that changed most on the run that the base model misses most."""
    if sides is None:
        return None
    run, channels = worst_runs(sides.before)[0], telling_channels(sides)[:SHOWN]
    names = listing(words_of(sides.experiment.channels[row]) for row in channels)
    alt = f"{names} of run {sides.experiment.runs[run].name}, measured and modelled before" + " and after" * sides.added
    panels = tuple(figure for row in channels for figure in measured_panels(sides, [row], [run]))
    caption = "The run that the base model misses most, in half-second means; shaded is not compared."
    return Picture(panels, f"{alt}.", caption)


def _together(free: tuple[FreeRun, ...]) -> tuple[float, float]:
    """Return the RMS distance of all free runs from the logged place, before and after [m]."""
    rows = np.array([(free_run.before, free_run.after) for free_run in free])
    was, now = (float(np.sqrt(np.nanmean(side**2))) if np.isfinite(side).any() else float("nan") for side in rows.T)
    return was, now


def _describe_free_runs(free: tuple[FreeRun, ...]) -> list[str]:
    """Return that free runs stay closer, where they do; where they do not, a caution says so."""
    was, now = _together(free) if free else (0.0, 0.0)
    if not now < (1.0 - WORTH) * was:
        return []
    before, after = pair(was, now, "m")
    return [f"left to drive by the logged commands alone it stays closer: {after} off the measured place, not {before}"]


@dataclass(frozen=True, eq=False)
class FreeRuns(Section):
    """How far simulations diverge that are given the logged commands and nothing else."""

    verdict: Verdict
    title: ClassVar[str] = "Driven freely"
    template: ClassVar[str] = "drive/free_runs.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return the distances; None where nothing was driven."""
        free = extra_of(self.verdict).free
        if not free:
            return None
        added = bool(self.verdict.named)
        rows = [
            _free_row(free_run.run, f"{free_run.distance:.2f} m", free_run.before, free_run.after, added)
            for free_run in free
        ]
        if len(free) > 1:
            rows.append(_free_row("all runs together", "", *_together(free), added))
        heads = ("run", "driven", *before_and_after(added))
        return {"table": Table(heads, tuple(rows), "RMS distance from the logged place")}

    def pictures(self) -> Mapping[str, Picture]:
        """Return the distance over time."""
        sides = sides_of(self.verdict)
        if sides is None:
            return {}
        models = [sides.before.model, *([sides.after.model] if sides.added else [])]
        before, after = (brief(distance, "m") for distance in _together(extra_of(self.verdict).free))
        alt = f"Distance of free simulations from the logged place over time: {before} RMS" + (
            f" before and {after} after." if sides.added else "."
        )
        return {"free": Picture(free_panels(sides.experiment, models), alt)}


def _free_row(run: str, driven: str, before: float, after: float, added: bool) -> Row:
    cells = (run, driven, _mm(before), *((_mm(after),) if added else ()))
    return Row(cells, AWAY * (added and not after <= before))


def _mm(distance: float) -> str:
    return f"{1e3 * distance:.1f} mm" if np.isfinite(distance) else "did not drive"


@dataclass(frozen=True, eq=False)
class WhereItIsWrong(Section):
    """Measured and modelled channels, and what is left of them, along the runs that are missed most."""

    verdict: Verdict
    title: ClassVar[str] = "Where the error lives"
    template: ClassVar[str] = "drive/where_it_is_wrong.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return whether anything was added; None where nothing was fitted."""
        return None if sides_of(self.verdict) is None else {"added": bool(self.verdict.named)}

    def pictures(self) -> Mapping[str, Picture]:
        """Return residuals and channels against time."""
        sides = sides_of(self.verdict)
        assert sides is not None
        names = listing(words_of(sides.experiment.channels[row]) for row in telling_channels(sides))
        after = " and after" * sides.added
        return {
            "residuals": Picture(
                residual_panels(sides), f"Measured minus model of {names} against time, before{after}."
            ),
            "measured": Picture(measured_panels(sides), f"Measured and modelled {names} against time, before{after}."),
        }
