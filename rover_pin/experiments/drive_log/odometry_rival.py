"""Wheel odometry with fitted slip: a user without this model would predict a drive by this simple kinematic model.

The verdict on a drive log states the held-out errors of this odometry next to the errors of the fitted model, so that a
reader sees the improvement by the fitted model.
"""

from collections.abc import Sequence

import numpy as np

from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.experiment import MIN_NOISE
from rover_pin.experiments.drive_log.experiment import DriveExperiment
from rover_pin.experiments.drive_log.features import DRIFT, HEADING, PATH, SPEED, LoggedRun
from rover_pin.rover.rover import Rover, WheelMount
from rover_pin.rover.wheel_base import wheel_places
from rover_pin.simulation.logged_inputs import fill_gaps

CURVE, GIVEN = "kinematic model with fitted slip", "the measured wheel rates"
"""Texts for reports: the name of the odometry (CURVE), and the input that the odometry is given (GIVEN)."""
POINT_STEP = 1e-3
"""Displacement of the tracked point [m] for the finite differences that give the derivatives with respect to its
place."""

Tables = list[tuple[np.ndarray, np.ndarray]]
"""For each run: regressors (4, channels, blocks) and measured features (channels, blocks), both divided by the noise
SD."""


def odometry_baselines(
    experiment: DriveExperiment, rover: Rover, later: DriveExperiment | None = None
) -> tuple[Baseline, ...]:
    """Return the held-out error of wheel odometry for each feature of the place: PATH, DRIFT, HEADING and SPEED.

    The odometry computes the speed v = (1 - s) mean(r omega) along the heading, and the yaw rate psi' = g (r omega of
    the right side - r omega of the left side). Here s is the slip, g a fitted factor [1/m] (1 / track width if no wheel
    slips), and r omega the rim speeds [m/s]. The tracked point lies at (x, y) from the centre of turning. The numbers
    s, g, x and y are fitted by least squares, in units of the noise, to all runs except the run that is predicted.

    The fitted model predicts the wheel rates from the duties, but the odometry is given the measured wheel rates.

    Parameters
    ----------
    experiment : DriveExperiment
        The runs of a log as an experiment.
    rover : Rover
        The rover of the log.
    later : DriveExperiment, optional
        Runs of a later log. If given, these runs are predicted, and s, g, x and y are fitted to all runs of
        `experiment`.

    Returns
    -------
    tuple of Baseline
        The error of the odometry for each feature. The tuple is empty if the log has no place, or if a run has no wheel
        rate on one side of the rover.
    """
    # The gain of the yaw rate needs the rates of both sides.
    channels = [name for name in (PATH, DRIFT, HEADING, SPEED) if name in experiment.channels]
    sides = {wheel.side for wheel in rover.wheels}
    if not channels or any({wheel.side for wheel in _measured(run, rover)} != sides for run in experiment.runs):
        return ()
    # A feature without noise would have an infinite weight, so MIN_NOISE is the lower limit.
    floor = np.fmax(experiment.floor()[[experiment.channels.index(name) for name in channels]], MIN_NOISE)[:, None]
    runs = _tables(experiment, rover, channels, floor)
    # Each run is predicted with numbers that are fitted to the other runs, like the runs of the model.
    cases = [([*runs[:index], *runs[index + 1 :]], run) for index, run in enumerate(runs)]
    if later is not None:
        cases = [(runs, run) for run in _tables(later, rover, channels, floor)]
    residuals = []
    for training, (regressors, measured) in cases:
        # Factors of the regressors: 1 - s, g, and the place of the tracked point.
        table, values = (np.concatenate(parts, axis=-1) for parts in zip(*training, strict=True))
        good = np.isfinite(values)
        factors = np.asarray(np.linalg.lstsq(table[:, good].T, values[good])[0])
        residuals.append(floor * (measured - np.tensordot(factors, regressors, axes=1)))
    errors = np.array([np.sqrt(np.nanmean(rows**2, axis=1)) for rows in residuals])
    rms = np.sqrt(np.nanmean(np.concatenate(residuals, axis=1) ** 2, axis=1))
    return tuple(
        Baseline(name, experiment.unit(name), CURVE, float(error), GIVEN, tuple(map(float, by_fold)))
        for name, error, by_fold in zip(channels, rms, errors.T, strict=True)
    )


def _measured(run: LoggedRun, rover: Rover) -> list[WheelMount]:
    """Return the wheels of the rover whose rates were recorded in the run."""
    return [wheel for wheel in rover.wheels if f"wheel_rate_{wheel.name}" in run.measured]


def _tables(experiment: DriveExperiment, rover: Rover, channels: Sequence[str], floor: np.ndarray) -> Tables:
    """Return the regressors of the odometry and the measured features of each run, both divided by the noise SD
    `floor`.

    `floor` has one value for each feature (channels, 1).
    """
    # The regressors (4, channels, blocks) of a run belong to the four numbers of wheel odometry: 1 - s with the slip s,
    # the gain g of the yaw rate, and the place x, y of the tracked point. The first two regressors are the features of
    # distance and of turn for wheels that do not slip. The last two are the derivatives of these features by x and y.
    # The features are linear in the place, so one small displacement gives the derivative.
    turns = np.array([[name == HEADING] for name in channels])
    rows = [experiment.channels.index(name) for name in channels]
    tables = []
    for run, observed in zip(experiment.runs, experiment.observed, strict=True):
        own_rows, points = [run.channels.index(name) for name in channels], (0j, POINT_STEP, 1j * POINT_STEP)
        centre, *displaced = (_odometry(run, rover, point)[own_rows] for point in points)
        by_place = ((table - centre) / POINT_STEP for table in displaced)
        regressors = np.array([centre * ~turns, centre * turns, *by_place])
        # Dividing by the noise gives all features the same weight in the least-squares fit.
        tables.append((regressors / floor, observed[rows, : run.observed.shape[1]] / floor))
    return tables


def _odometry(run: LoggedRun, rover: Rover, point: complex) -> np.ndarray:
    """Return the features (channels, blocks) that wheel odometry without slip gives for one tracked point on the rover.

    The yaw rate is the difference between the rim speeds of both sides (gain g = 1). `point` is the place of the
    tracked point as x + i y in the axes of the body [m]. The body moves along the logged heading. If the log computes
    the heading from the place, the feature HEADING is computed from a place that moves along the heading of the
    odometry itself.
    """
    wheels, places = _measured(run, rover), wheel_places(rover)
    # Positive yaw is to the left, so the right rims are faster in a left turn.
    rims = np.array([wheel.wheel.r * fill_gaps(run.measured[f"wheel_rate_{wheel.name}"]) for wheel in wheels])
    left = np.array([places[wheel.name][1] > 0.0 for wheel in wheels])
    # The place of the tracked point moves with the body and also turns with it.
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
