"""The same scene, served on this machine: with buttons to play it, at any speed, and to step through it."""

import time

from rover_pin.view.film import Film
from rover_pin.view.page import ghosts_of, look_from, server
from rover_pin.view.panel import legend_of
from rover_pin.view.shapes import shapes_of
from rover_pin.view.stage import Stage
from rover_pin.view.subject import Subject

STYLE = "padding:8px 12px;font:13px/1.45 system-ui,sans-serif"


def serve(subject: Subject, ghost: Subject | None, port: int, seconds: float = float("inf")) -> None:
    """Serve a drive, and another one as its ghost, at a port of this machine, until interrupted or for `seconds`."""
    film = Film.of(subject.trace, subject.rover, subject.terrain)
    others = () if ghost is None else ((ghost, "blue"),)
    ghosts = ghosts_of(film, others)
    with server(port=port) as viser:
        look_from(viser, film)
        stage = Stage(viser.scene, film, shapes_of(subject.rover, subject.meshes), ghosts)
        viser.gui.add_html(f'<div style="{STYLE}">{legend_of(subject, others, film)}</div>')
        play = viser.gui.add_checkbox("play", True)
        speed = viser.gui.add_slider("speed", 0.1, 10.0, 0.1, 1.0)
        at = viser.gui.add_slider("t [s]", float(film.t[0]), float(film.t[-1]), 0.01, float(film.t[0]))
        at.on_update(lambda _: stage.show(film.frame_at(float(at.value))))
        stage.show(0)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            time.sleep(0.05)
            if play.value:
                later = at.value + 0.05 * speed.value
                at.value = later if later < film.t[-1] else float(film.t[0])
