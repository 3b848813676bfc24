"""One HTML page with a drive in 3D, which needs nothing but a browser: no network, no server."""

from __future__ import annotations

import html
import io
import re
import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.base.files.columns import replace_file
from rover_pin.view.colours import css_gradient
from rover_pin.view.film import Film
from rover_pin.view.shapes import shapes_of
from rover_pin.view.stage import BLUE, ORANGE, Ghost, Stage
from rover_pin.view.subject import Subject

COLOURS = {"blue": BLUE, "orange": ORANGE}


def write_page(file: Path, subject: Subject, ghost: Subject | None = None) -> Path:
    """Write a drive, and another one as its ghost, to an HTML page; return its path.

    Raises
    ------
    DataError
        A trace in which there is nothing to see, or the file cannot be written.
    """
    return replace_file(file, page_of(subject, () if ghost is None else ((ghost, "blue"),)))


def page_of(subject: Subject, others: Sequence[tuple[Subject, str]] = ()) -> str:
    """Return a drive, and others as its ghosts, each with the word for its colour, as an HTML page.

    Raises
    ------
    DataError
        A trace in which there is nothing to see, or a ghost of another rover.
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
    legend = f'<div id="rover-pin-legend" style="{STYLE}">{legend_of(subject, others, film)}</div>'
    return str(page[:end] + legend + page[end:])


def ghosts_of(film: Film, others: Sequence[tuple[Subject, str]]) -> list[Ghost]:
    """Return others as ghosts beside a film, each in the colour of its word; see `Film.refuse_other`."""
    ghosts = [Ghost(Film.of(subject.trace, subject.rover, subject.terrain), COLOURS[word]) for subject, word in others]
    for ghost in ghosts:
        film.refuse_other(ghost.film)
    return ghosts


@contextmanager
def server(host: str = "127.0.0.1", port: int = 0) -> Iterator[Any]:
    """Serve a scene on this machine alone while the block runs; port 0 is any free one."""
    import viser

    with redirect_stdout(io.StringIO()):  # it announces itself
        viser_server = viser.ViserServer(host=host, port=port or _free_port(host), verbose=False)
    try:
        yield viser_server
    finally:
        with redirect_stdout(io.StringIO()):
            viser_server.stop()


def _free_port(host: str) -> int:
    with socket.socket() as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])


def look_from(viser: Any, film: Film) -> None:
    """Look at the drive from its right side, from above."""
    low, high = film.centres.min(axis=(0, 1)), film.centres.max(axis=(0, 1))
    middle, reach = 0.5 * (low + high), float(np.linalg.norm(high - low))
    viser.initial_camera.position = tuple(middle + np.array([-0.1, -0.6, 0.38]) * max(reach, 0.6))
    viser.initial_camera.look_at = tuple(middle)


def legend_of(subject: Subject, others: Sequence[tuple[Subject, str]], film: Film) -> str:
    """Return in HTML what is seen, what happened, what the colours and arrows mean."""
    lines = [f"<b>{html.escape(subject.name)}</b>"]
    outcome = subject.trace.attrs.get("happened") or subject.trace.attrs.get("stop")
    lines += [html.escape(str(outcome))] if outcome else []
    for ghost, word in others:
        lines.append(
            html.escape(f"ghost, in {word}: {ghost.name}, {ghost.trace.attrs.get('happened', '')}".rstrip(", "))
        )
    lines += [_bar()] if film.slip is not None else ["slip was not recorded: wheels have their own colours"]
    lines += ["green arrows: the soil's force on each wheel"] if film.forces is not None else []
    missing = [name for name in ("body_z", "body_pitch", "body_roll") if name not in subject.trace]
    lines += [f"{', '.join(missing)} not recorded: set on the ground"] if missing else []
    return "".join(f"<div>{line}</div>" for line in lines)


STYLE = (
    "position:fixed;left:12px;bottom:56px;z-index:1000;max-width:min(26em,60vw);padding:8px 12px;border-radius:6px;"
    "background:rgba(255,255,255,.88);color:#222;font:13px/1.45 system-ui,sans-serif;pointer-events:none"
)


def _bar() -> str:
    bar = f'<span style="display:block;height:8px;border-radius:4px;background:{css_gradient()}"></span>'
    ends = '<span style="display:flex;justify-content:space-between"><i>-1</i><i>0</i><i>1</i></span>'
    return f"slip S of the wheels: brakes, rolls, spins{bar}{ends}"
