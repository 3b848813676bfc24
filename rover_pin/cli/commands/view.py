"""`rover-pin view`: a drive in 3D, as one page, and as a moving picture."""

import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rover_pin.base.errors import MissingExtraError
from rover_pin.base.files.paths import is_file
from rover_pin.base.files.results_folder import alone_in
from rover_pin.base.jobs.safe_environment import program
from rover_pin.base.trust import Trust
from rover_pin.cli.options import AsJson, Out, Trusted
from rover_pin.cli.terminal import report, stoppable

if TYPE_CHECKING:
    from rover_pin.scenarios.scenario import Scenario
    from rover_pin.simulation.trace.trace import Trace
    from rover_pin.view.subject import Subject

PAGE, GIF, MP4 = SEEN = ("view.html", "drive.gif", "drive.mp4")


def view(
    path: Annotated[Path, typer.Argument(help="A drive log's folder, or a trace in .parquet.")],
    compare: Annotated[Path | None, typer.Option(help="Another one, shown as its ghost.")] = None,
    run: Annotated[str, typer.Option(help="Which run of a log; its first, if not said.")] = "",
    gif: Annotated[bool, typer.Option("--gif", help="Write a moving picture too.")] = False,
    mp4: Annotated[bool, typer.Option("--mp4", help="Write a film too; needs ffmpeg.")] = False,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in your browser.")] = False,
    trust: Trusted = False,
    out: Out = Path("out/view"),
    as_json: AsJson = False,
) -> None:
    """Show a drive in 3D: one page that needs no network. It has ground, slip, forces, tracks and a time slider."""
    from rover_pin.cli.subject import read_subject

    subject = read_subject(path, run, Trust(everything=trust))
    ghost = None if compare is None else read_subject(compare, run, Trust(everything=trust))
    wanted = requested_files(True, gif, mp4)
    with stoppable(out, wanted, [name for name in SEEN if name not in wanted]), alone_in(out):
        files = [write_seen(subject, ghost, out / name) for name in wanted]
    report({"seen": subject.name, "files": list(map(str, files))}, as_json)
    if open_:
        open_page(out)


def open_page(out: Path, name: str = PAGE) -> None:
    """Open the page that was written to a folder in the browser of this machine, if it has one."""
    import webbrowser

    if is_file(out / name) and webbrowser.open((out / name).resolve().as_uri()) is False:
        print(f"rover-pin: no browser was found on this machine; open {out / name} in one.", file=sys.stderr)


def requested_files(view: bool, gif: bool, mp4: bool) -> list[str]:
    """Return the names of the files that are asked for; what they need is looked for before any work.

    Raises MissingExtraError: viser or ffmpeg is not there.
    """
    if view and find_spec("viser") is None:
        raise MissingExtraError("The view in 3D needs viser: pip install 'rover-pin[view]'.")
    if mp4 and program("ffmpeg") is None:
        raise MissingExtraError(f"{MP4} needs ffmpeg, which is not on the path: install it, or ask for --gif.")
    return [name for name, wanted in {PAGE: view, GIF: gif, MP4: mp4}.items() if wanted]


def write_requested(chosen: "Scenario", trace: "Trace", wanted: list[str], out: Path) -> list[Path]:
    """Write pages and moving pictures of a drive just driven; return their paths, none where it has not moved on."""
    if not wanted or len(trace.t) < 2:
        return []
    from rover_pin.view.subject import Subject, mesh_folder

    meshes = mesh_folder(str(chosen.settings.get("rover", "nexus6")))
    subject = Subject(chosen.name, trace, chosen.model.rover, chosen.model.ground, meshes)
    return [write_seen(subject, None, out / name) for name in wanted]


def write_seen(subject: "Subject", ghost: "Subject | None", file: Path) -> Path:
    """Write a page or a moving picture, by the file's name; return its path."""
    if file.suffix == ".html":
        from rover_pin.view.page import write_page

        return write_page(file, subject, ghost)
    from rover_pin.view.animation import write_animation
    from rover_pin.view.film import Film

    film, *ghosts = (
        Film.of(drive.trace, drive.rover, drive.terrain) for drive in (subject, ghost) if drive is not None
    )
    return write_animation(file, film, subject.name, *ghosts)
