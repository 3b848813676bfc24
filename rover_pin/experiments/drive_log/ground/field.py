"""The ground as it may differ from the declared: grip and slope along the way of each run, drawn anew by raking."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from scipy.ndimage import uniform_filter1d

from rover_pin.body.rover import Rover
from rover_pin.effects.effect import SensorEffect
from rover_pin.estimation.random_field import Kind, RandomField
from rover_pin.experiments.drive_log.features import BLOCK, LoggedRun
from rover_pin.motion.defaults import scale
from rover_pin.motion.model import Model
from rover_pin.motion.replay import Nudge, Replay, filled

GRIP = Kind("grip along the way", 0.05, "")
SLOPE = Kind("slope along the way", 0.01, "rad")
GRIP_OF_RUN = Kind("grip of a run", 0.05, "")
SLOPE_OF_RUN = Kind("slope of a run", 0.01, "rad")
KINDS = (GRIP, SLOPE, GRIP_OF_RUN, SLOPE_OF_RUN)
SPACING = 0.12
"""Distance of the places between which grip and slope change evenly [m], for the paper's wheels: about their size."""
MOST = 12
"""Places of one run at most; on a longer way they are further apart."""


class Driven(Protocol):
    """Runs of a log that a model drives again."""

    @property
    def runs(self) -> Sequence[LoggedRun]:
        """The runs."""

    def replays(self, model: Model, nudges: Sequence[Nudge] | None = None) -> Sequence[Replay]:
        """Return the replays of one model, perhaps nudged, one nudge a run."""

    def read(self, replays: Sequence[Replay], sensors: Sequence[SensorEffect]) -> np.ndarray:
        """Return the features (runs, channels, blocks) of replays as these sensors report them."""


def ground_field(experiment: Driven, model: Model) -> RandomField:
    """Return how each run's features would move if the ground differed at each place of its way.

    Grip is a share of tan phi; a slope is one along the heading: a force against the motion, -m g slope, and what it
    does to pitch and height. One place's share falls evenly to 0 at its neighbours.
    """
    shares = [shares_of(run, model.rover) for run in experiment.runs]
    base = experiment.replays(model)
    still = experiment.read(base, model.sensor_effects)
    weight = model.built.mass * abs(model.gravity)
    places = max(len(one) for one in shares)
    by_place = [[_at(one, place) for one in shares] for place in range(places)]
    moved = {
        GRIP: [_moved(experiment, model, still, [Nudge(grip=GRIP.size * one) for one in rows]) for rows in by_place],
        SLOPE: [_sloped(experiment, model, still, rows, weight) for rows in by_place],
    }
    return _columns(moved, [len(one) for one in shares])


def shares_of(run: LoggedRun, rover: Rover) -> np.ndarray:
    """Return how much each place of a run's way counts at each row (places, T)."""
    length = max(1, round(BLOCK / run.commands.period))
    x, y = (uniform_filter1d(filled(run.commands.place[:, axis]), length, mode="nearest") for axis in (0, 1))
    way = np.cumsum(np.hypot(np.diff(x, prepend=x[0]), np.diff(y, prepend=y[0])))
    count = min(round(float(way[-1]) / (SPACING * scale(rover))), MOST - 1) + 1
    if count == 1:
        return np.ones((1, len(way)))
    knots = np.linspace(0.0, way[-1], count)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(way - knots[:, None]) / (knots[1] - knots[0])))


def _at(shares: np.ndarray, place: int) -> np.ndarray:
    return np.asarray(shares[place]) if place < len(shares) else np.zeros(shares.shape[1])


def _moved(
    experiment: Driven,
    model: Model,
    still: np.ndarray,
    nudges: list[Nudge],
    seen: Callable[[int, Replay], Replay] = lambda run, replay: replay,
) -> np.ndarray:
    replays = [seen(run, one) for run, one in enumerate(experiment.replays(model, nudges))]
    return np.nan_to_num(experiment.read(replays, model.sensor_effects) - still)


def _sloped(experiment: Driven, model: Model, still: np.ndarray, shares: list[np.ndarray], weight: float) -> np.ndarray:
    def tilted(run: int, replay: Replay) -> Replay:
        slope, one = SLOPE.size * shares[run], experiment.runs[run]
        steps = np.array([np.diff(replay.channels[f"body_{axis}"], prepend=np.nan) for axis in "xy"])
        ahead = np.nan_to_num(np.cos(one.heading) * steps[0] + np.sin(one.heading) * steps[1])
        channels = {
            **replay.channels,
            "body_pitch": replay.channels["body_pitch"] - slope,
            "body_z": replay.channels["body_z"] + np.cumsum(slope * ahead),
        }
        return dataclasses.replace(replay, channels=channels)

    nudges = [Nudge(force=-weight * SLOPE.size * share) for share in shares]
    return _moved(experiment, model, still, nudges, tilted)


def _columns(moved: dict[Kind, list[np.ndarray]], counts: list[int]) -> RandomField:
    """Return one column for each place of each run, and for each run as a whole, the sum of its places."""
    kinds, columns, folds = [], [], []
    for along, whole in ((GRIP, GRIP_OF_RUN), (SLOPE, SLOPE_OF_RUN)):
        for run, count in enumerate(counts):
            own = [np.where(np.arange(len(counts))[:, None, None] == run, each, 0.0) for each in moved[along][:count]]
            several = own if count > 1 else []
            columns += [*several, np.sum(own, axis=0)]
            kinds += [KINDS.index(along)] * len(several) + [KINDS.index(whole)]
            folds += [run] * (len(several) + 1)
    return RandomField(KINDS, np.array(kinds), np.array(folds), np.array(columns))
