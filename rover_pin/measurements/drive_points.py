"""Traction factors of a drive log, one for each class of nearly equal slip, as in section 4 of the paper.

The traction factor is the torque of a wheel divided by its radius and its static load.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.jobs.time_left import showing_progress
from rover_pin.base.quantity import declared_sds, record_from
from rover_pin.contact import Soil
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.logs.drive_log import DriveLog
from rover_pin.measurements.steady_windows import SteadyConditions, Window, steady_windows
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.simulation.model.defaults import usual_angles, usual_slip
from rover_pin.simulation.model.motor import Motor
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.wheel_forces import TorqueTraction


@dataclass(frozen=True)
class Sampling:
    """Settings for the classes of slip of a drive, and errors that averaging does not reduce (all values are assumed).

    Parameters
    ----------
    lengths : tuple of float
        Lengths of a window [s] that are tried. The shortest length is taken at which the slips scatter by less than
        half a class.
    levels : int
        Number of classes per unit of slip: a class is 1 / `levels` wide.
    loads : float
        Width of a class in ln W, where W is the wheel load, if the contact angles follow from the load.
    least : int
        Minimum number of windows in a class; smaller classes are dropped.
    load_error : float
        Relative error that all loads and torques share. If the terrain bends within a wheelbase, the static balance is
        wrong by about 1 %; motor constants are known to 1 or 2 %.
    wheel_error : float
        Relative error of the rate and radius of one wheel.
    steady : SteadyConditions
        Conditions for a steady window.
    """

    lengths: tuple[float, ...] = (2.0, 4.0, 8.0)
    levels: int = 20
    loads: float = 0.25
    least: int = 3
    load_error: float = 0.02
    wheel_error: float = 0.01
    steady: SteadyConditions = SteadyConditions()


SAMPLING = Sampling()
"""The default settings for the classes of slip of a drive."""
IN_POINTS = ("gear", "k_t")
"""Motor constants (gear ratio and torque constant k_t) whose declared SD is an error that all points share, because the
torque is proportional to their product."""


def points_of_log(log: DriveLog, sampling: Sampling = SAMPLING) -> TractionPoints:
    """Return the traction points of a drive log; the torque is computed with the motor that the log declares.

    Parameters
    ----------
    log : DriveLog
        The log, with a table [motor] in its drive.toml.
    sampling : Sampling
        Settings of windows and classes.

    Raises
    ------
    DataError
        The pose is wheel odometry, which shows no slip; the log declares no [motor]; or `drive_points` refuses the log.
    """
    if log.metadata.place:
        raise DataError(
            f"{log.folder}: the pose was computed from wheel odometry, which shows no slip: give a pose that was "
            "measured independently of the wheels."
        )
    if not log.metadata.motor:
        raise DataError(
            f"{log.folder}: drive.toml declares no [motor], but the torque is evaluated from the motor's "
            "characteristics: add supply, resistance, k_t and gear."
        )
    return drive_points(log, record_from(Motor, log.metadata.motor, f"{log.file}: [motor]"), sampling)


def drive_points(
    log: DriveLog, motor: Motor, sampling: Sampling = SAMPLING, lag: RelaxedSlip | None = None
) -> TractionPoints:
    """Return the mean torque factors T / (r W) of a drive log by class of slip, with the SDs of slip and factor.

    T is the torque of a wheel, r its radius and W its load. Single samples of slip are too noisy to be classified: a
    class would collect samples that noise moved into it, and the curve would become too flat (regression dilution). So
    samples are first averaged over steady windows. Each window is assigned to a class by the slips of the windows
    before and after it, whose noise is independent of its own noise (an instrumental variable). The mean of each class
    then has an error in both axes, which `TractionPoints` takes into account. The windows of all wheels are collected
    together.

    Parameters
    ----------
    log : DriveLog
        Runs with position, attitude, link angles, duties and wheel rates.
    motor : Motor
        Converts current, or duty and rate, to torque.
    sampling : Sampling
        Windows and classes.
    lag : RelaxedSlip, optional
        Lag of the soil behind the slip; by default the usual lag of the rover.

    Returns
    -------
    TractionPoints
        One point for each class of slip (and of load, if the contact angles follow from the load).

    Raises
    ------
    DataError
        A missing channel, slips that scatter by more than a class, or no class with enough windows.

    Source: section 4, "the traction force is evaluated from the angular velocity of the wheel using the characteristics
    of the corresponding motor. The normal load on each tire is evaluated ... considering static balance"; grouping by
    an instrumental variable: Wald, Annals of Mathematical Statistics 11 (1940) 284, Durbin, Review of the ISI 22 (1954)
    23.
    Differs from the paper: the paper classifies single measurements and plots their scatter, without an error of the
    slip. Here the torque follows from the current if it is logged, and the balance of loads includes the driving
    torques (`driven_loads`). Accelerations of rotor and body are neglected, so windows must be steady.
    """
    rover = log.load_rover().under(log.metadata.gravity)
    for trace in log.runs:
        if len(trace.t) < 2:
            raise DataError(f"{log.folder}: run {trace.attrs['file']} has {len(trace.t)} row: leave it out.")
    # The shortest windows whose slips are precise enough keep the most classes.
    for length in sampling.lengths:
        cut = (steady_windows(trace, rover, motor, length, sampling.steady) for trace in log.runs)
        runs = list(showing_progress(cut, len(log.runs), f"runs cut into windows of {length:g} s"))
        scatter = rms([window.slip_sd for windows in runs for window in windows])
        if scatter < 0.5 / sampling.levels:
            break
    if scatter > 1.0 / sampling.levels:
        raise DataError(
            f"{log.folder}: the slip of a window of {length:g} s scatters by {scatter:.2g}, more than the "
            f"width {1.0 / sampling.levels:g} of a slip class: drive longer at constant duty, or track the rover more "
            "finely."
        )
    # Where the arc follows from the load, windows of different loads are different points.
    lag, angles = lag or usual_slip(rover), usual_angles(rover, log.metadata.angles)
    by_load = sampling.loads if isinstance(angles, SinkageAngles) else math.inf
    classes = classify([pair for windows in runs for pair in soil_windows(windows, length, lag)], sampling, by_load)
    if not classes:
        raise DataError(
            f"{log.folder}: no class of slip has {sampling.least} steady windows of {length:g} s: drive longer at "
            "constant duty, over slopes that change the slip."
        )
    # The declared soil constants accompany the points as priors of later fits.
    slip, factor, sd, *others = points_of(classes, sampling, torque_constant_sd(log.metadata.motor)).T
    where, table = f"{log.file}: [soil]", log.metadata.soil
    constants, doubts = record_from(Soil, table, where), declared_sds(table, Soil, where)
    declared = {name: float(getattr(constants, name)) for name in table}
    slip_sd, shared, slip_shared, load = others
    shared_errors = (slip_sd, shared, slip_shared)
    return TractionPoints(
        slip, factor, sd, rover.wheel, TorqueTraction(), angles, *shared_errors, load, declared, doubts
    )  # fmt: skip


def soil_windows(windows: Sequence[Window], length: float, lag: RelaxedSlip) -> list[tuple[float, Window]]:
    """Correct the slip of each window for the lag of the soil, and return pairs (mean slip of the neighbouring windows,
    corrected window).

    A window without a neighbour is dropped. Shear stress builds up over a length L of travel, so that on a slope that
    steepens the soil lags behind the slip S of Eq (1) of the paper. To first order, the slip that the soil feels is S -
    (L / (r omega) - T) dS/dt, where r omega is the rim speed, T the damping time of the lag, and dS/dt the change
    between the windows before and after on the window's wheel.

    Parameters
    ----------
    windows : sequence of Window
        Steady windows of one run.
    length : float
        Length of a window [s].
    lag : RelaxedSlip
        Lag of the soil: the length L and the time T.
    """
    # Windows of one wheel are numbered by their start, so that neighbours are found by number.
    at = {(window.wheel, round(window.start / length)): window for window in windows}
    pairs = []
    for (wheel, number), window in at.items():
        neighbours = [at[wheel, place] for place in (number - 1, number + 1) if (wheel, place) in at]
        if not neighbours:
            continue
        first, *_, last = sorted((window, *neighbours), key=lambda member: member.start)
        # dS/dt is a central difference if both neighbours exist, else one-sided.
        rate = (last.slip - first.slip) / (last.start - first.start)
        soil_slip = window.slip - (float(lag.length) / window.rim - float(lag.damping)) * rate
        pairs.append((float(np.mean([neighbour.slip for neighbour in neighbours])), window._replace(slip=soil_slip)))
    return pairs


def classify(pairs: Sequence[tuple[float, Window]], sampling: Sampling, loads: float = math.inf) -> list[list[Window]]:
    """Group windows into classes of nearly equal slip (and load), and return the classes in the order of slip and load.

    Classes with fewer than `sampling.least` windows are dropped.

    Parameters
    ----------
    pairs : sequence of (float, Window)
        Mean slip of each window's neighbours, for the classification of the window, and the window.
    sampling : Sampling
        Width of the classes.
    loads : float
        Width of a class in ln W, with the wheel load W; infinite for classes of slip alone.
    """
    classes: dict[tuple[int, int], list[Window]] = {}
    for neighbour_slip, window in pairs:
        # With an infinite width in ln W, every load falls into class 0.
        key = (math.floor(neighbour_slip * sampling.levels), math.floor(math.log(window.load) / loads))
        classes.setdefault(key, []).append(window)
    return [windows for _, windows in sorted(classes.items()) if len(windows) >= sampling.least]


def points_of(classes: Sequence[Sequence[Window]], sampling: Sampling, constant: float) -> np.ndarray:
    """Return mean values and SDs for each class of windows, one row for each class (classes, 7).

    The columns are slip, factor T / (r W), SD of the factor, SD of the slip, shared SD of the factor, shared SD of the
    slip, and load W [N], with the torque T and the radius r. The scatter between windows and the scatter between wheels
    are both pooled over the classes, and the larger one counts: wheels may differ from one another by more than their
    windows do. Shared errors do not average out over the classes. They are the error of the loads, the relative SD of
    the torque constant, and the mean error of the wheels' rates and radii.

    Parameters
    ----------
    classes : sequence of sequences of Window
        The classes, from `classify`.
    sampling : Sampling
        Assumed errors.
    constant : float
        Relative SD of the torque constant, from `torque_constant_sd`.
    """
    windows_sd, wheels_sd = pooled_sd(classes, by_wheel=False), pooled_sd(classes, by_wheel=True)
    rows = []
    for windows in classes:
        count, wheels = len(windows), len({window.wheel for window in windows})
        means = [(window.slip, window.factor, window.factor_per_rate, window.load) for window in windows]
        slip, factor, lean, load = (float(np.mean(values)) for values in zip(*means, strict=True))
        # Repeats of one wheel hide the differences between wheels, so the larger SD counts.
        scatter_sd = max(windows_sd / math.sqrt(count), wheels_sd / math.sqrt(wheels))
        noise = rms([window.factor_sd for window in windows]) / math.sqrt(count)
        wheel_error = sampling.wheel_error / math.sqrt(wheels)
        # An error of the torque constant acts on the factor and on its part that depends on the wheel rate.
        shared = math.hypot(sampling.load_error * factor, constant * (factor + lean), lean * wheel_error)
        slip_sd = rms([window.slip_sd for window in windows]) / math.sqrt(count)
        rows.append((slip, factor, math.hypot(scatter_sd, noise), slip_sd, shared, (1.0 - slip) * wheel_error, load))
    return np.array(rows)


def pooled_sd(classes: Sequence[Sequence[Window]], by_wheel: bool) -> float:
    """Return the SD of the torque factor T / (r W) within the classes, pooled over all classes; 0 if no class has
    repeats.

    If `by_wheel` is True, the SD is that between the means of the wheels, otherwise that between single windows.
    """
    # Sum of squares about the class means, divided by the number of values minus the number of classes.
    squares, freedom = 0.0, 0
    for windows in classes:
        values = np.array([window.factor for window in windows])
        # The mean of each wheel counts as one value.
        if by_wheel:
            wheel = np.array([window.wheel for window in windows])
            values = np.array([np.mean(values[wheel == wheel_index]) for wheel_index in np.unique(wheel)])
        squares += float(np.sum((values - np.mean(values)) ** 2))
        freedom += len(values) - 1
    return math.sqrt(squares / freedom) if freedom else 0.0


def torque_constant_sd(motor: Mapping[str, Any]) -> float:
    """Return the relative SD of the torque constant (gear ratio times k_t) that a table [motor] declares."""
    # The relative SDs of the factors of a product add in quadrature.
    declared = [motor[name] for name in IN_POINTS if isinstance(motor.get(name), Mapping)]
    return math.hypot(*(float(entry.get("sd", 0.0)) / abs(float(entry["value"])) for entry in declared))


def rms(values: Sequence[float]) -> float:
    """Return the root mean square of some values; 0 for an empty sequence."""
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else 0.0
