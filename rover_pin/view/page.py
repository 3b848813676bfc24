"""One HTML page with a drive in 3D, which needs nothing but a browser: no network, no server."""

import html
import io
import re
import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.files.whole_file import replace_file
from rover_pin.view.film import Film
from rover_pin.view.panel import panel_of
from rover_pin.view.shapes import shapes_of
from rover_pin.view.stage import BLUE, ORANGE, Ghost, Stage
from rover_pin.view.subject import Subject

COLOURS, HOST = {"blue": BLUE, "orange": ORANGE}, "127.0.0.1"


def write_page(file: Path, subject: Subject, ghost: Subject | None = None) -> Path:
    """Write a drive, and another one as its ghost, to an HTML page; return its path.

    Raises DataError: a trace in which there is nothing to see, or the file cannot be written.
    """
    return replace_file(file, page_of(subject, () if ghost is None else ((ghost, "blue"),)))


def page_of(subject: Subject, others: Sequence[tuple[Subject, str]] = ()) -> str:
    """Return a drive, and others as its ghosts, each with the word for its colour, as an HTML page.

    Raises DataError: a trace in which there is nothing to see, or a ghost of another rover.
    """
    film = Film.of(subject.trace, subject.rover, subject.terrain)
    ghosts = ghosts_of(film, others)
    with server() as viser, viser.atomic():  # nobody looks on: what a server would send is written once, at the end
        look_from(viser, film)
        recorder = viser.get_scene_serializer()
        stage = Stage(viser.scene, film, shapes_of(subject.rover, subject.meshes), ghosts)
        for frame, wait in enumerate(np.append(np.diff(film.t), 0.0)):
            stage.show(frame)
            recorder.insert_sleep(float(wait))
        page = recorder.as_html()
    page = re.sub("<title>.*?</title>", lambda _: f"<title>{html.escape(subject.name)}</title>", page, count=1)
    end = page.rindex("</body>")
    return str(page[:end] + panel_of(subject, others, film) + page[end:])


def ghosts_of(film: Film, others: Sequence[tuple[Subject, str]]) -> list[Ghost]:
    """Return others as ghosts beside a film, each in the colour of its word; see `Film.refuse_other`."""
    ghosts = [Ghost(Film.of(subject.trace, subject.rover, subject.terrain), COLOURS[word]) for subject, word in others]
    for ghost in ghosts:
        film.refuse_other(ghost.film)
    return ghosts


@contextmanager
def server() -> Iterator[Any]:
    """Serve a scene at a free port of this machine alone while the block runs."""
    import viser

    with redirect_stdout(io.StringIO()):  # it announces itself
        viser_server = viser.ViserServer(host=HOST, port=_free_port(), verbose=False)
    try:
        yield viser_server
    finally:
        with redirect_stdout(io.StringIO()):
            viser_server.stop()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])


def look_from(viser: Any, film: Film) -> None:
    """Look at the rover, which the scene keeps in its middle, from its right side, from above."""
    reach = float(np.linalg.norm(np.ptp(film.centres[0], axis=0)))
    viser.initial_camera.position = (-0.2 * reach, -1.35 * reach, 0.85 * reach)
    viser.initial_camera.look_at = (0.0, 0.0, 0.0)
