"""The loop: measured data against a model, the effect that it lacks, the model with it, before and after."""

import dataclasses
import functools
import logging
import os
from pathlib import Path
from typing import Any

from rover_pin.base.errors import DataError, ParameterError
from rover_pin.base.files.paths import is_file, is_folder
from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.files.samples import closest_samples, data_path
from rover_pin.base.files.toml_file import read_toml
from rover_pin.base.jobs.cluster import refuse_both, workers_of
from rover_pin.base.jobs.workers import ending_workers
from rover_pin.base.public import public
from rover_pin.base.trust import Trust
from rover_pin.contact import Soil
from rover_pin.discrepancy.question import Progress
from rover_pin.discrepancy.standalone import Standalone
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.effects.effect import Effect
from rover_pin.effects.normal_damping import NormalDamping
from rover_pin.effects.side_shear import SideShear
from rover_pin.effects.soil_traction import SoilTraction
from rover_pin.experiments.drive_log.model import base_model
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.model import read_model as read_rig_model
from rover_pin.experiments.wheel_rig.sets import read_joint
from rover_pin.logs.drive_log import FILE, DriveLog, read_drive_log
from rover_pin.loop.drive import close_drive_loop
from rover_pin.loop.own_effects import refuse_unfit_effects
from rover_pin.loop.provenance import LoopRequest
from rover_pin.loop.rig import close_rig_loop
from rover_pin.loop.standalone import close_standalone, own_kind, read_standalone
from rover_pin.measurements.rig_file import RIG_FILE
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import RigSet
from rover_pin.rover.rover import Rover
from rover_pin.simulation.model.model import Model, base_effects
from rover_pin.simulation.model.toml_file import KIND, RIG_KIND, read_model
from rover_pin.terrain.shapes import flat


@public
def close_the_loop(
    data: str | Path | RigSet | DriveLog | Standalone | tuple[str | Path, ...],
    model: RigModel | Soil | Model | str | Path | None = None,
    effects: str | Path | None = None,
    out: str | Path | None = None,
    progress: Progress = lambda message: None,
    seed: int = 0,
    jobs: int = 0,
    scheduler: str | None = None,
    experiment: str | Path | None = None,
    trust: bool = False,
) -> Verdict:
    """Find the effect that a model lacks against measured data, add it, and report the error before and after.

    Parameters
    ----------
    data : path, RigSet, DriveLog, Standalone or tuple of paths
        A folder with rig.toml or drive.toml, the name of a sample (`rover-pin list samples`), or the data in memory, as
        `read_data` gives them; several folders with rig.toml are a joint fit: one sand, each its own wheel.
    model : RigModel, Soil, Model, path or None
        Where to start: for a rig a RigModel or a soil, for a drive log a Model, for either a model file; else what the
        data declare.
    effects : path or None
        A user's effect file or folder, beside the package's own.
    out : path or None
        Folder for report.html, verdict.json, model.toml and figures; a drive log's loop that was stopped goes on from
        what it finds there. Nothing is written without.
    progress : callable
        Called with one line before each step.
    seed : int
        Of the starts of fits and of the bootstrap.
    jobs : int
        Processes that replay the runs of a drive log; 0 for all cores.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers then replay them. Start them with `--nthreads 1`.
    experiment : path, str or None
        A test bench of your own: a file with a class that derives from `Standalone`, whose code runs, or `pendulum`.
    trust : bool
        Whether model file and data may run all code, and name all files, that they name.

    Returns
    -------
    Verdict
        With `answer`, `summary()`, `model` (the base model with what was added, if anything) and `as_dict()`.

    Raises
    ------
    DataError
        Data or effect files that cannot be read or used, results that cannot be written, or a folder for them in which
        another process is at work: one sentence each.
    OptimisationError
        The base model of a rig cannot be fitted at all.

    Examples
    --------
    >>> verdict = close_the_loop("cmu-smooth-wheel")
    >>> verdict.answer.value, [type(effect).__name__ for effect in verdict.effects]
    ('one of a set of effects is missing', ['SlipSinkage'])
    """
    refuse_both(jobs or None, scheduler)
    if effects is not None:
        refuse_unfit_effects(effects)
    if isinstance(data, tuple):
        data = tuple(data_path(folder) for folder in data)
        return _jointly(LoopRequest(data, model, effects, out, experiment, trust, seed), progress)
    if isinstance(data, (str, Path)):
        data = data_path(data)
    experiment = experiment or own_kind(data)
    request = LoopRequest(data, model, effects, out, experiment, trust, seed)
    if isinstance(data, Standalone) or experiment is not None:
        if model is not None:
            raise DataError(
                f"{data}: a test bench starts from the model that its own file declares; leave `model` out."
            )
        standalone = data if isinstance(data, Standalone) else read_standalone(str(data), experiment or "")
        with alone_in(out):
            return close_standalone(standalone, request, progress)
    allowed = Trust(everything=trust)
    log = _drive_log(data, allowed)
    if log is not None:
        start = _start(log, request)
        if not isinstance(start, (Model, type(None))):
            raise DataError(
                f"{log.folder}: a drive log starts from a rover's model, not from a {type(start).__name__}."
            )
        if start is not None:
            _refuse_other_rover(log, start)
        request = dataclasses.replace(request, data=log.folder)
        with alone_in(out), ending_workers(), workers_of(jobs or os.cpu_count() or 1, scheduler) as workers:
            return close_drive_loop(log, start, request, progress, workers)
    if isinstance(model, Model):
        raise DataError(f"{data}: a wheel-rig set starts from a wheel's model, not from a rover's.")
    if scheduler is not None:
        raise ParameterError("A wheel-rig set takes one core some seconds: leave scheduler out, it is for drive logs.")
    assert not isinstance(data, DriveLog)
    with alone_in(out):
        rigs = data if isinstance(data, RigSet) else read_rig_set(data, allowed)
        rig, start = RigExperiment((rigs,)), _start(rigs, request)
        start = start if isinstance(start, RigModel) else rig.base_model(start)
        return close_rig_loop(rig, start, request, progress)


def _jointly(request: LoopRequest, progress: Progress) -> Verdict:
    """Return the verdict on several rig sets."""
    for what, value in (("a model", request.model), ("an experiment's file", request.experiment)):
        if value is not None:
            raise DataError(f"{value}: a joint fit of several rig sets does not take {what}; leave it out.")
    with alone_in(request.out):
        joint = read_joint(request.data, Trust(everything=request.trust))
        return close_rig_loop(joint, joint.base_model(), request, progress)


def _start(data: RigSet | DriveLog, request: LoopRequest) -> Any:
    """Return the model to start from, read where it is a file's."""
    if not isinstance(request.model, (str, Path)):
        return request.model
    return start_on(data, request.model, Trust.of(request.effects, request.trust))


def _refuse_other_rover(log: DriveLog, model: Model) -> None:
    log_wheels, model_wheels = _wheels(log.load_rover()), _wheels(model.rover)
    if log_wheels != model_wheels:
        raise DataError(
            f"{log.folder}: the model's rover has the wheels {model_wheels}, the log's {log_wheels}; give its model."
        )


def _wheels(rover: Rover) -> str:
    return ", ".join(wheel.name for wheel in rover.wheels)


def _drive_log(data: object, trust: Trust = Trust()) -> DriveLog | None:
    if isinstance(data, DriveLog):
        return data
    if not isinstance(data, (str, Path)):
        return None
    if is_file(Path(data) / FILE):
        return read_drive_log(data, trust)
    if not is_file(Path(data) / RIG_FILE):
        wrong = f"there is neither {RIG_FILE} nor {FILE} in it" if is_folder(Path(data)) else "there is no such folder"
        wrong = f"this is a file, {wrong}" if is_file(Path(data)) else wrong
        raise DataError(
            f"{data}: {wrong}; give that of a wheel-rig set ({RIG_FILE}) or of a drive log ({FILE}); close-loop also "
            f"takes that of a slip-slope table (slope.toml).{closest_samples(data)}"
        )
    return None


def read_data(data: str | Path, trust: Trust = Trust()) -> RigSet | DriveLog:
    """Return the data in a folder, or a sample's; files that they name lie there, unless `trust` allows more."""
    data = data_path(data)
    return _drive_log(data, trust) or read_rig_set(data, trust)


STEADY = (NormalDamping, SideShear)
"""What of a drive does nothing at a steady wheel that runs straight."""

log = logging.getLogger(__name__)


def start_on(data: RigSet | DriveLog, file: str | Path, trust: Trust = Trust()) -> RigModel | Model:
    """Return the model of a file as a loop on these data can start from it.

    On a drive log a wheel's model gives the soil, the traction law and the effects of the contact; rover, motors and
    ground are the log's. On a rig a rover's model gives the same three; the wheel is the rig's, and what acts elsewhere
    is left out, with a word.

    Raises DataError, ParameterError: what is no model file, or cannot be read; a wheel's model without one
    SoilTraction.
    """
    kind = read_toml(Path(file)).get("kind")
    if isinstance(data, DriveLog):
        of_rig = kind == RIG_KIND
        return _on_drive(data, read_rig_model(file, trust), file) if of_rig else read_model(file, data.terrain(), trust)
    if kind == KIND:
        return _on_rig(data, read_model(file, flat(), trust), file)
    return read_rig_model(file, trust)


def _on_drive(drive: DriveLog, wheel: RigModel, file: str | Path) -> Model:
    tractions = [effect for effect in wheel.effects if isinstance(effect, SoilTraction)]
    if len(tractions) != 1:
        raise DataError(f"{file}: a wheel's model that a rover is to drive on must have one [[effect]] SoilTraction.")
    log_model = base_model(drive)
    effects = base_effects(wheel.soil, log_model.rover, tractions[0], log_model.gravity)
    model = dataclasses.replace(log_model, soils=(wheel.soil, *log_model.soils[1:]), effects=effects)
    return functools.reduce(Model.having, wheel.effects, model)


def _on_rig(data: RigSet, model: Model, file: str | Path) -> RigModel:
    acting = [effect for effect in model.all_effects if effect != model.slip and not isinstance(effect, STEADY)]
    contact = [effect for effect in acting if isinstance(effect, Effect)]
    wheel_effects = tuple(effect for effect in contact if not effect.before_slip and not effect.places)
    omitted = dict.fromkeys(type(effect).__name__ for effect in acting if effect not in wheel_effects)
    if omitted:
        log.warning("%s: %s cannot act at a wheel on a rig: left out.", file, ", ".join(omitted))
    return RigModel(data.wheel, model.soils[0], wheel_effects)
