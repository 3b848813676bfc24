"""A joint fit's verdict as a page: the sections that any verdict has, and the errors of each set."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import format_value
from rover_pin.experiments.rig_sets.diagnostics import JointExtra
from rover_pin.experiments.rig_sets.experiment import RigExperiment
from rover_pin.report.headline import headline
from rover_pin.report.page import Head, write_page
from rover_pin.report.section import AWAY, Picture, Row, Section, Table, before_and_after
from rover_pin.report.standalone.report import panels_of, sections_of
from rover_pin.report.words import Labels, listing

LABELS = Labels("on slips it never saw", "levels of slip")


def write_report(verdict: Verdict, joint: RigExperiment, out: Path) -> list[Path]:
    """Write report.html and its figures, and return their paths."""
    count = int(np.isfinite(joint.observed).any(axis=1).sum())
    kicker = f"{len(joint.sets)} sets in one sand: {count} runs at {len(joint.folds)} levels of slip"
    sections = sections_of(verdict, LABELS, _picture(verdict, joint), set_by_set_section(verdict))
    return write_page(Head(joint.name, kicker, headline(verdict, LABELS)), sections, out)


def _picture(verdict: Verdict, joint: RigExperiment) -> Picture | None:
    if verdict.before is None or verdict.after is None:
        return None
    errors = listing(
        f"{score.name} {format_value(score.before, score.unit)} to {format_value(score.after, score.unit)}"
        for score in verdict.scores
    )
    alt = f"Measured and modelled {listing(joint.channels)}, point by point; error where not fitted: {errors}."
    return Picture(
        panels_of(verdict, joint), alt, f"Each run once, {', then '.join(joint.runs)}; a level begins at each line."
    )


def set_by_set_section(verdict: Verdict) -> Section | None:
    """Return the held-out errors of each set, and of a curve through that set alone; None where nothing was fitted."""
    if not isinstance(verdict.extra, JointExtra):
        return None
    added, rows = bool(verdict.named), []
    for row in verdict.extra.sets:
        values = (row.before, row.after, row.noise) if added else (row.before, row.noise)
        errors = [format_value(value, row.unit) for value in values]
        curve = f"{format_value(row.curve_error, row.unit)} ({row.curve})"
        rows.append(Row((f"{row.set}: {row.channel}", *errors, curve), AWAY * row.is_lost))
    heads = ("set and channel, not fitted", *before_and_after(added), "noise", "a curve of that set alone")
    table = Table(heads, tuple(rows), "Held-out errors of each set")
    return Section("Set by set", "joint/set_by_set.html", {"table": table})
