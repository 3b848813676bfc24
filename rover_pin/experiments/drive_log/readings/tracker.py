"""How a tracker may wander while it tracks: a random walk of each number of the pose, anew in each run.

A tracker's zero drifts by some noise's worth over seconds, longer than blocks hang together, and a run may begin with
it off, so that all runs together seem to tell a bias, a scale, a tilt or a spring. A place that is off ahead also lays
bumps where they are not: a replay is held to it. The SDs of a walk's steps are learnt as those of the ground are.
"""

from collections.abc import Sequence

import numpy as np

from rover_pin.estimation.random_effects.random_field import Kind
from rover_pin.experiments.drive_log.features import DRIFT, HEADING, PATH, LoggedRun, blocks, leaky, remove_level
from rover_pin.experiments.drive_log.ground.field import MAX_PLACES

PLACE = Kind("wander of the tracked place", 0.002, "m")
HEIGHT = Kind("wander of the tracked height", 0.002, "m")
COURSE = Kind("wander of the tracked heading", 0.002, "rad")
TILT = Kind("wander of the tracked roll and pitch", 0.002, "rad")
TRACKER = (PLACE, HEIGHT, COURSE, TILT)
OF = {PATH: PLACE, DRIFT: PLACE, HEADING: COURSE, "body_z": HEIGHT, "body_roll": TILT, "body_pitch": TILT}
SPACING = 4.0
"""Time of one step of a walk [s] (assumed: drifts of seconds, as of light and temperature)."""


def tracker_columns(
    runs: Sequence[LoggedRun], channels: Sequence[str], length: int, ahead: np.ndarray
) -> dict[str, np.ndarray]:
    """Return how each run's features move by one step of its tracker's walk, which stays.

    `ahead` says of each run how its predicted features (channels, length) change for each metre that it is held too far
    ahead. `kind`, `fold` and `moved` are those of a `RandomField` of the kinds TRACKER.
    """
    places, columns = [], []
    for at, run in enumerate(runs):
        for row, name in enumerate(channels):
            for off in OF[name].size * _shares(run) if name in OF else ():
                features, means = np.zeros((len(runs), len(channels), length)), blocks(off, run.commands.period)
                features[at, row, : len(means)] = _response(run, name, off)
                if name == PATH:
                    features[at, :, : len(means)] -= ahead[at][:, : len(means)] * means
                if features.any():
                    places.append((TRACKER.index(OF[name]), at))
                    columns.append(features)
    kind, fold = np.array(places, dtype=int).reshape(-1, 2).T
    return {"kind": kind, "fold": fold, "moved": np.array(columns).reshape(-1, len(runs), len(channels), length)}


def _shares(run: LoggedRun) -> np.ndarray:
    """Return how much of each step is made at each row (steps, T): evenly in its time, the first before the run."""
    t = run.commands.t
    count = min(max(round((t[-1] - t[0]) / SPACING), 1), MAX_PLACES - 1) + 1
    done = (t - t[0]) / (t[-1] - t[0]) * (count - 1)
    return np.clip(done - np.arange(-1, count - 1)[:, None], 0.0, 1.0)


def _response(run: LoggedRun, name: str, off: np.ndarray) -> np.ndarray:
    """Return the blocks of a feature (blocks,) by which a tracker that is off by this at each row (T,) moves it."""
    period = run.commands.period
    if name in (PATH, DRIFT, HEADING):
        return blocks(leaky(run.summed_rows * np.diff(off, prepend=off[:1]), period), period)
    return remove_level(name, blocks(off, period), run.usable)
