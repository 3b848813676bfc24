"""One HTML page that shows a drive in 3D, next to a panel with a legend, plots over time and the events of the drive.

The page needs only a browser, no network and no server.
"""

import io
import math
import re
import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.encode import html_text, script_json
from rover_pin.base.files.paths import text_of_package
from rover_pin.base.files.whole_file import replace_file
from rover_pin.simulation.outcome.outcome import drive_outcome
from rover_pin.view.colours import css_gradient
from rover_pin.view.film import Film, Subject
from rover_pin.view.stage import BLUE, ORANGE, Ghost, Stage
from rover_pin.view.triangles import shapes_of

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
    # A ghost is drawn with the shapes of this rover, so that it must be a drive of this rover.
    ghosts = [Ghost(Film.of(other.trace, other.rover, other.terrain), COLOURS[word]) for other, word in others]
    for ghost in ghosts:
        film.refuse_other(ghost.film)
    # viser records the messages that its server would send. No browser connects: the recording is the only output.
    with server() as viser, viser.atomic():
        # The camera is to the right of the rover and above it. It can stay there, because the scene keeps the rover at
        # its origin. `reach` is the distance between opposite wheels [m].
        reach = float(np.linalg.norm(np.ptp(film.centres[0], axis=0)))
        viser.initial_camera.position = (-0.2 * reach, -1.35 * reach, 0.85 * reach)
        viser.initial_camera.look_at = (0.0, 0.0, 0.0)
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


NO_EVENT = ("driving", "creeping", "held", "stopped")
"""Types of outcomes that the page does not show as events, because they hold from the start of the drive."""
PLOTS = {"slip": ("slip S [-]", 1.0), "sinkage": ("sinkage [mm]", 1e3), "normal": ("load on the wheel [N]", 1.0)}
"""Channel of the wheels that the page plots -> label of the plot, and factor from the SI unit to the unit in the
label."""


class Event(NamedTuple):
    """An event in a drive: its time [s], and a few words that describe it."""

    t: float
    words: str


def events_of(film: Film) -> list[Event]:
    """Return the events of a drive in the order of time: the beginning of its outcome, for example that the rover is
    stuck, and the moments at which wheels leave the ground or touch down.

    A wheel without load counts as lifted. If the trace contains no loads, only the outcome is returned.
    """
    outcome = drive_outcome(film.trace)
    events = []
    # An outcome such as driving is no event.
    if outcome and outcome.kind not in NO_EVENT and math.isfinite(outcome.since):
        kind = outcome.sentence.partition(":")[0] if outcome.kind == "ended" else outcome.kind
        events.append(Event(outcome.since, kind))
    # A change of the sign of the load between two frames is a touch-down or a lift-off.
    loads = film.of_wheels("normal")
    for wheel, load in zip(film.rover.wheels, () if loads is None else loads.T, strict=loads is not None):
        for frame in np.flatnonzero(np.diff(load > 0.0)) + 1:
            words = f"{wheel.name} touches down" if load[frame] > 0.0 else f"{wheel.name} leaves the ground"
            events.append(Event(float(film.t[frame]), words))
    return sorted(events)


def panel_of(subject: Subject, others: Sequence[tuple[Subject, str]], film: Film) -> str:
    """Return the panel of a page (legend, plots, events) as HTML, with its style, data and script."""
    css, script = (text_of_package("rover_pin.view", name) for name in ("panel.css", "panel.js"))
    data = script_json(plot_data(film))
    return (
        f'<style>{css}</style><aside id="rover-pin-panel"><span class="now"></span>{legend_of(subject, others, film)}'
        '<div class="events"></div><div class="key"></div><div class="plots"></div>'
        '<div class="keys">Arrow keys step, with shift by 1 s; space plays; click a plot to go there.</div></aside>'
        f'<script type="application/json" id="rover-pin-data">{data}</script><script>{script}</script>'
    )


def plot_data(film: Film) -> dict[str, Any]:
    """Return the data for the plots of a page: the times since the start [s], the channels in PLOTS for each wheel, and
    the events.
    """
    plots = []
    for channel, (label, scale) in PLOTS.items():
        values = film.of_wheels(channel)
        if values is not None and np.isfinite(values).any():
            columns = zip(film.rover.wheels, (scale * values).T, strict=True)
            plots.append({"label": label, "lines": {wheel.name: _rounded(column) for wheel, column in columns}})
    start = float(film.t[0])
    events = [(event.t - start, f"{event.t:.1f} s {event.words}") for event in events_of(film)]
    return {"t": _rounded(film.t - start), "plots": plots, "events": events}


def _rounded(values: np.ndarray) -> list[float | None]:
    """Return numbers rounded to four digits, which is enough for a plot; NaN becomes None, which JSON can represent."""
    return [float(f"{value:.4g}") if np.isfinite(value) else None for value in values]


def legend_of(subject: Subject, others: Sequence[tuple[Subject, str]], film: Film) -> str:
    """Return the legend in HTML: name and outcome of the drive, its ghosts, and the meaning of colours and arrows."""
    lines = [f"<b>{html_text(subject.name)}</b>"]
    outcome = subject.trace.attrs.get("outcome") or subject.trace.attrs.get("stop")
    lines += [html_text(str(outcome))] if outcome else []
    # The lines of the legend: the drive, its ghosts, and the meaning of colours and arrows.
    for ghost, word in others:
        lines.append(html_text(f"ghost, in {word}: {ghost.name}, {ghost.trace.attrs.get('outcome', '')}".rstrip(", ")))
    if film.slip is None:
        last = ["slip was not recorded: wheels have their own colours"]
    else:
        bar = f'<span style="display:block;height:8px;border-radius:4px;background:{css_gradient()}"></span>'
        ends = '<span style="display:flex;justify-content:space-between"><i>-1</i><i>0</i><i>1</i></span>'
        last = [f"slip S of the wheels: brakes, rolls, spins{bar}{ends}"]
    last += ["green arrows: the soil's force on each wheel"] if film.forces is not None else []
    missing = [name for name in ("body_z", "body_pitch", "body_roll") if name not in subject.trace]
    last += [html_text(f"{', '.join(missing)} not recorded: set on the ground")] if missing else []
    below = "".join(f'<div class="below">{line}</div>' for line in last)
    return "".join(f"<div>{line}</div>" for line in lines) + below
