"""Measured data of any kind from one path or by the name of a sample: a rig set, a drive log, traction factors."""

from __future__ import annotations

from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file, is_folder
from rover_pin.base.files.samples import closest_samples
from rover_pin.base.trust import Trust
from rover_pin.measurements.channel import Evidence
from rover_pin.measurements.drive_points import read_drive_points
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.measurements.rig_physics import refuse_impossible
from rover_pin.measurements.traction_points import read_traction_points
from rover_pin.measurements.wheel_rig import WheelRig, read_wheel_rig


def read_evidence(path: str | Path, trust: Trust = Trust()) -> Evidence:
    """Return a `WheelRig` (folder with rig.toml), or `TractionPoints` (folder with drive.toml, or a CSV file).

    Raises
    ------
    DataError
        None of these, or what its reader refuses.
    """
    path = Path(path)
    if is_file(path / "rig.toml"):
        rig = read_wheel_rig(path, trust)
        refuse_beyond_soil(rig, path.name)
        return rig
    if is_file(path / "drive.toml"):
        return read_drive_points(path, trust=trust)
    if is_file(path):
        return read_traction_points(path)
    absent = "" if is_folder(path) else "there is no such file or folder; "
    raise DataError(
        f"{path}: {absent}give a folder with rig.toml (wheel rig) or drive.toml (drive log), or a CSV file with the "
        f"columns slip, traction_factor, sd.{closest_samples(path)}"
    )


def refuse_beyond_soil(rig: WheelRig, name: str) -> None:
    """Refuse a rig set that Eqs (2)-(7) alone do not describe: wheels askew, errors of the rig, what no soil gives.

    Raises
    ------
    DataError
        What it is, and what to do.
    """
    if rig.askew.any():
        raise DataError(
            f"{name}: {int(rig.askew.sum())} of {rig.askew.size} runs have a slip angle; identify fits a "
            "wheel that runs straight: give it the straight runs alone, or the whole set to close-loop."
        )
    if rig.errors != RigErrors() or any(parameter.startswith("rig.") for parameter in rig.error_sd):
        raise DataError(
            f"{name}: [rig] states errors of the rig, which identify does not fit: give it to close-loop, "
            "or take them off the points and the table away."
        )
    refuse_impossible(rig)
