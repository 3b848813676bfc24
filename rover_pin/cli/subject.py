"""What `view` and `export` are given: a trace's file, or the folder of a drive log."""

from pathlib import Path

from rover_pin.base.errors import DataError
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.samples import data_path
from rover_pin.base.files.toml_file import table_in
from rover_pin.base.trust import Trust
from rover_pin.logs.drive_log import FILE, read_drive_log
from rover_pin.logs.saved import load_trace
from rover_pin.scenarios.scenario import scenario
from rover_pin.scenarios.scenes import SCENES
from rover_pin.view.subject import Subject, mesh_folder, subject_of_log


def read_subject(path: Path, run: str = "", trust: Trust = Trust()) -> Subject:
    """Return what a drive log or a trace's file shows; a log's first run unless another is named.

    The file of a trace alone names the scenario that made it, whose rover and ground are taken.

    Raises DataError: it is neither, the log has no such run, or the trace tells no scenario.
    """
    path = data_path(path)
    if is_file(path / FILE):
        return subject_of_log(read_drive_log(path, trust), run)
    if path.suffix != ".parquet":
        raise DataError(f"{path}: give the folder of a drive log ({FILE}), or a trace that was saved as .parquet.")
    trace = load_trace(path)
    settings = table_in(trace.attrs, "settings", path)
    trust.refuse_elsewhere(settings, path)
    name = str(trace.attrs.get("scenario", ""))
    if name not in SCENES:
        raise DataError(
            f"{path}: the trace says no scenario, so its ground is not known; save it as a drive log: "
            "`Scenario.write_log`."
        )
    model = scenario(name, **{**settings, "trust": trust}).model
    return Subject(path.stem, trace, model.rover, model.ground, mesh_folder(str(settings.get("rover", "nexus6"))))
