"""`rover-pin view`: shows a drive in 3D, as an HTML page, an animated GIF or a film.

`read_subject` reads the drive to show. The command `export` uses this function too.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_pin.base.console import warn
from rover_pin.base.errors import DataError, MissingExtraError
from rover_pin.base.extras import install_command
from rover_pin.base.files.paths import data_path, is_file
from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.jobs.safe_environment import program
from rover_pin.base.trust import Trust
from rover_pin.cli.options import AsJson, Gif, Mp4, Open, Out, Run, Trusted
from rover_pin.cli.terminal import report, stoppable

if TYPE_CHECKING:
    from rover_pin.scenarios.scenario import Scenario
    from rover_pin.simulation.trace.trace import Trace
    from rover_pin.view.film import Subject

PAGE, GIF, MP4 = SEEN = ("view.html", "drive.gif", "drive.mp4")
"""Names of the files that show a drive: the page, the moving picture and the film."""


def view(
    path: Annotated[
        Path, typer.Argument(help="Folder of a drive log, a trace in .parquet, or the TOML file of a drive.")
    ],
    compare: Annotated[Path | None, typer.Option(help="Second drive, which is drawn transparent.")] = None,
    run: Run = "",
    gif: Gif = False,
    mp4: Mp4 = False,
    open_: Open = False,
    trust: Trusted = False,
    out: Out = Path("out/view"),
    as_json: AsJson = False,
) -> None:
    """Show a drive in 3D, as one HTML page that needs no network.

    The page shows the ground, the slip, the forces and the tracks of the rover, and has a slider for the time.
    """
    subject = read_subject(path, run, Trust(everything=trust))
    # The second drive is shown together with the first one.
    ghost = None if compare is None else read_subject(compare, run, Trust(everything=trust))
    wanted = requested_files(True, gif, mp4)
    with stoppable(out, wanted, [name for name in SEEN if name not in wanted]), alone_in(out):
        files = [write_seen(subject, ghost, out / name) for name in wanted]
    report({"seen": subject.name, "files": list(map(str, files))}, as_json)
    if open_:
        open_page(out)


def read_subject(path: Path, run: str = "", trust: Trust = Trust()) -> "Subject":
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
    from rover_pin.base.files.toml_file import table_in
    from rover_pin.logs.drive_log import FILE, load_trace, read_drive_log
    from rover_pin.scenarios.drive_file import is_drive_file
    from rover_pin.scenarios.scenario import scenario
    from rover_pin.scenarios.scenes import SCENES
    from rover_pin.view.film import Subject, mesh_folder, subject_of_log

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
            f"{path}: the trace does not name a scenario of this package, so its rover and terrain are unknown; save "
            "the drive as a drive log with `Scenario.write_log`, and give the folder of the log."
        )
    # The scenario is made again from the settings of the trace, because a trace holds neither rover nor terrain.
    model = scenario(name, **{**settings, "trust": trust}).model
    return Subject(path.stem, trace, model.rover, model.ground, mesh_folder(str(settings.get("rover", "nexus6"))))


def open_page(out: Path, name: str = PAGE) -> None:
    """Open an HTML page of a folder in this machine's browser. If no browser is found, print the path of the page.

    `out` is the folder and `name` is the file of the page.
    """
    import webbrowser

    if is_file(out / name) and webbrowser.open((out / name).resolve().as_uri()) is False:
        warn(f"rover-pin: no browser was found on this machine; open {out / name} in a browser.")


def requested_files(view: bool, gif: bool, mp4: bool) -> list[str]:
    """Return the names of the view files that the user requested with the options --view, --gif and --mp4.

    Raises MissingExtraError: viser or ffmpeg, which such a file needs, is not installed.
    """
    if view and find_spec("viser") is None:
        raise MissingExtraError(f"The view in 3D needs viser. Run `{install_command('view')}`.")
    if mp4 and program("ffmpeg") is None:
        raise MissingExtraError(
            f"{MP4} needs the program ffmpeg, which was not found: install ffmpeg, or use --gif instead of --mp4."
        )
    return [name for name, wanted in {PAGE: view, GIF: gif, MP4: mp4}.items() if wanted]


def write_requested(chosen: "Scenario", trace: "Trace", wanted: list[str], out: Path) -> list[Path]:
    """Write the requested view files of a drive, and return their paths.

    A drive with less than two rows cannot be shown; no file is written then.

    Parameters
    ----------
    chosen : Scenario
        The scenario that was driven.
    trace : Trace
        The recorded drive.
    wanted : list of str
        Names of the files to write, from `requested_files`.
    out : Path
        Folder of the files.
    """
    if not wanted or len(trace.t) < 2:
        return []
    from rover_pin.view.film import Subject, mesh_folder

    meshes = mesh_folder(str(chosen.settings.get("rover", "nexus6")))
    subject = Subject(chosen.name, trace, chosen.model.rover, chosen.model.ground, meshes)
    return [write_seen(subject, None, out / name) for name in wanted]


def write_seen(subject: "Subject", ghost: "Subject | None", file: Path) -> Path:
    """Write an HTML page, a GIF or a film of a drive, depending on the suffix of `file`, and return its path.

    `ghost` is a second drive that is shown transparent, or None.
    """
    if file.suffix == ".html":
        from rover_pin.view.page import write_page

        return write_page(file, subject, ghost)
    from rover_pin.view.animation import write_animation
    from rover_pin.view.film import Film

    # A GIF or a film: the second drive, if given, is drawn over the first one.
    film, *ghosts = (
        Film.of(drive.trace, drive.rover, drive.terrain) for drive in (subject, ghost) if drive is not None
    )
    return write_animation(file, film, subject.name, *ghosts)
