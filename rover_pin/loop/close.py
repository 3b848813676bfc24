"""Close the loop on measured data: find the effect that the model lacks, add it, and report the error before and
after.
"""

import dataclasses
import os
import time
from collections.abc import Sequence
from pathlib import Path

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.paths import closest_samples, data_path, is_file, is_folder
from rover_pin.base.files.results_folder import LOOP_RESULTS, alone_in, say_what_is_replaced
from rover_pin.base.jobs.cluster import Workers, refuse_both, workers_of
from rover_pin.base.jobs.workers import ending_workers
from rover_pin.base.public import public
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.conclude import conclude
from rover_pin.discrepancy.experiment import FileExperiment
from rover_pin.discrepancy.question import LoopData, Progress, quiet
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.checks.log import refuse_unfit as refuse_unfit_log
from rover_pin.experiments.drive_log.loop_data import DriveLogData, start_on_log
from rover_pin.experiments.wheel_rig.candidates import effect_kinds
from rover_pin.experiments.wheel_rig.checks import refuse_unfit as refuse_unfit_rig
from rover_pin.experiments.wheel_rig.experiment import RigExperiment, read_joint
from rover_pin.experiments.wheel_rig.loop_data import RigData, start_on_rig
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.logs.drive_log import FILE, DriveLog, read_drive_log
from rover_pin.loop.own_code import (
    experiment_of_folder,
    read_experiment,
    refuse_unfit_effects,
    refuse_unfit_offered_effects,
)
from rover_pin.loop.verdict_file import LoopRequest, provenance, write_results
from rover_pin.measurements.rig_file import RIG_FILE
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import RigSet
from rover_pin.simulation.model.effect_files import known_effects
from rover_pin.simulation.model.model import Model

Measurements = RigSet | RigExperiment | DriveLog | FileExperiment
"""The types of measured data in memory on which the search for missing effects can run."""


@public
def close_the_loop(
    data: str | Path | RigSet | DriveLog | FileExperiment | tuple[str | Path, ...],
    model: RigModel | Soil | Model | str | Path | None = None,
    effects: str | Path | None = None,
    out: str | Path | None = None,
    progress: Progress = quiet,
    seed: int = 0,
    jobs: int = 0,
    scheduler: str | None = None,
    experiment: str | Path | None = None,
    trust: bool = False,
) -> Verdict:
    """Find the effect that a model lacks compared with measured data, add it, and report the error before and after.

    Parameters
    ----------
    data : path, RigSet, DriveLog, FileExperiment or tuple of paths
        A folder with rig.toml or drive.toml, the name of a sample (`rover-pin list samples`), or data in memory from
        `read_data`. Several folders with rig.toml give a joint fit: one common sand, and one wheel for each folder.
    model : RigModel, Soil, Model, path or None
        Model to start from: a RigModel or a soil for a rig, a Model for a drive log, or a model file for either. By
        default the model that the data declare.
    effects : path or None
        Effect file or folder of a user, in addition to the effects of the package.
    out : path or None
        Folder for report.html, verdict.json, model.toml and figures. If a loop on a drive log was stopped, the next
        call continues from the results in this folder. Without `out`, nothing is written.
    progress : callable
        Called with one line of text before each step.
    seed : int
        Seed for the initial guesses of the fits and for the bootstrap.
    jobs : int
        Number of processes that replay the runs of a drive log; 0 for all cores.
    scheduler : str, optional
        Address of a Dask scheduler whose workers replay the runs instead. Start the workers with `--nthreads 1`.
    experiment : path, str or None
        Your own experiment: a Python file with a class that derives from `FileExperiment`, or `pendulum`. The code of
        the file is run.
    trust : bool
        True: the model file and the data may run all code and open all files that they name.

    Returns
    -------
    Verdict
        With `answer`, `summary()`, `model` (the base model with the added effects, if any) and `as_dict()`.

    Raises
    ------
    DataError
        If data or effect files cannot be read or used, if the results cannot be written, or if another process writes
        to the folder.
    ParameterError
        If both `jobs` and `scheduler` are given, or a scheduler for data other than a drive log.
    OptimisationError
        If the base model cannot be fitted at all.

    Examples
    --------
    >>> verdict = close_the_loop("cmu-smooth-wheel")
    >>> verdict.answer.value, [type(effect).__name__ for effect in verdict.effects]
    ('one of a set of effects is missing', ['SlipSinkage'])
    """
    # Contradictory arguments and effects with mistakes are refused before any data are read.
    refuse_both(jobs or None, scheduler)
    if effects is not None:
        refuse_unfit_effects(effects)
    refuse_unfit_offered_effects()
    if isinstance(data, tuple):
        data = tuple(data_path(folder) for folder in data)
    elif isinstance(data, (str, Path)):
        data = data_path(data)
        experiment = experiment or experiment_of_folder(data)
    request = LoopRequest(data, model, effects, out, experiment, trust, seed)
    # The kind of the data is known after reading. For a drive log, the request then names the folder of the log.
    measurements = _read(request)
    if isinstance(measurements, DriveLog):
        request = dataclasses.replace(request, data=measurements.folder)
    elif scheduler is not None:
        raise ParameterError(
            "scheduler is given, but only a drive log is analysed with a scheduler; for other data the search for "
            "missing effects takes some seconds on one core. Leave scheduler out."
        )
    # The folder stays locked, and Ctrl-C ends the workers, until the last file has been written.
    with alone_in(out), ending_workers(), workers_of(jobs or os.cpu_count() or 1, scheduler) as workers:
        return close(loop_data(measurements, request, workers, progress), request, progress)


def close(data: LoopData, request: LoopRequest, progress: Progress = quiet) -> Verdict:
    """Run the search for missing effects on checked data, and return the verdict.

    If the request names a folder for results, the results are written there.
    """
    start = time.monotonic()
    # The log states that old results will be replaced. It does so only now, because a refused run replaces nothing.
    say_what_is_replaced(request.out, LOOP_RESULTS)
    with data.resuming(progress):
        verdict = verdict_on(data, known_effects(request.effects), progress, request.seed)
        verdict.provenance.update(provenance(request, time.monotonic() - start))
        if request.out is None:
            return verdict
        progress("writing the report")
        return write_results(verdict, data, request)


def verdict_on(
    data: LoopData, kinds: Sequence[type] | None = None, progress: Progress = quiet, seed: int = 0
) -> Verdict:
    """Return the verdict of the search for missing effects on checked data.

    The verdict includes the results that only this kind of data has, such as further errors and cautions.

    If the data are insufficient, the answer is "cannot tell", and no model is fitted.

    `kinds` are the classes of effects that may be missing, by default the classes of the package and of other installed
    packages. `seed` is the seed for the initial guesses of the fits and for the bootstrap.
    """
    findings = data.findings()
    if reason := data.insufficient():
        return Verdict(data.kind, Answer.CANNOT_TELL, data.name, reason, data.base_model(), findings=findings)
    # The question holds the data, the base model, its free numbers, and the effects that may be missing.
    question = data.question(known_effects() if kinds is None else kinds, progress)
    verdict = dataclasses.replace(conclude(question, progress, seed), findings=findings)
    return data.extra(verdict, question, progress, seed)


def loop_data(
    measurements: Measurements, request: LoopRequest, workers: Workers = 1, progress: Progress = quiet
) -> LoopData:
    """Check measured data, and return them together with the starting model of the search for missing effects.

    `request` holds the user's arguments, such as the model to start from. `workers` replay the runs of a drive log.

    Raises DataError if the data cannot be used, or if the requested model does not suit them.
    """
    trust = Trust.of(request.effects, request.trust)
    if isinstance(measurements, FileExperiment):
        if request.model is not None:
            raise DataError(
                f"{request.data}: an experiment starts from the model that its own file declares; leave `model` out."
            )
        return measurements
    if isinstance(measurements, DriveLog):
        log = DriveLogData.starting_from(measurements, request.model, workers, trust)
        progress("checking the log")
        refuse_unfit_log(measurements)
        # Results for resuming are stored only if the log suffices for an answer. Otherwise no model is built at all.
        folder = None if request.out is None or log.insufficient() else Path(request.out)
        return log.remembering(folder, request.effects)
    if isinstance(measurements, RigSet):
        rig = RigData.starting_from(measurements, request.model, trust)
    else:
        rig = RigData(measurements)
    refuse_unfit_rig(rig.experiment)
    if request.effects is not None:
        # A rig shows only effects of the contact. The call refuses the user's effects if none of them is one.
        effect_kinds(request.effects)
    return rig


def _read(request: LoopRequest) -> Measurements:
    """Return the measured data that a request names. Data that are already in memory are returned unchanged.

    Raises DataError if the data cannot be read, or if a joint fit is requested with a model or with an experiment file.
    """
    data, trust = request.data, Trust(everything=request.trust)
    # Several folders give a joint fit of rig sets, which can use neither a model nor an experiment file.
    if isinstance(data, tuple):
        for noun, value in (("a model", request.model), ("an experiment's file", request.experiment)):
            if value is not None:
                raise DataError(f"{value}: a joint fit of several rig sets cannot use {noun}; leave it out.")
        return read_joint(data, trust)
    if isinstance(data, FileExperiment):
        return data
    if request.experiment is not None:
        return read_experiment(str(data), request.experiment)
    return data if isinstance(data, (RigSet, DriveLog)) else read_data(data, trust)


def read_data(data: str | Path, trust: Trust = Trust()) -> RigSet | DriveLog:
    """Read the wheel-rig set or the drive log in a folder. `data` may also be the name of a sample of the package.

    The data may name files in their own folder only, unless `trust` allows more.

    Raises DataError if the folder holds neither a wheel-rig set nor a drive log, or if a file cannot be read.
    """
    path = data_path(data)
    if is_file(path / FILE):
        return read_drive_log(path, trust)
    if is_file(path / RIG_FILE):
        return read_rig_set(path, trust)
    if is_file(path):
        raise DataError(f"{path}: this is a file, but a folder with {RIG_FILE} or {FILE} is needed. {MADE_BY}")
    wrong = f"there is neither {RIG_FILE} nor {FILE} in it" if is_folder(path) else "there is no such folder"
    raise DataError(
        f"{path}: {wrong}; give the folder of a wheel-rig set ({RIG_FILE}), of a drive log ({FILE}), or, for "
        f"close-loop, of a slip-slope table (slope.toml).{closest_samples(path)} {MADE_BY}"
    )


MADE_BY = (
    f"`rover-pin init TABLE` makes a folder with {RIG_FILE} from a table of a wheel's steady runs, and "
    f"`rover-pin import-log FILES` makes a folder with {FILE} from a rover's recordings."
)
"""Sentence at the end of an error for a user who has a table or a recording, but no folder of data yet."""


def start_on(data: RigSet | DriveLog, file: str | Path, trust: Trust = Trust()) -> RigModel | Model:
    """Read a model file, and return it as the starting model of the search for missing effects on these data.

    See `start_on_log` for a drive log, and `start_on_rig` for a wheel-rig set.

    Raises DataError or ParameterError if the file is not a model file, cannot be read, or does not suit the data.
    """
    return start_on_log(data, file, trust) if isinstance(data, DriveLog) else start_on_rig(data, file, trust)
