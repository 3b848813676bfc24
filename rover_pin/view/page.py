"""One HTML page that shows a drive in 3D. It needs only a browser, no network and no server."""

import io
import re
import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.encode import html_text
from rover_pin.base.files.whole_file import replace_file
from rover_pin.view.film import Film
from rover_pin.view.panel import panel_of
from rover_pin.view.shapes import shapes_of
from rover_pin.view.stage import BLUE, ORANGE, Ghost, Stage
from rover_pin.view.subject import Subject

COLOURS, HOST = {"blue": BLUE, "orange": ORANGE}, "127.0.0.1"
"""COLOURS: word for the colour of a ghost in the panel -> its colour. HOST: network address that only programs on this
computer can reach."""


def write_page(file: Path, subject: Subject, ghost: Subject | None = None) -> Path:
    """Write an HTML page that shows a drive in 3D, with a second drive as its ghost if one is given; return the path of
    the page.

    Raises DataError: a trace has fewer than two rows or no x and y of the body, the ghost is a drive of another rover,
    or the file cannot be written.
    """
    return replace_file(file, page_of(subject, () if ghost is None else ((ghost, "blue"),)))


def page_of(subject: Subject, others: Sequence[tuple[Subject, str]] = ()) -> str:
    """Return the text of an HTML page that shows a drive in 3D.

    Parameters
    ----------
    subject : Subject
        The drive.
    others : sequence of (Subject, str)
        Other drives of this rover, drawn transparent as ghosts, each with the word for its colour (a key of COLOURS).

    Raises
    ------
    DataError
        A trace has fewer than two rows or no x and y of the body, or a ghost is a drive of another rover.
    """
    film = Film.of(subject.trace, subject.rover, subject.terrain)
    ghosts = ghosts_of(film, others)
    # viser records the messages that its server would send. No browser connects: the recording is the only output.
    with server() as viser, viser.atomic():
        look_from(viser, film)
        recorder = viser.get_scene_serializer()
        stage = Stage(viser.scene, film, shapes_of(subject.rover, subject.meshes), ghosts)
        for frame, wait in enumerate(np.append(np.diff(film.t), 0.0)):
            stage.show(frame)
            recorder.insert_sleep(float(wait))
        page = recorder.as_html()
    # The page gets the name of the drive as its title, and the panel with plots at its end.
    page = re.sub("<title>.*?</title>", lambda _: f"<title>{html_text(subject.name)}</title>", page, count=1)
    end = page.rindex("</body>")
    return str(page[:end] + panel_of(subject, others, film) + page[end:])


def ghosts_of(film: Film, others: Sequence[tuple[Subject, str]]) -> list[Ghost]:
    """Return other drives of the film's rover as ghosts. Each drive comes with the word for its colour, a key of
    COLOURS.

    Raises DataError: a ghost is a drive of another rover.
    """
    ghosts = [Ghost(Film.of(subject.trace, subject.rover, subject.terrain), COLOURS[word]) for subject, word in others]
    for ghost in ghosts:
        film.refuse_other(ghost.film)
    return ghosts


@contextmanager
def server() -> Iterator[Any]:
    """Start a viser server for the body of a `with` statement, and stop it afterwards. Only programs on this computer
    can reach the server.
    """
    import viser

    with socket.socket() as probe:  # the system chooses a free port
        probe.bind((HOST, 0))
        port = int(probe.getsockname()[1])
    with redirect_stdout(io.StringIO()):  # viser prints its address
        viser_server = viser.ViserServer(host=HOST, port=port, verbose=False)
    try:
        yield viser_server
    finally:
        with redirect_stdout(io.StringIO()):
            viser_server.stop()


def look_from(viser: Any, film: Film) -> None:
    """Place the camera of a viser server to the right of the rover and above it. The camera can stay there, because the
    scene keeps the rover at its origin.
    """
    reach = float(np.linalg.norm(np.ptp(film.centres[0], axis=0)))
    viser.initial_camera.position = (-0.2 * reach, -1.35 * reach, 0.85 * reach)
    viser.initial_camera.look_at = (0.0, 0.0, 0.0)
