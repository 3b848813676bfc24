"""What stands beside the scene of a page: what is seen, plots over time with a cursor, and the events."""

import html
import json
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.files.paths import text_of_package
from rover_pin.simulation.outcome.outcome import drive_outcome
from rover_pin.view.colours import css_gradient
from rover_pin.view.film import Film
from rover_pin.view.subject import Subject

NO_EVENT = ("driving", "creeping", "held", "stopped")
"""Outcomes that are no event."""


class Event(NamedTuple):
    """A moment of a drive: its time [s] and what happened, in a few words."""

    t: float
    words: str


def events_of(film: Film) -> list[Event]:
    """Return the events of a drive in turn, as far as its trace knows them; a wheel without load is in the air."""
    outcome = drive_outcome(film.trace)
    events = []
    if outcome and outcome.kind not in NO_EVENT and math.isfinite(outcome.since):
        kind = outcome.sentence.partition(":")[0] if outcome.kind == "ended" else outcome.kind
        events.append(Event(outcome.since, kind))
    loads = film.of_wheels("normal")
    for wheel, load in zip(film.rover.wheels, () if loads is None else loads.T, strict=loads is not None):
        for frame in np.flatnonzero(np.diff(load > 0.0)) + 1:
            words = f"{wheel.name} touches down" if load[frame] > 0.0 else f"{wheel.name} leaves the ground"
            events.append(Event(float(film.t[frame]), words))
    return sorted(events)


PLOTS = {"slip": ("slip S [-]", 1.0), "sinkage": ("sinkage [mm]", 1e3), "normal": ("load on the wheel [N]", 1.0)}
"""Channels of the wheels that are drawn, with their labels and scales."""


def panel_of(subject: Subject, others: Sequence[tuple[Subject, str]], film: Film) -> str:
    """Return the panel in HTML, with its style, data and script."""
    css, script = (text_of_package("rover_pin.view", name) for name in ("panel.css", "panel.js"))
    data = json.dumps(plot_data(film), separators=(",", ":")).replace("<", "\\u003c")
    return (
        f'<style>{css}</style><aside id="rover-pin-panel"><span class="now"></span>{legend_of(subject, others, film)}'
        '<div class="events"></div><div class="key"></div><div class="plots"></div>'
        '<div class="keys">Arrow keys step, with shift by 1 s; space plays; click a plot to go there.</div></aside>'
        f'<script type="application/json" id="rover-pin-data">{data}</script><script>{script}</script>'
    )


def plot_data(film: Film) -> dict[str, Any]:
    """Return times from the start, the channels of `PLOTS` that were recorded, by wheel, and the events."""
    plots = []
    for channel, (label, scale) in PLOTS.items():
        values = film.of_wheels(channel)
        if values is not None and np.isfinite(values).any():
            columns = zip(film.rover.wheels, (scale * values).T, strict=True)
            plots.append({"label": label, "lines": {wheel.name: _numbers(column) for wheel, column in columns}})
    start = float(film.t[0])
    events = [(event.t - start, f"{event.t:.1f} s {event.words}") for event in events_of(film)]
    return {"t": _numbers(film.t - start), "plots": plots, "events": events}


def _numbers(values: np.ndarray) -> list[float | None]:
    return [float(f"{value:.4g}") if np.isfinite(value) else None for value in values]


def legend_of(subject: Subject, others: Sequence[tuple[Subject, str]], film: Film) -> str:
    """Return in HTML what is seen, what happened, what the colours and arrows mean."""
    lines = [f"<b>{html.escape(subject.name)}</b>"]
    outcome = subject.trace.attrs.get("outcome") or subject.trace.attrs.get("stop")
    lines += [html.escape(str(outcome))] if outcome else []
    for ghost, word in others:
        lines.append(
            html.escape(f"ghost, in {word}: {ghost.name}, {ghost.trace.attrs.get('outcome', '')}".rstrip(", "))
        )
    last = [_bar()] if film.slip is not None else ["slip was not recorded: wheels have their own colours"]
    last += ["green arrows: the soil's force on each wheel"] if film.forces is not None else []
    missing = [name for name in ("body_z", "body_pitch", "body_roll") if name not in subject.trace]
    last += [f"{', '.join(missing)} not recorded: set on the ground"] if missing else []
    below = "".join(f'<div class="below">{line}</div>' for line in last)
    return "".join(f"<div>{line}</div>" for line in lines) + below


def _bar() -> str:
    bar = f'<span style="display:block;height:8px;border-radius:4px;background:{css_gradient()}"></span>'
    ends = '<span style="display:flex;justify-content:space-between"><i>-1</i><i>0</i><i>1</i></span>'
    return f"slip S of the wheels: brakes, rolls, spins{bar}{ends}"
