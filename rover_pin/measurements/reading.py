"""Measured data of any kind from one path: a wheel-rig set, a drive log, or a table of traction factors."""

from __future__ import annotations

from pathlib import Path

from rover_pin.errors import DataError
from rover_pin.measurements.channel import Evidence
from rover_pin.measurements.drive_points import read_drive_points
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.measurements.rig_physics import refuse_impossible
from rover_pin.measurements.traction_points import read_traction_points
from rover_pin.measurements.wheel_rig import WheelRig, read_wheel_rig
from rover_pin.paths import is_file
from rover_pin.trust import Trust


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
    absent = "" if path.is_dir() else "there is no such file or folder; "
    raise DataError(
        f"{path}: {absent}give a folder with rig.toml (wheel rig) or drive.toml (drive log), or a CSV file with the "
        "columns slip, traction_factor, sd."
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
    if rig.errors != RigErrors() or any(each.startswith("rig.") for each in rig.error_sd):
        raise DataError(
            f"{name}: [rig] states errors of the rig, which identify does not fit: give it to close-loop, "
            "or take them off the points and the table away."
        )
    refuse_impossible(rig)
