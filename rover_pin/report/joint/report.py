"""A joint fit's verdict as a page: the sections that any verdict has, and the errors of each set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import format_value
from rover_pin.experiments.joint_rig.diagnostics import JointExtra
from rover_pin.experiments.joint_rig.experiment import JointRig
from rover_pin.report.headline import headline
from rover_pin.report.page import Head, write_page
from rover_pin.report.section import AWAY, Picture, Row, Section, Table, before_and_after
from rover_pin.report.standalone.report import panels_of, sections_of
from rover_pin.report.words import Labels, listing

LABELS = Labels("on slips it never saw", "levels of slip")


def write_report(verdict: Verdict, joint: JointRig, out: Path) -> list[Path]:
    """Write report.html and its figures, and return their paths."""
    count = int(np.isfinite(joint.observed).any(axis=1).sum())
    kicker = f"{len(joint.sets)} sets in one sand: {count} runs at {len(joint.folds)} levels of slip"
    sections = sections_of(verdict, LABELS, _picture(verdict, joint), SetBySet(verdict))
    return write_page(Head(joint.name, kicker, headline(verdict, LABELS)), sections, out)


def _picture(verdict: Verdict, joint: JointRig) -> Picture | None:
    if verdict.before is None or verdict.after is None:
        return None
    errors = listing(
        f"{score.name} {format_value(score.before, score.unit)} to {format_value(score.after, score.unit)}"
        for score in verdict.scores
    )
    alt = f"Measured and modelled {listing(joint.channels)}, point by point; error where not fitted: {errors}."
    return Picture(
        panels_of(verdict, joint), alt, f"Each run once, {', then '.join(joint.sets)}; a level begins at each line."
    )


@dataclass(frozen=True, eq=False)
class SetBySet(Section):
    """The held-out errors of each set, and of a curve through that set alone."""

    verdict: Verdict
    title: ClassVar[str] = "Set by set"
    template: ClassVar[str] = "joint/set_by_set.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return the table; None where nothing was fitted."""
        if not isinstance(self.verdict.extra, JointExtra):
            return None
        added = bool(self.verdict.named)
        rows = []
        for set_error in self.verdict.extra.sets:
            errors = [
                format_value(error, set_error.unit)
                for error in ((set_error.before, set_error.after) if added else (set_error.before,))
            ]
            curve = f"{format_value(set_error.curve_error, set_error.unit)} ({set_error.curve})"
            cells = (
                f"{set_error.set}: {set_error.channel}",
                *errors,
                format_value(set_error.noise, set_error.unit),
                curve,
            )
            rows.append(Row(cells, AWAY * (set_error.curve_error < set_error.after)))
        heads = ("set and channel, not fitted", *before_and_after(added), "noise", "a curve of that set alone")
        return {"table": Table(heads, tuple(rows), "Held-out errors of each set")}
