"""What a user would otherwise take for a drive: wheel odometry with a slip that is fitted to the other runs."""

from collections.abc import Sequence

import numpy as np

from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.experiment import LEAST_NOISE
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import DRIFT, HEADING, PATH, SPEED, LoggedRun
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.logged_inputs import fill_gaps

CURVE, GIVEN = "kinematic model with fitted slip", "the measured wheel rates"
POINT_STEP = 1e-3
"""Offset of the tracked point [m] for its derivative."""


def odometry_baselines(
    experiment: DriveExperiment, rover: Rover, later: DriveExperiment | None = None
) -> tuple[Baseline, ...]:
    """Return the held-out errors of odometry, v = (1 - s) mean(r omega) and psi' = g (right - left) r omega.

    The tracked point lies at x, y from the centre of turning. One s, g, x and y for all runs but the one that is
    predicted, or for all of them where it is one of `later`, by least squares in units of the noise; the rover goes
    where it heads. Unlike the model, which is given the duties, it is given the measured wheel rates; where one was not
    measured, or no place, there is no odometry.
    """
    rates = [f"wheel_rate_{wheel.name}" for wheel in rover.wheels]
    channels = _channels(experiment)
    if not channels or any(rate not in run.measured for run in experiment.runs for rate in rates):
        return ()
    floor = _floor(experiment, channels)
    runs = _tables(experiment, rover, channels, floor)
    cases = [([*runs[:at], *runs[at + 1 :]], run) for at, run in enumerate(runs)]
    if later is not None:
        cases = [(runs, run) for run in _tables(later, rover, channels, floor)]
    missed = [floor * (measured - np.tensordot(_fit_factors(of), table, axes=1)) for of, (table, measured) in cases]
    errors = np.array([np.sqrt(np.nanmean(rows**2, axis=1)) for rows in missed])
    rms = np.sqrt(np.nanmean(np.concatenate(missed, axis=1) ** 2, axis=1))
    return tuple(
        Baseline(name, experiment.unit(name), CURVE, float(error), GIVEN, tuple(map(float, by_fold)))
        for name, error, by_fold in zip(channels, rms, errors.T, strict=True)
    )


def _channels(experiment: DriveExperiment) -> list[str]:
    return [name for name in (PATH, DRIFT, HEADING, SPEED) if name in experiment.channels]


def _floor(experiment: DriveExperiment, channels: Sequence[str]) -> np.ndarray:
    at = [experiment.channels.index(name) for name in channels]
    return np.fmax(experiment.floor()[at], LEAST_NOISE)[:, None]


Tables = list[tuple[np.ndarray, np.ndarray]]


def _tables(experiment: DriveExperiment, rover: Rover, channels: Sequence[str], floor: np.ndarray) -> Tables:
    """Return the regressors (4, channels, blocks) and what was measured (channels, blocks) of each run, over noise."""
    at = [experiment.channels.index(name) for name in channels]
    observed = [row[at, : run.observed.shape[1]] for row, run in zip(experiment.observed, experiment.runs, strict=True)]
    regressors = (_regressors(run, rover, channels) for run in experiment.runs)
    return [(table / floor, measured / floor) for table, measured in zip(regressors, observed, strict=True)]


def _fit_factors(runs: Tables) -> np.ndarray:
    """Return the factors of the regressors by least squares."""
    regressors, measured = (np.concatenate(tables, axis=-1) for tables in zip(*runs, strict=True))
    good = np.isfinite(measured)
    return np.asarray(np.linalg.lstsq(regressors[:, good].T, measured[good])[0])


def _regressors(run: LoggedRun, rover: Rover, names: Sequence[str]) -> np.ndarray:
    """Return features (4, channels, blocks): the way and the turn of wheels that do not slip, and what x and y add."""
    at = [run.channels.index(name) for name in names]
    there, *beside = (_odometry(run, rover, point)[at] for point in (0j, POINT_STEP, 1j * POINT_STEP))
    turns = np.array([[name == HEADING] for name in names])
    return np.array([there * ~turns, there * turns, *((rows - there) / POINT_STEP for rows in beside)])


def _odometry(run: LoggedRun, rover: Rover, point: complex) -> np.ndarray:
    """Return the features (channels, blocks) of a point of a rover whose wheels do not slip, its heading that of g = 1.

    It goes where the log heads; where that is the course, its own heading is the course of where its wheels turn it.
    """
    rims = np.array([wheel.wheel.r * fill_gaps(run.measured[f"wheel_rate_{wheel.name}"]) for wheel in rover.wheels])
    places = wheel_places(rover)
    left = np.array([places[wheel.name][1] > 0.0 for wheel in rover.wheels])
    speed, turn = rims.mean(axis=0), rims[~left].mean(axis=0) - rims[left].mean(axis=0)
    yaw = np.cumsum(turn) * run.commands.period

    def features(heading: np.ndarray) -> np.ndarray:
        forward = np.exp(1j * heading)
        place = np.cumsum(speed * forward) * run.commands.period + point * forward
        velocity = speed * forward + np.gradient(point * forward, run.commands.period)
        pose = {"body_x": place.real, "body_y": place.imag, "body_vx": velocity.real, "body_vy": velocity.imag}
        return run.features({**pose, "body_yaw": yaw})

    result = features(run.heading)
    if run.course and HEADING in run.channels:
        heading = run.channels.index(HEADING)
        result[heading] = features(yaw)[heading]
    return result
