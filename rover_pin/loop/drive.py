"""The loop on drive logs: checked, calibrated, searched, judged on runs left out, and written down."""

import dataclasses
import os
import time
from pathlib import Path

from rover_pin.base.code_digest import key_of_code
from rover_pin.base.files.results_folder import OF_A_LOOP, say_what_is_replaced
from rover_pin.base.jobs.cluster import Workers
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import conclude, with_draft
from rover_pin.discrepancy.question import Progress, Question
from rover_pin.discrepancy.rivals import against_rivals
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.numbers import profiles
from rover_pin.experiments.drive_log.calibrate import experiment_on
from rover_pin.experiments.drive_log.candidates import candidates
from rover_pin.experiments.drive_log.checks.log import findings, refuse_unfit, too_poor
from rover_pin.experiments.drive_log.experiment import experiment_of_log
from rover_pin.experiments.drive_log.free_runs import DriveExtra, free_runs
from rover_pin.experiments.drive_log.ground.run_variability import ground_variability
from rover_pin.experiments.drive_log.model import base_model, is_rate_driven, with_spread
from rover_pin.experiments.drive_log.next_drives import next_drives
from rover_pin.experiments.drive_log.odometry_rival import odometry_baselines
from rover_pin.experiments.drive_log.parameters import with_wheels
from rover_pin.experiments.drive_log.resume import Memory
from rover_pin.experiments.unlisted.actions import Scene
from rover_pin.experiments.unlisted.residual import describe, draft_term
from rover_pin.experiments.unlisted.terms import functions
from rover_pin.logs.drive_log import DriveLog
from rover_pin.loop.provenance import LoopRequest, provenance
from rover_pin.loop.verdict_file import draft_written, posterior_written, written_last
from rover_pin.report.drive.report import cautions, write_report
from rover_pin.simulation.model.effect_files import file_of, user_effects
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.model.toml_file import write_model


def close_drive_loop(
    log: DriveLog,
    model: Model | None,
    request: LoopRequest,
    progress: Progress = lambda message: None,
    jobs: Workers = 1,
) -> Verdict:
    """Return what a model of a drive log lacks, with the error before and after; see `close_the_loop`.

    `model` is where it starts, read; None takes what the log declares.

    Raises DataError: a log that cannot be used: one sentence each.
    """
    begun = time.monotonic()
    progress("checking the log")
    refuse_unfit(log)
    poor, start = too_poor(log), model or base_model(log)
    folder, effects = None if request.out is None else Path(request.out), request.effects
    say_what_is_replaced(folder, OF_A_LOOP)
    memory = Memory(folder, "" if folder is None else key_of_code(_code(start, effects)))
    with memory.noting():
        if poor:
            verdict = Verdict("drive-log", Answer.CANNOT_TELL, log.metadata.name, poor, start, findings=findings(log))
        else:
            verdict = _reach_verdict(log, start, effects, memory, (progress, jobs, request.seed))
        verdict.provenance.update(provenance(request, time.monotonic() - begun))
        if folder is None:
            return verdict
        progress("writing the report")
        verdict = write_results(verdict, log, request, folder)
    memory.remove_files()
    return verdict


def _reach_verdict(
    log: DriveLog, start: Model, effects: str | Path | None, memory: Memory, options: tuple[Progress, Workers, int]
) -> Verdict:
    progress, jobs, seed = options
    if memory.status:
        progress(f"going on: {memory.status}")
    model = with_spread(start, motors=not is_rate_driven(log))
    return verdict_on(log, question_of(log, model, effects, jobs, progress, memory), seed, progress)


def _code(model: Model, effects: str | Path | None) -> set[Path]:
    """Return the files with the code of effects: a user's own, and those of the model."""
    user_kinds = user_effects(effects) if effects else ()
    return {file_of(kind) for kind in (*user_kinds, *map(type, model.all_effects))}


def question_of(
    log: DriveLog,
    start: Model,
    effects: str | Path | None = None,
    jobs: Workers = 1,
    progress: Progress = lambda message: None,
    memory: Memory = Memory(),
) -> Question:
    """Return what is asked of a drive log: which effect its model lacks."""
    experiment, model, numbers = experiment_on(log, start, jobs, progress, memory)
    return Question(
        "drive-log",
        log.metadata.name,
        experiment,
        model,
        numbers,
        lambda base: candidates(base.model, experiment, base.parameters, effects),
        functions=lambda base: functions(Scene(base)),
        offers=next_drives,
    )


def verdict_on(log: DriveLog, question: Question, seed: int, progress: Progress) -> Verdict:
    """Return the verdict on what a log's model lacks and what is left."""
    verdict = conclude(question, progress, seed)
    assert verdict.before is not None
    assert verdict.after is not None
    assert verdict.beliefs is not None
    progress("describing what is left")
    residual = describe(verdict.after.fit, progress)
    progress("runs driven freely")
    after, rover = verdict.after.fit, question.model.rover
    experiment = experiment_of_log(after)
    causes = verdict.beliefs.best(verdict.named).causes
    amplitude_names = tuple(name for cause in causes for name in sorted(cause.amplitudes))
    free = free_runs(experiment, verdict.before.model, verdict.model)
    ground = ground_variability(after)
    odometry = odometry_baselines(experiment, rover)
    verdict = with_draft(verdict, lambda fitted: draft_term(fitted, residual, log.metadata.name, progress), seed)
    how = f"It {residual.best.description}." if verdict.answer is Answer.NONE_FITS else ""
    sentences = " ".join(filter(None, (verdict.sentence, how, ground.sentence if ground else "")))
    verdict = dataclasses.replace(
        verdict,
        sentence=with_wheels(sentences, [wheel.name for wheel in rover.wheels], "{name}[{number}] (wheel {wheel})"),
        findings=findings(log),
        profiles=profiles(after, amplitude_names) if amplitude_names and verdict.named else (),
        cautions=(*verdict.cautions, *cautions(verdict, free)),
        extra=DriveExtra(free, residual, ground),
    )
    return against_rivals(verdict, odometry, same_inputs=experiment.rate_driven)


def write_results(verdict: Verdict, log: DriveLog, request: LoopRequest, out: Path) -> Verdict:
    """Write model.toml, posterior, report.html with its figures and verdict.json; return the verdict with the paths."""

    def write(model: Model, file: Path, note: str) -> Path:
        named = Path(log.rover)
        rover = "" if named.suffix == "" else os.path.relpath(named.resolve(), file.parent.resolve())
        return write_model(model, file, note, rover)

    assert isinstance(verdict.model, Model)
    files = [write(verdict.model, out / "model.toml", verdict.sentence)]
    files += posterior_written(verdict, write, out, request.seed)
    verdict, draft = draft_written(verdict, request, out)
    return written_last(verdict, (*files, *draft, *write_report(verdict, log, out)), out)
