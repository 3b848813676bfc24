"""Traction factors from a drive log, as section 4 of the paper takes them: motor torque over static load, by slip."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.base.errors import DataError
from rover_pin.base.jobs.time_left import telling
from rover_pin.base.quantity import declared_sds, record_from
from rover_pin.contact import Soil
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.logs.drive_log import DriveLog
from rover_pin.measurements.steady_windows import Steady, Window, steady_windows
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.simulation.model.defaults import usual_angles, usual_slip
from rover_pin.simulation.model.motor import Motor
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.wheel_forces import TorqueTraction


@dataclass(frozen=True)
class Sampling:
    """How windows are gathered, and what does not average out over them (all assumed).

    The shortest of `lengths` [s] is taken whose slips scatter by less than half a class of 1 / `levels`; a class has
    `least` windows, of loads within a factor exp(`loads`) where the arc follows from the load. `load_error` is the
    relative error of all loads and torques together: where the ground bends within a wheelbase the static balance
    misses by 1 %, motor constants are known to 1 or 2 %. `wheel_error` is the relative error of one wheel's rate and
    radius.
    """

    lengths: tuple[float, ...] = (2.0, 4.0, 8.0)
    levels: int = 20
    loads: float = 0.25
    least: int = 3
    load_error: float = 0.02
    wheel_error: float = 0.01
    steady: Steady = Steady()


SAMPLING = Sampling()
IN_POINTS = ("gear", "k_t")
"""Motor constants whose declared SD is an error that all points share: their product is the torque's constant."""


def points_of_log(log: DriveLog, sampling: Sampling = SAMPLING) -> TractionPoints:
    """Return the traction points of a drive log with the motor that it must declare."""
    if log.metadata.place:
        raise DataError(f"{log.folder}: the pose is the wheels' odometry, which tells no slip: give a measured one.")
    if not log.metadata.motor:
        raise DataError(
            f"{log.folder}: drive.toml declares no [motor], and the torque is evaluated from its characteristics: "
            "add supply, resistance, k_t and gear."
        )
    return drive_points(log, record_from(Motor, log.metadata.motor, f"{log.file}: [motor]"), sampling)


def drive_points(
    log: DriveLog, motor: Motor, sampling: Sampling = SAMPLING, lag: RelaxedSlip | None = None
) -> TractionPoints:
    """Return mean torque factors T / (r W) by class of slip, with the SDs of both means.

    Single samples of slip are too noisy to be classed: a class would gather what the noise brought there, and the curve
    would come out too flat (regression dilution). So samples are averaged over steady windows first, a window is put in
    its class by the slip of the windows before and after it, whose noise is not its own (an instrumental variable), and
    each class has an error in both axes, which `TractionPoints` weighs. All wheels are gathered. `lag` is that of the
    slip behind its speeds, the rover's usual one where it is not given.

    Raises DataError: a missing channel, slips that scatter by more than a class, or no class with enough windows.

    Source: section 4, "the traction force is evaluated from the angular velocity of the wheel using the characteristics
    of the corresponding motor. The normal load on each tire is evaluated ... considering static balance"; grouping by
    an instrument: Wald, Annals of Mathematical Statistics 11 (1940) 284, Durbin, Review of the ISI 22 (1954) 23.
    Differs from the paper: it classes single measurements and plots their scatter, without an error of the slip. A
    measured current tells the torque where there is one; driving torques are in the balance (`driven_loads`). The
    rotor's and the body's acceleration are neglected, hence the steady windows.
    """
    rover = log.load_rover().under(log.metadata.gravity)
    for trace in log.runs:
        if len(trace.t) < 2:
            raise DataError(f"{log.folder}: run {trace.attrs['file']} has {len(trace.t)} row: leave it out.")
    for length in sampling.lengths:
        cut = (steady_windows(trace, rover, motor, length, sampling.steady) for trace in log.runs)
        runs = list(telling(cut, len(log.runs), f"runs cut into windows of {length:g} s"))
        scatter = rms([window.slip_sd for windows in runs for window in windows])
        if scatter < 0.5 / sampling.levels:
            break
    if scatter > 1.0 / sampling.levels:
        raise DataError(
            f"{log.folder}: the slip of a window of {length:g} s scatters by {scatter:.2g}, more than a class of "
            f"{1.0 / sampling.levels:g}: drive longer at constant duty, or track the rover more finely."
        )
    lag, angles = lag or usual_slip(rover), usual_angles(rover, log.metadata.angles)
    by_load = sampling.loads if isinstance(angles, SinkageAngles) else math.inf
    classes = classify([pair for windows in runs for pair in soil_windows(windows, length, lag)], sampling, by_load)
    if not classes:
        raise DataError(
            f"{log.folder}: no class of slip has {sampling.least} steady windows of {length:g} s: drive longer at "
            "constant duty, over slopes that change the slip."
        )
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
    """Return windows with the slip that the soil feels, each beside the mean slip of the windows next to it.

    Shear builds up over a length L of travel, so that on a slope that steepens the soil lags behind Eq (1):
    S_felt = S - (L / (r omega) - T) dS/dt to first order, with dS/dt between the windows before and after on the same
    wheel. A window without any is left out.
    """
    at = {(window.wheel, round(window.start / length)): window for window in windows}
    pairs = []
    for (wheel, number), window in at.items():
        beside = [
            at[wheel, neighbour_number]
            for neighbour_number in (number - 1, number + 1)
            if (wheel, neighbour_number) in at
        ]
        if not beside:
            continue
        first, *_, last = sorted((window, *beside), key=lambda each: each.start)
        rate = (last.slip - first.slip) / (last.start - first.start)
        soil_slip = window.slip - (float(lag.length) / window.rim - float(lag.damping)) * rate
        pairs.append((float(np.mean([neighbour.slip for neighbour in beside])), window._replace(slip=soil_slip)))
    return pairs


def classify(pairs: Sequence[tuple[float, Window]], sampling: Sampling, loads: float = math.inf) -> list[list[Window]]:
    """Return the classes of windows that are full enough, by what stands beside them and by ln W in steps `loads`."""
    classes: dict[tuple[int, int], list[Window]] = {}
    for beside, window in pairs:
        key = (math.floor(beside * sampling.levels), math.floor(math.log(window.load) / loads))
        classes.setdefault(key, []).append(window)
    return [windows for _, windows in sorted(classes.items()) if len(windows) >= sampling.least]


def points_of(classes: Sequence[Sequence[Window]], sampling: Sampling, constant: float) -> np.ndarray:
    """Return mean slip and factor, SDs of factor and slip, the SDs that all classes share of both, W [classes, 7].

    The scatter of windows is pooled over the classes, as is that between wheels, which wins where wheels differ among
    themselves. What all classes share does not average over them: the loads' error, the torque `constant`'s relative
    SD, and the mean error of the wheels' rates and radii.
    """
    windows_sd, wheels_sd = pooled_sd(classes, by_wheel=False), pooled_sd(classes, by_wheel=True)
    rows = []
    for windows in classes:
        count, wheels = len(windows), len({window.wheel for window in windows})
        means = [(window.slip, window.factor, window.factor_per_rate, window.load) for window in windows]
        slip, factor, lean, load = (float(np.mean(values)) for values in zip(*means, strict=True))
        scatter_sd = max(windows_sd / math.sqrt(count), wheels_sd / math.sqrt(wheels))
        noise = rms([window.factor_sd for window in windows]) / math.sqrt(count)
        wheel_error = sampling.wheel_error / math.sqrt(wheels)
        shared = math.hypot(sampling.load_error * factor, constant * (factor + lean), lean * wheel_error)
        slip_sd = rms([window.slip_sd for window in windows]) / math.sqrt(count)
        rows.append((slip, factor, math.hypot(scatter_sd, noise), slip_sd, shared, (1.0 - slip) * wheel_error, load))
    return np.array(rows)


def pooled_sd(classes: Sequence[Sequence[Window]], by_wheel: bool) -> float:
    """Return the SD of the factor within classes: of windows, or of wheels' means; 0 where nothing repeats."""
    squares, freedom = 0.0, 0
    for windows in classes:
        values = np.array([window.factor for window in windows])
        if by_wheel:
            wheel = np.array([window.wheel for window in windows])
            values = np.array([np.mean(values[wheel == wheel_index]) for wheel_index in np.unique(wheel)])
        squares += float(np.sum((values - np.mean(values)) ** 2))
        freedom += len(values) - 1
    return math.sqrt(squares / freedom) if freedom else 0.0


def torque_constant_sd(motor: Mapping[str, Any]) -> float:
    """Return the relative SD that the log declares for its motor's torque constant, gear k_t."""
    declared = [motor[name] for name in IN_POINTS if isinstance(motor.get(name), Mapping)]
    return math.hypot(*(float(entry.get("sd", 0.0)) / abs(float(entry["value"])) for entry in declared))


def rms(values: Sequence[float]) -> float:
    """Return the root of the mean square; 0 of nothing."""
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else 0.0
