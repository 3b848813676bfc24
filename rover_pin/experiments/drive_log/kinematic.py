"""What a user would otherwise take for a drive: wheel odometry with a slip that is fitted to the other runs."""

from __future__ import annotations

import numpy as np

from rover_pin.estimation.baselines import Baseline
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import DRIFT, HEADING, PATH, SPEED, LoggedRun
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.replay import filled

CURVE, GIVEN = "kinematic model with fitted slip", "the measured wheel rates"


def kinematic(experiment: DriveExperiment, rover: Rover) -> tuple[Baseline, ...]:
    """Return the held-out errors of odometry, v = (1 - s) mean(r omega) and psi' = g (right - left) r omega.

    One slip s and one g for all runs but the one that is predicted, fitted to each channel by least squares; the rover
    goes where it heads. Unlike the model, which is given the duties, it is given the measured wheel rates; where one
    was not measured there is no odometry.
    """
    rates = [f"wheel_rate_{wheel.name}" for wheel in rover.wheels]
    if any(rate not in run.measured for run in experiment.runs for rate in rates):
        return ()
    names = [name for name in (PATH, DRIFT, HEADING, SPEED) if name in experiment.channels]
    driven, baselines = [_odometry(run, rover) for run in experiment.runs], []
    for name in names:
        at = experiment.channels.index(name)
        rows = [features[run.channels.index(name)] for run, features in zip(experiment.runs, driven, strict=True)]
        observed = [experiment.observed[number, at, : row.size] for number, row in enumerate(rows)]
        errors = [_missed(rows, observed, fold) for fold in range(len(rows))]
        error = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
        baselines.append(Baseline(name, experiment.unit(name), CURVE, error, GIVEN))
    return tuple(baselines)


def _odometry(run: LoggedRun, rover: Rover) -> np.ndarray:
    """Return the features (channels, blocks) of a rover whose wheels do not slip, its heading that of g = 1."""
    rims = np.array([wheel.wheel.r * filled(run.measured[f"wheel_rate_{wheel.name}"]) for wheel in rover.wheels])
    places = wheel_places(rover)
    left = np.array([places[wheel.name][1] > 0.0 for wheel in rover.wheels])
    speed, turn = rims.mean(axis=0), rims[~left].mean(axis=0) - rims[left].mean(axis=0)
    forward = np.array([np.cos(run.heading), np.sin(run.heading)])
    x, y = np.cumsum(forward * speed, axis=1) * run.commands.period
    pose = {"body_x": x, "body_y": y, "body_yaw": np.cumsum(turn) * run.commands.period}
    return run.features({**pose, "body_vx": forward[0] * speed, "body_vy": forward[1] * speed})


def _missed(rows: list[np.ndarray], observed: list[np.ndarray], fold: int) -> np.ndarray:
    """Return what one run misses by the factor that is fitted to the others."""
    others = [number for number in range(len(rows)) if number != fold]
    odometry, measured = (np.concatenate([table[number] for number in others]) for table in (rows, observed))
    good = np.isfinite(measured)
    factor = float(odometry[good] @ measured[good]) / max(float(odometry[good] @ odometry[good]), 1e-300)
    missed = observed[fold] - factor * rows[fold]
    return missed[np.isfinite(missed)]
