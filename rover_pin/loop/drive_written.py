"""A drive verdict on disk: the model, the report, a draft of what is unknown, and verdict.json."""

from __future__ import annotations

import os
from pathlib import Path

from rover_pin.columns import replace_file
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.experiments.unlisted.remainder import draft_effect
from rover_pin.loop.verdict_file import written_last
from rover_pin.motion.drive_log import DriveLog
from rover_pin.motion.model_toml import write_model
from rover_pin.report.drive.report import write_report

DRAFT = Path("draft_effect") / "measured_remainder.py"


def written(verdict: Verdict, log: DriveLog, out: Path) -> Verdict:
    """Write model.toml, report.html with its figures and verdict.json; return the verdict with their paths."""
    named = Path(log.rover)
    rover = "" if named.suffix == "" else os.path.relpath(named.resolve(), out.resolve())
    files = [write_model(verdict.model, out / "model.toml", verdict.sentence, rover)]
    left = extra_of(verdict).remainder
    if verdict.answer is Answer.NONE_FITS and left is not None:
        files.append(replace_file(out / DRAFT, draft_effect(left, verdict.name)))
    return written_last(verdict, (*files, *write_report(verdict, log, out)), out)
