"""Check measured data before any fit. The check refuses the data, warns of suspicious values, or accepts the data."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import closest_samples, data_path, is_file, is_folder
from rover_pin.base.quantity import declared_sds, quantities, record_from
from rover_pin.base.trust import Trust
from rover_pin.discrepancy.experiment import FileExperiment, Parts
from rover_pin.estimation.parameter import declared_in, parameter_of
from rover_pin.experiments.drive_log.checks import log as log_checks
from rover_pin.experiments.drive_log.model import usual_soil
from rover_pin.experiments.soil_priors import DECLARED_SD, MOTOR_SD
from rover_pin.experiments.traction_factors import Shift, TractionFactors
from rover_pin.experiments.wheel_rig.checks import findings, refuse_unfit
from rover_pin.experiments.wheel_rig.experiment import RigExperiment, read_joint
from rover_pin.logs.drive_log import FILE as LOG_FILE
from rover_pin.logs.drive_log import DriveLog, read_drive_log
from rover_pin.loop.close import MADE_BY, loop_data, read_data
from rover_pin.loop.verdict_file import LoopRequest
from rover_pin.measurements.checks import Finding
from rover_pin.measurements.drive_points import IN_POINTS, SAMPLING, drive_points, points_of_log
from rover_pin.measurements.rig_file import RIG_FILE
from rover_pin.measurements.rig_reading import read_rig_set
from rover_pin.measurements.rig_set import RigSet
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.simulation.model.defaults import usual_slip
from rover_pin.simulation.model.motor import Motor

MOTOR_CONSTANTS = ("supply", "resistance", "k_t", "gear")
"""Names of the motor constants that enter the traction factors of a drive log."""


class DataCheck(NamedTuple):
    """Result of the check of measured data that were not refused.

    The search for missing effects can run on these data. If `too_poor` is not empty, the search cannot find an answer.
    """

    kind: str
    "kind of the data: wheel-rig or drive-log"
    holds: str
    """content of the data set in one line, such as the numbers of runs and channels"""
    findings: tuple[Finding, ...]
    too_poor: str
    """reason why the search for missing effects cannot find an answer with these data, and the measurements that are
    needed in addition; empty if the data suffice"""


def check_data(folder: str | Path, trust: Trust = Trust()) -> DataCheck:
    """Check the measured data in a folder, and return the findings. The search for missing effects runs this check too.

    `folder` may also be the name of a sample of the package.

    Raises DataError if the data cannot be used; the message states the place of the fault and the remedy.

    Example: `check_data("cmu-smooth-wheel").findings`.
    """
    data = loop_data(read_data(folder, trust), LoopRequest(folder, trust=trust.everything))
    return DataCheck(data.kind, data.describe(), data.findings(), data.insufficient())


def rig_set_in(folder: str | Path, trust: Trust = Trust()) -> RigSet:
    """Return the wheel-rig set in a folder. `folder` may also be the name of a sample of the package.

    Raises DataError if the data cannot be used or are not a wheel-rig set.
    """
    data = read_data(folder, trust)
    if not isinstance(data, RigSet):
        raise DataError(
            f"{folder}: the option --similarity needs the runs of a wheel rig; give a folder with {RIG_FILE}."
        )
    return data


Measured = RigSet | RigExperiment | FileExperiment | DriveLog
"""The types of measured data in memory to which `identify` can fit the numbers of a base model."""


class CheckedData(NamedTuple):
    """Measured data that passed the data check, together with the findings of this check."""

    data: Measured
    findings: tuple[Finding, ...]


def measured_in(path: str | Path | tuple[str | Path, ...], trust: Trust = Trust()) -> CheckedData:
    """Read and check measured data for `identify`, which fits the numbers of a model to them.

    Parameters
    ----------
    path : str, Path or tuple of them
        A folder with rig.toml, a folder with drive.toml, a CSV file with the columns slip, traction_factor and sd, or
        the name of a sample. If drive.toml declares its [motor], traction factors are computed from the drives;
        otherwise the drives are simulated again with the logged commands. Several paths are wheel-rig sets that were
        measured in one sand.

    Raises
    ------
    DataError
        If a path holds none of these data, or data with a fault that would mislead every model.
    """
    # Several rig sets: one sand, several wheels.
    if isinstance(path, tuple):
        joint = read_joint([data_path(folder) for folder in path], trust)
        refuse_unfit(joint)
        return CheckedData(joint, joint.twice)
    path = data_path(path)
    if is_file(path / RIG_FILE):
        experiment = RigExperiment((read_rig_set(path, trust),))
        refuse_unfit(experiment)
        return CheckedData(experiment, tuple(findings(experiment)))
    if is_file(path / LOG_FILE):
        drive = read_drive_log(path, trust)
        log_checks.refuse_unfit(drive)
        if drive.metadata.motor:
            return CheckedData(factors_of(drive), log_checks.data_findings(drive))
        # Without a declared motor, no torque is known, and so no traction factor. The drives themselves can still be
        # replayed to find the numbers of the soil.
        if poor := log_checks.too_poor(drive):
            raise DataError(f"{path}: {poor}")
        return CheckedData(drive, log_checks.findings(drive))
    if is_file(path):
        return CheckedData(TractionFactors.read(path), ())
    absent = "" if is_folder(path) else "there is no such file or folder; "
    raise DataError(
        f"{path}: {absent}give a folder with {RIG_FILE} (wheel rig) or {LOG_FILE} (drive log), or a CSV file with the "
        f"columns slip, traction_factor, sd.{closest_samples(path)} {MADE_BY}"
    )


def factors_of(log: DriveLog) -> TractionFactors:
    """Return the traction factors of a drive log that declares its [motor], by the method of section 4 of the paper.

    The factors are computed from motor duty and wheel rate. Therefore an error of a motor constant, or of the lag
    between wheel rate and slip, changes the factors of all points together. Each of these errors is described by a
    `Shift`, and its size is fitted together with the other numbers.

    Raises DataError if `points_of_log` refuses the log.
    """
    points = points_of_log(log)
    motor = record_from(Motor, log.metadata.motor, f"{log.file}: [motor]")
    lag = usual_slip(log.load_rover())
    soil = usual_soil(log.load_rover()).replace(**points.declared)
    declared = Parts({"soil": soil, "wheel": points.wheel, "motor": motor, "RelaxedSlip": lag})
    # For each shift, the points are computed again after one number was increased by its standard deviation (SD).
    shifts = []
    sds = declared_sds(log.metadata.motor, Motor, f"{log.file}: [motor]")
    for name in MOTOR_CONSTANTS:
        value = float(getattr(motor, name))
        # If the log states no SD, an assumed fraction of the value is used.
        sd = sds.get(name, MOTOR_SD.get(name, 0.0) * value)
        # The standard deviations of the points already contain the declared errors of some constants.
        if sd > 0.0 and not (name in sds and name in IN_POINTS):
            source = declared_in("motor", name, log.metadata.motor, sds)
            number = parameter_of(f"motor.{name}", motor, sd, declared=source)
            shifted = drive_points(log, motor.replace(**{name: value + sd}))
            shifts.append(Shift(number, _factor_shift(shifted, points)))
    # A log cannot declare the numbers of the slip's lag, so their SD is assumed to be DECLARED_SD times their value.
    for name in quantities(lag):
        value = float(getattr(lag, name))
        sd = DECLARED_SD * value
        if sd > 0.0:
            shifted = drive_points(log, motor, SAMPLING, lag.replace(**{name: value + sd}))
            shifts.append(Shift(parameter_of(f"RelaxedSlip.{name}", lag, sd), _factor_shift(shifted, points)))
    return TractionFactors(points, declared, tuple(shifts), log.metadata.name)


def _factor_shift(shifted: TractionPoints, points: TractionPoints) -> np.ndarray:
    """Return the error of the traction factors (n,) that a wrong number, such as a motor constant, causes.

    `points` (n) were computed with the right number, and `shifted` with the wrong number. The result is the factors of
    `points` minus the factors of `shifted`. The two can differ in length, so each point is compared with the shifted
    point that is nearest in slip and load. As a rule, both points come from the same class of slip and load.
    """
    # Slip in units of the width of a slip class, and log load in units of the width of a load class.
    places = []
    for factors in (points, shifted):
        loads = factors.loads
        log_loads = np.log(loads) / SAMPLING.loads if loads.size else np.zeros(len(factors.slip))
        places.append(np.column_stack([factors.slip * SAMPLING.levels, log_loads]))
    distance = np.linalg.norm(places[0][:, None] - places[1][None], axis=2)
    return np.asarray(points.factor - shifted.factor[distance.argmin(axis=1)])
