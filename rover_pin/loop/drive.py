"""The loop on drive logs: checked, calibrated, searched, judged on runs left out, and written down."""

from __future__ import annotations

import dataclasses
import re
import time
from collections.abc import Sequence
from pathlib import Path

from rover_pin.base.code_digest import key_of_code
from rover_pin.base.files.results_folder import OF_A_LOOP, say_what_is_replaced
from rover_pin.base.jobs.cluster import Workers
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.decide_answer import (
    ResidualAssessment,
    chosen_without,
    keep_supported_effects,
    make_verdict,
    with_draft,
)
from rover_pin.discrepancy.held_out import losses
from rover_pin.discrepancy.refit import Progress, Refit
from rover_pin.discrepancy.search import Search, is_within_prediction_error, search
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.numbers import profiles
from rover_pin.experiments.drive_log.calibrate import calibrated_on
from rover_pin.experiments.drive_log.candidates import candidates
from rover_pin.experiments.drive_log.checks.log import findings, refuse_unfit, too_poor
from rover_pin.experiments.drive_log.experiment import logged
from rover_pin.experiments.drive_log.extra import DriveExtra
from rover_pin.experiments.drive_log.free_runs import free_runs
from rover_pin.experiments.drive_log.ground.run_variability import ground_variability
from rover_pin.experiments.drive_log.kinematic import kinematic
from rover_pin.experiments.drive_log.model import base_model, is_rate_driven, with_spread
from rover_pin.experiments.drive_log.resume import Memory
from rover_pin.experiments.drive_log.separating_drive import SeparatingDrive, separating_drive
from rover_pin.experiments.unlisted.residual import DriveResidual, describe
from rover_pin.experiments.unlisted.trial import drafted
from rover_pin.logs.drive_log import DriveLog
from rover_pin.loop.drive_written import write_results
from rover_pin.loop.provenance import LoopRequest, provenance
from rover_pin.report.drive.cautions import cautions
from rover_pin.simulation.model.effect_files import file_of, user_effects
from rover_pin.simulation.model.model import Model

RIVALS = 2
"""Rivals of the best for which a separating run is proposed."""
UNKNOWN = 90.0
"""Strength of a term, after everything listed, from which something that is not on the list is said to act: on null
sets prepared sand showed up to 68 (seed 902)."""
MUCH = 0.1
"""Share of the net gain of what was added from which such a term makes it doubtful: after false names it was 0.15 to
0.3, after true ones no term came near UNKNOWN (seed 1303, once that had been scored)."""


def close_drive_loop(
    log: DriveLog,
    model: Model | None,
    request: LoopRequest,
    progress: Progress = lambda message: None,
    jobs: Workers = 1,
) -> Verdict:
    """Return what a model of a drive log lacks, with the error before and after; see `close_the_loop`.

    `model` is where it starts, read; None takes what the log declares.

    Raises
    ------
    DataError
        A log that cannot be used: one sentence each.
    """
    begun = time.monotonic()
    progress("checking the log")
    refuse_unfit(log)
    poor, start = too_poor(log), model or base_model(log)
    folder, effects = None if request.out is None else Path(request.out), request.effects
    say_what_is_replaced(folder, OF_A_LOOP)
    memory = Memory(folder, "" if folder is None else key_of_code(_code(start, effects)))
    with memory.noting():
        verdict = (
            _poor(log, start, poor) if poor else _decided(log, start, effects, memory, (progress, jobs, request.seed))
        )
        verdict.provenance.update(provenance(request, time.monotonic() - begun))
        if folder is None:
            return verdict
        progress("writing the report")
        verdict = write_results(verdict, log, request, folder)
    memory.done()
    return verdict


def _decided(
    log: DriveLog, start: Model, effects: str | Path | None, memory: Memory, options: tuple[Progress, Workers, int]
) -> Verdict:
    progress, jobs, seed = options
    if memory.status:
        progress(f"going on: {memory.status}")
    base = calibrated_on(log, with_spread(start, motors=not is_rate_driven(log)), jobs, progress, memory)
    search_result = keep_supported_effects(
        search(base, candidates(base.model, logged(base), base.parameters, effects), progress)
    )
    progress("describing what is left")
    return verdict_on(log, search_result, describe(search_result.last, progress), seed, progress)


def _code(model: Model, effects: str | Path | None) -> set[Path]:
    """Return the files with the code of effects: a user's own, and those of the model."""
    user_kinds = user_effects(effects) if effects else ()
    return {file_of(kind) for kind in (*user_kinds, *map(type, model.all_effects))}


def _poor(log: DriveLog, model: Model, poor: str) -> Verdict:
    return Verdict("drive-log", Answer.CANNOT_TELL, log.metadata.name, poor, model, findings=findings(log))


def verdict_on(log: DriveLog, search_result: Search, residual: DriveResidual, seed: int, progress: Progress) -> Verdict:
    """Return the verdict on what was found in a log and what is left; what is doubtful is not in its model."""
    progress("runs left out, and driven freely")
    verdict = make_verdict(
        ("drive-log", log.metadata.name),
        search_result,
        chosen_without(search_result),
        residual_assessment(search_result, residual),
        seed,
    )
    wheels = [wheel.name for wheel in search_result.base.model.rover.wheels]
    added = [candidate for candidate in search_result.added if candidate.name in verdict.named]
    amplitude_names = tuple(name for candidate in added for name in candidate.amplitudes)
    best, experiment = search_result.rounds[0].indistinguishable, logged(search_result.base)
    free = free_runs(experiment, search_result.base.model, verdict.model)
    ground = ground_variability(search_result.last, search_result.random_field)
    odometry = kinematic(experiment, search_result.base.model.rover)
    if verdict.answer is Answer.NONE_FITS:
        verdict = with_draft(verdict, drafted(search_result.last, residual, log.metadata.name, progress), seed)
    return dataclasses.replace(
        verdict,
        baselines=odometry,
        sentence=" ".join(
            filter(None, (with_wheel_names(verdict.sentence, wheels), ground.sentence if ground else ""))
        ),
        findings=findings(log),
        experiments=_experiments(best, progress),
        profiles=profiles(verdict.after.fit, amplitude_names) if amplitude_names and verdict.after else (),
        cautions=(*verdict.cautions, *cautions(verdict, free), *losses(verdict.scores, odometry)),
        extra=DriveExtra(free, residual, ground),
    )


def residual_assessment(search_result: Search, residual: DriveResidual) -> ResidualAssessment:
    """Return what is left, as it is judged."""
    return ResidualAssessment(is_unknown(search_result, residual), residual.best.description, described=True)


def is_unknown(search_result: Search, residual: DriveResidual) -> bool:
    """Return whether a term takes, after everything listed, more than chance and no less than what was added.

    Where sand that was prepared anew is what describes it best, nothing is missing: the model's sand is everywhere one.
    Nor is it where the replays' own error is as large as what is left.
    """
    taken = sum(refit.net for refit in search_result.best_refits)
    is_much = residual.best.strength > max(UNKNOWN, MUCH * taken)
    return is_much and not residual.best.is_raking and not is_within_prediction_error(search_result.last)


def with_wheel_names(sentence: str, wheels: Sequence[str]) -> str:
    """Return a sentence with the wheel's name behind that of a candidate which has the wheel's number only."""

    def with_name(match: re.Match[str]) -> str:
        return f"{match[0]} (wheel {wheels[int(match[1])]})"

    return re.sub(r"\w+\[(\d+)\](?!\.)", with_name, sentence)


def _experiments(best: tuple[Refit, ...], progress: Progress) -> tuple[SeparatingDrive, ...]:
    drives = []
    for rival in best[1 : 1 + RIVALS]:
        progress(f"looking for the run that tells {best[0].name} from {rival.name}")
        drive = separating_drive((best[0].name, best[0].fit), (rival.name, rival.fit), progress)
        drives += [drive] if drive is not None else []
    return tuple(drives)
