"""What happened when: since when a drive is stuck, where it ended, and wheels that leave the ground and touch down."""

import math
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.outcome.outcome import drive_outcome
from rover_pin.view.film import Film

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
