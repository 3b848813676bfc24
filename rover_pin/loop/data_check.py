"""Measured data checked by themselves, before any fit: refused, warned of, or found fit for the loop."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from rover_pin.base.files.paths import is_file
from rover_pin.base.files.samples import data_path
from rover_pin.base.trust import Trust
from rover_pin.experiments.drive_log.checks.log import check as check_log
from rover_pin.experiments.drive_log.checks.log import data_findings
from rover_pin.experiments.drive_log.checks.log import refuse_unfit as refuse_log
from rover_pin.experiments.joint_rig.sets import read_joint
from rover_pin.experiments.wheel_rig.checks import findings, refuse_unfit, too_poor
from rover_pin.experiments.wheel_rig.data import RigSet
from rover_pin.experiments.wheel_rig.experiment import RigExperiment, as_declared
from rover_pin.logs.drive_log import DriveLog, read_drive_log
from rover_pin.loop.close import read_data
from rover_pin.measurements.channel import Evidence
from rover_pin.measurements.drive_points import points_of_log
from rover_pin.measurements.finding import Finding
from rover_pin.measurements.reading import read_evidence, refuse_beyond_soil
from rover_pin.measurements.wheel_rig import WheelRig


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
    refuse_unfit(data)
    uncertain = RigExperiment(data).uncertain(as_declared(data))
    return DataCheck("wheel-rig", _holds(data), tuple(findings(data)), too_poor(data, len(uncertain)))


class Checked(NamedTuple):
    """Measured data to fit parameters to."""

    evidence: Evidence | tuple[WheelRig, ...]
    "one set, or several in one sand"
    findings: tuple[Finding, ...]
    "what their check found"
    drive: DriveLog | None
    "the log, where they are the points of one"


def checked_evidence(path: str | Path | tuple[str | Path, ...], trust: Trust = Trust()) -> Checked:
    """Return measured data to fit parameters to, and what their check found: a drive log is refused as by the loop.

    What the loop alone lacks, as excitation that tells effects apart, is not among the findings.

    Parameters
    ----------
    path : str, Path or tuple of them
        As `read_evidence` takes it; several are rig sets in one sand, of which a run that is in two is used once.

    Raises
    ------
    DataError
        What `read_evidence` refuses, a drive log that would mislead whatever the model, and what `read_joint` refuses
        of several.
    """
    if isinstance(path, tuple):
        joint = read_joint([data_path(folder) for folder in path], trust)
        for name, data in joint.sets.items():
            refuse_beyond_soil(data.rig, name)
        return Checked(tuple(data.rig for data in joint.sets.values()), joint.twice, None)
    path = data_path(path)
    if is_file(path / "rig.toml") or not is_file(path / "drive.toml"):
        return Checked(read_evidence(path, trust), (), None)
    drive = read_drive_log(path, trust)
    refuse_log(drive)
    return Checked(points_of_log(drive), data_findings(drive), drive)


def _holds(data: RigSet) -> str:
    slips = f"S from {data.rig.slip.min():.2g} to {data.rig.slip.max():.2g}"
    channels = ", ".join(channel.column for channel in data.rig.channels)
    return f"{data.rig.slip.size} runs at {len(data.level_names)} levels, {slips}; {channels}"
