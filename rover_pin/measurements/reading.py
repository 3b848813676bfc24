"""Measured data of any kind from one path or by the name of a sample: a rig set, a drive log, traction factors."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from rover_pin.errors import DataError, closest
from rover_pin.measurements.channel import Evidence
from rover_pin.measurements.drive_points import read_drive_points
from rover_pin.measurements.rig_errors import RigErrors
from rover_pin.measurements.rig_physics import refuse_impossible
from rover_pin.measurements.traction_points import read_traction_points
from rover_pin.measurements.wheel_rig import WheelRig, read_wheel_rig
from rover_pin.paths import exists, is_file, is_folder
from rover_pin.trust import Trust


def sample_folder() -> Path:
    """Return the folder of the samples: inside an installed package, or beside it in a checkout."""
    package = Path(str(files("rover_pin")))
    inside = package / "samples"
    return inside if inside.is_dir() else package.parent / "studies" / "data"


def sample_names() -> list[str]:
    """Return the names of the samples."""
    return sorted(folder.name for folder in sample_folder().iterdir() if folder.is_dir())


def data_path(location: str | Path) -> Path:
    """Return where data lie: what is given if it exists, else the sample, or its file, of this name, else the given."""
    path = Path(location)
    sample = sample_folder() / path
    is_named = path.parts and not path.is_absolute() and ".." not in path.parts
    return sample if is_named and not exists(path) and exists(sample) else path


def closest_samples(location: str | Path) -> str:
    """Return the tail of an unknown-data message: which sample a name may have meant; of a path or a folder nothing."""
    path = Path(location)
    return f" Of samples {closest(path, sample_names())}" if len(path.parts) == 1 and not exists(path) else ""


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
