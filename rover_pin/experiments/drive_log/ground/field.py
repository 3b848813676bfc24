"""The ground as it may differ from the declared: grip and slope along the way of each run, drawn anew by raking."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from rover_pin.estimation.random_effects.random_field import Kind
from rover_pin.experiments.drive_log.features import BLOCK, LoggedRun
from rover_pin.rover.rover import Rover
from rover_pin.simulation.logged_inputs import fill_gaps
from rover_pin.simulation.model.defaults import scale
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import Perturbation, Replay

GRIP = Kind("grip along the way", 0.05, "")
SLOPE = Kind("slope along the way", 0.01, "rad")
GRIP_OF_RUN = Kind("grip of a run", 0.05, "")
SLOPE_OF_RUN = Kind("slope of a run", 0.01, "rad")
KINDS = (GRIP, SLOPE, GRIP_OF_RUN, SLOPE_OF_RUN)
SPACING = 0.12
"""Distance of the places between which grip and slope change evenly [m], for the paper's wheels: about their size."""
MAX_PLACES = 12
"""Places, or times, of one run at most; in a longer one they are further apart."""


def ground_columns(
    runs: Sequence[LoggedRun],
    model: Model,
    still: np.ndarray,
    replays: Callable[[Sequence[tuple[int, Perturbation]]], Sequence[Replay]],
    read: Callable[[int, Replay], np.ndarray],
) -> dict[str, np.ndarray]:
    """Return how each run's features would move if the ground differed at each place of its way, and as a whole.

    Grip is a share of tan phi; a slope is one along the heading: a force against the motion, -m g slope, and what it
    does to pitch and height. One place's share falls evenly to 0 at its neighbours; the whole is the sum of all places.
    `still` is what the model predicts, `replays` drives it under perturbations of runs by index, `read` returns a run's
    features of a replay. `kind`, `fold` and `moved` are those of a `RandomField` of the KINDS.
    """
    weight = model.built.mass * abs(model.gravity)
    places = [(at, share) for at, run in enumerate(runs) for share in shares_of(run, model.rover)]
    grips = replays([(at, Perturbation(grip=GRIP.size * share)) for at, share in places])
    pushed = replays([(at, Perturbation(force=-weight * SLOPE.size * share)) for at, share in places])
    slopes = [_tilt_replay(runs[at], replay, share) for (at, share), replay in zip(places, pushed, strict=True)]
    columns = []
    for along, run_kind, driven in ((GRIP, GRIP_OF_RUN, grips), (SLOPE, SLOPE_OF_RUN, slopes)):
        changes: list[list[np.ndarray]] = [[] for _ in runs]
        for (at, _), replay in zip(places, driven, strict=True):
            change = read(at, replay) - still[at]  # none where one of two drives ended or nothing is compared
            changes[at].append(np.nan_to_num(change, posinf=0.0, neginf=0.0))
        for at, run_changes in enumerate(changes):
            columns += [(along, at, change) for change in run_changes if len(run_changes) > 1]
            columns.append((run_kind, at, np.sum(run_changes, axis=0)))
    table = np.zeros((len(columns), *still.shape))
    for row, (_, at, change) in zip(table, columns, strict=True):
        row[at] = change
    kind, fold = np.array([(KINDS.index(kind), at) for kind, at, _ in columns]).T
    return {"kind": kind, "fold": fold, "moved": table}


def shares_of(run: LoggedRun, rover: Rover) -> np.ndarray:
    """Return how much each place of a run's way counts at each row (places, T)."""
    length = max(1, round(BLOCK / run.commands.period))
    x, y = (uniform_filter1d(fill_gaps(run.commands.place[:, axis]), length, mode="nearest") for axis in (0, 1))
    way = np.cumsum(np.hypot(np.diff(x, prepend=x[0]), np.diff(y, prepend=y[0])))
    count = min(round(float(way[-1]) / (SPACING * scale(rover))), MAX_PLACES - 1) + 1
    if count == 1:
        return np.ones((1, len(way)))
    knots = np.linspace(0.0, way[-1], count)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(way - knots[:, None]) / (knots[1] - knots[0])))


def _tilt_replay(run: LoggedRun, replay: Replay, share: np.ndarray) -> Replay:
    """Return a replay as sensors on a ground inclined by this share would see it; as it is where nothing moved."""
    if "body_z" not in replay.channels:
        return replay
    slope = SLOPE.size * share
    steps = np.array([np.diff(replay.channels[f"body_{axis}"], prepend=np.nan) for axis in "xy"])
    ahead = np.nan_to_num(np.cos(run.heading) * steps[0] + np.sin(run.heading) * steps[1])
    channels = {
        **replay.channels,
        "body_pitch": replay.channels["body_pitch"] - slope,
        "body_z": replay.channels["body_z"] + np.cumsum(slope * ahead),
    }
    return dataclasses.replace(replay, channels=channels)
