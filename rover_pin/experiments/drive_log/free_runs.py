"""Runs driven freely from their start, without being drawn to the log: how far they diverge."""

from typing import NamedTuple

import numpy as np

from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import PATH
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.replay import Commands


class FreeRun(NamedTuple):
    """One run driven freely from its start, without being drawn to the log: how far off the place was."""

    run: str
    distance: float
    "driven in the log [m]"
    before: float
    "RMS of the distance from the logged place, base model [m]"
    after: float
    "the same with what was added [m]"


def free_runs(experiment: DriveExperiment, before: Model, after: Model) -> tuple[FreeRun, ...]:
    """Return how far the free simulations of all runs diverge from the log, before and after; of odometry nothing."""
    if PATH not in experiment.channels:
        return ()
    strayed = [
        [
            _strayed(run.commands, replay.channels)
            for run, replay in zip(experiment.runs, experiment.free.replays(model), strict=True)
        ]
        for model in (before, after)
    ]
    return tuple(
        FreeRun(run.name, _distance(run.commands), was, now)
        for run, was, now in zip(experiment.runs, strayed[0], strayed[1], strict=True)
    )


def _strayed(run: Commands, channels: dict[str, np.ndarray]) -> float:
    if "body_x" not in channels:
        return float("nan")
    off = np.hypot(channels["body_x"] - run.place[:, 0], channels["body_y"] - run.place[:, 1])
    return float(np.sqrt(np.nanmean(off**2)))


def _distance(run: Commands) -> float:
    steps = run.place[:: max(1, round(1.0 / run.period)), :2]
    return float(np.nansum(np.hypot(*np.diff(steps, axis=0).T)))
