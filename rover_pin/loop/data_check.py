"""Measured data checked by themselves, before any fit: refused, warned of, or found fit for the loop."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file, is_folder
from rover_pin.base.files.samples import closest_samples, data_path
from rover_pin.base.quantity import declared_sds, quantities, record_from
from rover_pin.base.trust import Trust
from rover_pin.discrepancy.standalone import Parts, Standalone
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.estimation.parameter import declared_in, parameter_of
from rover_pin.experiments.drive_log.checks import log as log_checks
from rover_pin.experiments.drive_log.model import MOTOR_SD, usual_soil
from rover_pin.experiments.traction_factors import Shift, TractionFactors
from rover_pin.experiments.wheel_rig.checks import findings, refuse_unfit, too_poor
from rover_pin.experiments.wheel_rig.experiment import RigExperiment
from rover_pin.experiments.wheel_rig.sets import read_joint
from rover_pin.logs.drive_log import FILE as LOG_FILE
from rover_pin.logs.drive_log import DriveLog, read_drive_log
from rover_pin.loop.close import read_data
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.drive_points import IN_POINTS, SAMPLING, drive_points, points_of_log
from rover_pin.measurements.known import DECLARED_SD
from rover_pin.measurements.rig_file import RIG_FILE
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import RigSet
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.simulation.model.defaults import usual_slip
from rover_pin.simulation.model.motor import Motor

OF_MOTOR = ("supply", "resistance", "k_t", "gear")


def factors_of(log: DriveLog) -> TractionFactors:
    """Return the traction factors of a drive log that declares its [motor], as section 4 of the paper takes them.

    Raises DataError: what `points_of_log` refuses.
    """
    points = points_of_log(log)
    motor = record_from(Motor, log.metadata.motor, f"{log.file}: [motor]")
    lag = usual_slip(log.load_rover())
    soil = usual_soil(log.load_rover()).replace(**points.declared)
    declared = Parts({"soil": soil, "wheel": points.wheel, "motor": motor, "RelaxedSlip": lag})
    shifts = (*_of_motor(log, motor, points), *_of_lag(log, motor, lag, points))
    return TractionFactors(points, declared, shifts, log.metadata.name)


def _of_motor(log: DriveLog, motor: Motor, points: TractionPoints) -> Iterator[Shift]:
    """Yield the motor's constants whose error is not among those that the points share."""
    sds = declared_sds(log.metadata.motor, Motor, f"{log.file}: [motor]")
    for name in OF_MOTOR:
        value = float(getattr(motor, name))
        sd = sds.get(name, MOTOR_SD.get(name, 0.0) * value)
        if sd > 0.0 and not (name in sds and name in IN_POINTS):
            source = declared_in("motor", name, log.metadata.motor, sds)
            number = parameter_of(f"motor.{name}", motor, sd, declared=source)
            yield Shift(number, _moved_factor(drive_points(log, motor.replace(**{name: value + sd})), points))


def _of_lag(log: DriveLog, motor: Motor, lag: RelaxedSlip, points: TractionPoints) -> Iterator[Shift]:
    """Yield length and damping of the lag of the slip, which nobody declares."""
    for name in quantities(lag):
        value = float(getattr(lag, name))
        sd = DECLARED_SD * value
        if sd > 0.0:
            shifted = drive_points(log, motor, SAMPLING, lag.replace(**{name: value + sd}))
            yield Shift(parameter_of(f"RelaxedSlip.{name}", lag, sd), _moved_factor(shifted, points))


def _moved_factor(shifted: TractionPoints, points: TractionPoints) -> np.ndarray:
    """Return what a model must add to its factor at each point where the log was read with a wrong number.

    The points of the right number are higher by their difference; each is compared with the nearest of them by slip
    and load, which is as a rule of the same class.
    """
    places = [np.column_stack([each.slip * SAMPLING.levels, _log_load(each)]) for each in (points, shifted)]
    distance = np.linalg.norm(places[0][:, None] - places[1][None], axis=2)
    return np.asarray(points.factor - shifted.factor[distance.argmin(axis=1)])


def _log_load(points: TractionPoints) -> np.ndarray:
    loads = points.loads
    return np.log(loads) / SAMPLING.loads if loads.size else np.zeros(len(points.slip))


class DataCheck(NamedTuple):
    """What the check of data that can be used found."""

    kind: str
    "wheel-rig or drive-log"
    holds: str
    "what is in it, in one line"
    findings: tuple[Finding, ...]
    too_poor: str
    "why the loop would not tell, and what would; empty where it can"


def check_data(folder: str | Path, trust: Trust = Trust()) -> DataCheck:
    """Return what the loop would say of these data before it fits anything.

    Raises DataError: data that cannot be used, in one sentence: what, where, what to do.
    """
    data = read_data(folder, trust)
    if isinstance(data, DriveLog):
        log_checks.refuse_unfit(data)
        seconds = sum(float(run.t[-1] - run.t[0]) for run in data.runs)
        holds = f"{len(data.runs)} runs, {seconds:.0f} s, rover {data.metadata.rover}"
        return DataCheck("drive-log", holds, log_checks.findings(data), log_checks.too_poor(data))
    experiment = RigExperiment((data,))
    refuse_unfit(experiment)
    uncertain = experiment.uncertain(experiment.base_model())
    slips = f"S from {data.slip.min():.2g} to {data.slip.max():.2g}"
    channels = ", ".join(channel.column for channel in data.channels)
    holds = f"{data.slip.size} runs at {len(data.level_names)} levels, {slips}; {channels}"
    return DataCheck("wheel-rig", holds, tuple(findings(experiment)), too_poor(experiment, len(uncertain)))


def rig_set_in(folder: str | Path, trust: Trust = Trust()) -> RigSet:
    """Return the wheel-rig set of a folder or sample; refuses what has no runs of a wheel at levels.

    Raises DataError: data that cannot be used, or of another kind.
    """
    data = read_data(folder, trust)
    if not isinstance(data, RigSet):
        raise DataError(f"{folder}: similarity is of a wheel rig's runs; give a folder with {RIG_FILE}.")
    return data


Measured = RigSet | RigExperiment | Standalone
"""Data to whose base model numbers can be fitted."""


class Checked(NamedTuple):
    """Measured data to fit numbers to, and what their check found."""

    data: Measured
    findings: tuple[Finding, ...]


def measured_in(path: str | Path | tuple[str | Path, ...], trust: Trust = Trust()) -> Checked:
    """Return measured data to fit numbers to, and what their check found.

    Parameters
    ----------
    path : str, Path or tuple of them
        A folder with rig.toml; one with drive.toml, of which the traction factors are taken; a CSV file of slip,
        traction_factor and sd; the name of a sample. Several are rig sets in one sand.

    Raises
    ------
    DataError
        None of these, or data that mislead whatever the model.
    """
    if isinstance(path, tuple):
        joint = read_joint([data_path(folder) for folder in path], trust)
        refuse_unfit(joint)
        return Checked(joint, joint.twice)
    path = data_path(path)
    if is_file(path / RIG_FILE):
        experiment = RigExperiment((read_rig_set(path, trust),))
        refuse_unfit(experiment)
        return Checked(experiment, tuple(findings(experiment)))
    if is_file(path / LOG_FILE):
        drive = read_drive_log(path, trust)
        log_checks.refuse_unfit(drive)
        return Checked(factors_of(drive), log_checks.data_findings(drive))
    if is_file(path):
        return Checked(TractionFactors.read(path), ())
    absent = "" if is_folder(path) else "there is no such file or folder; "
    raise DataError(
        f"{path}: {absent}give a folder with {RIG_FILE} (wheel rig) or {LOG_FILE} (drive log), or a CSV file with the "
        f"columns slip, traction_factor, sd.{closest_samples(path)}"
    )
