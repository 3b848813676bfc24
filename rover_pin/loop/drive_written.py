"""A drive verdict on disk: the model, the report, a draft of what is unknown, and verdict.json."""

import os
from pathlib import Path

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.logs.drive_log import DriveLog
from rover_pin.loop.provenance import LoopRequest
from rover_pin.loop.verdict_file import draft_written, posterior_written, written_last
from rover_pin.report.drive.report import write_report
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import write_model


def write_results(verdict: Verdict, log: DriveLog, request: LoopRequest, out: Path) -> Verdict:
    """Write model.toml, posterior, report.html with its figures and verdict.json; return the verdict with the paths."""

    def write(model: Model, file: Path, note: str) -> Path:
        named = Path(log.rover)
        rover = "" if named.suffix == "" else os.path.relpath(named.resolve(), file.parent.resolve())
        return write_model(model, file, note, rover)

    files = [write(on_its_ground(verdict), out / "model.toml", verdict.sentence)]
    files += posterior_written(verdict, write, out, request.seed)
    verdict, draft = draft_written(verdict, request, out)
    return written_last(verdict, (*files, *draft, *write_report(verdict, log, out)), out)


def on_its_ground(verdict: Verdict) -> Model:
    """Return a verdict's model, on the ground that its drives tell where they share most of what is not as declared."""
    ground, model = extra_of(verdict).ground, verdict.model
    assert isinstance(model, Model)
    return model if ground is None or ground.bend is None else model.having(ground.bend)
