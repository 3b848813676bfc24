"""Reads the drive that `view` and `export` show: from a trace, from a drive log, or from a drive file."""

from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import data_path, is_file
from rover_pin.base.files.toml_file import table_in
from rover_pin.base.trust import Trust
from rover_pin.logs.drive_log import FILE, load_trace, read_drive_log
from rover_pin.scenarios.drive_file import is_drive_file
from rover_pin.scenarios.scenario import scenario
from rover_pin.scenarios.scenes import SCENES
from rover_pin.view.film import Subject, mesh_folder, subject_of_log


def read_subject(path: Path, run: str = "", trust: Trust = Trust()) -> Subject:
    """Return a drive with its rover and its terrain. The drive of a drive file is simulated first.

    Parameters
    ----------
    path : path
        Folder of a drive log, the .parquet file of a trace, or a drive file (.toml). A trace names the scenario that
        simulated the drive, and this scenario has the rover and the terrain.
    run : str
        Name of a run of the drive log; the first run if empty.
    trust : Trust
        The user's consent to run code and to read files that the trace or the log names.

    Raises
    ------
    DataError
        The path is no drive log, no trace and no drive file, the log has no such run, or the trace names no scenario.
    """
    path = data_path(path)
    if is_drive_file(path):
        drive = scenario(path, trust=trust)
        meshes = mesh_folder(str(drive.settings.get("rover", "nexus6")))
        return Subject(path.stem, drive.drive(), drive.model.rover, drive.model.ground, meshes)
    # A folder with a drive log holds the measured drives, and any other path must be the trace of a simulated drive.
    if is_file(path / FILE):
        return subject_of_log(read_drive_log(path, trust), run)
    if path.suffix != ".parquet":
        raise DataError(
            f"{path}: give the folder of a drive log ({FILE}), a trace in .parquet, or a drive file (.toml)."
        )
    trace = load_trace(path)
    settings = table_in(trace.attrs, "settings", path)
    # The settings in a trace come from a file, so they may name no files outside its folder without consent.
    trust.refuse_elsewhere(settings, path)
    name = str(trace.attrs.get("scenario", ""))
    if name not in SCENES:
        raise DataError(
            f"{path}: the trace names no scenario of this package, so its rover and terrain are unknown; save the "
            "drive as a drive log with `Scenario.write_log`."
        )
    # The scenario is made again from the settings of the trace, because a trace holds neither rover nor terrain.
    model = scenario(name, **{**settings, "trust": trust}).model
    return Subject(path.stem, trace, model.rover, model.ground, mesh_folder(str(settings.get("rover", "nexus6"))))
