"""Measured data checked by themselves, before any fit: refused, warned of, or found fit for the loop."""

from pathlib import Path
from typing import NamedTuple

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file, is_folder
from rover_pin.base.files.samples import closest_samples, data_path
from rover_pin.base.trust import Trust
from rover_pin.discrepancy.standalone import Standalone
from rover_pin.experiments.drive_log.checks.log import check as check_log
from rover_pin.experiments.drive_log.checks.log import data_findings
from rover_pin.experiments.drive_log.checks.log import refuse_unfit as refuse_log
from rover_pin.experiments.rig_sets.checks import findings_of, refuse_unfit, too_poor
from rover_pin.experiments.rig_sets.experiment import RigExperiment
from rover_pin.experiments.rig_sets.sets import read_joint
from rover_pin.experiments.traction_factors import TractionFactors
from rover_pin.experiments.wheel_rig.data import RIG_FILE, RigSet, read_rig_set
from rover_pin.logs.drive_log import FILE as LOG_FILE
from rover_pin.logs.drive_log import DriveLog, read_drive_log
from rover_pin.loop.close import read_data
from rover_pin.loop.derived_points import factors_of
from rover_pin.measurements.finding import Finding


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

    Raises
    ------
    DataError
        Data that cannot be used, in one sentence: what, where, what to do.
    """
    data = read_data(folder, trust)
    if isinstance(data, DriveLog):
        log_check = check_log(data)
        seconds = sum(float(run.t[-1] - run.t[0]) for run in data.runs)
        holds = f"{len(data.runs)} runs, {seconds:.0f} s, rover {data.metadata.rover}"
        return DataCheck("drive-log", holds, log_check.findings, log_check.too_poor)
    experiment = RigExperiment((data,))
    refuse_unfit(experiment)
    uncertain = experiment.uncertain(experiment.base_model())
    return DataCheck("wheel-rig", _holds(data), tuple(findings_of(experiment)), too_poor(experiment, len(uncertain)))


def rig_set_in(folder: str | Path, trust: Trust = Trust()) -> RigSet:
    """Return the wheel-rig set of a folder or sample; refuses what has no runs of a wheel at levels.

    Raises
    ------
    DataError
        Data that cannot be used, or of another kind.
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
        return Checked(experiment, tuple(findings_of(experiment)))
    if is_file(path / LOG_FILE):
        drive = read_drive_log(path, trust)
        refuse_log(drive)
        return Checked(factors_of(drive), data_findings(drive))
    if is_file(path):
        return Checked(TractionFactors.read(path), ())
    absent = "" if is_folder(path) else "there is no such file or folder; "
    raise DataError(
        f"{path}: {absent}give a folder with {RIG_FILE} (wheel rig) or {LOG_FILE} (drive log), or a CSV file with the "
        f"columns slip, traction_factor, sd.{closest_samples(path)}"
    )


def _holds(data: RigSet) -> str:
    slips = f"S from {data.rig.slip.min():.2g} to {data.rig.slip.max():.2g}"
    channels = ", ".join(channel.column for channel in data.rig.channels)
    return f"{data.rig.slip.size} runs at {len(data.level_names)} levels, {slips}; {channels}"
