"""How a tracker may wander while it tracks: each number of the pose of each run, evenly from time to time.

A tracker's zero drifts by some noise's worth over seconds, longer than blocks hang together and less than a run lasts,
so that all runs together seem to tell a bias, a tilt or a spring. Its SDs are learnt as those of the ground are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rover_pin.estimation.random_effects.random_field import Kind
from rover_pin.experiments.drive_log.features import DRIFT, HEADING, PATH, LoggedRun, blocks, leaky, levelled

PLACE = Kind("wander of the tracked place", 0.002, "m")
HEIGHT = Kind("wander of the tracked height", 0.002, "m")
COURSE = Kind("wander of the tracked heading", 0.002, "rad")
TILT = Kind("wander of the tracked roll and pitch", 0.002, "rad")
TRACKER = (PLACE, HEIGHT, COURSE, TILT)
OF = {PATH: PLACE, DRIFT: PLACE, HEADING: COURSE, "body_z": HEIGHT, "body_roll": TILT, "body_pitch": TILT}
SPACING = 4.0
"""Time between which a tracker wanders evenly [s] (assumed: drifts of seconds, as of light and temperature)."""
MOST = 12
"""Times of one run at most; in a longer one they are further apart."""


def tracker_columns(runs: Sequence[LoggedRun], channels: Sequence[str], length: int) -> dict[str, np.ndarray]:
    """Return how each run's features move where its tracker is off at one time, less and less to the times beside.

    `kind`, `fold` and `moved` are those of a `RandomField` of the kinds TRACKER.
    """
    columns = [
        (TRACKER.index(OF[name]), at, row, response)
        for at, run in enumerate(runs)
        for row, name in enumerate(channels)
        if name in OF
        for response in _tracker_responses(run, name)
    ]
    table = np.zeros((len(columns), len(runs), len(channels), length))
    for features, (_, at, row, response) in zip(table, columns, strict=True):
        features[at, row, : len(response)] = response
    kind, fold = (np.array([column[at] for column in columns], dtype=int) for at in (0, 1))
    return {"kind": kind, "fold": fold, "moved": table}


def _tracker_responses(run: LoggedRun, name: str) -> np.ndarray:
    """Return the blocks of a feature (times, blocks) by which the tracker moves it."""
    t, period = run.commands.t, run.commands.period
    count = min(max(round((t[-1] - t[0]) / SPACING), 1), MOST - 1) + 1
    knots = np.linspace(t[0], t[-1], count)
    shares = OF[name].size * np.maximum(0.0, 1.0 - np.abs(t - knots[:, None]) / (knots[1] - knots[0]))
    if name in (PATH, DRIFT, HEADING):
        steps = run.summed_rows * np.diff(shares, axis=1, prepend=shares[:, :1])
        return blocks(np.array([leaky(step, period) for step in steps]), period)
    return np.array([levelled(name, block, run.usable) for block in blocks(shares, period)])
