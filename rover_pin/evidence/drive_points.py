"""Traction factors from a drive log, as section 4 of the paper takes them: motor torque over static load, by slip."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rover_pin.body.rover import Rover, load_rover
from rover_pin.body.statics import wheel_loads
from rover_pin.errors import DataError
from rover_pin.evidence.traction_points import TractionPoints
from rover_pin.motion.drive_log import DriveLog, read_drive_log
from rover_pin.motion.motor import Motor
from rover_pin.motion.trace import Trace
from rover_pin.quantity import record_from
from rover_pin.soil.slip import slip_ratio
from rover_pin.soil.traction import TorqueTraction

PITCHES = np.radians(np.arange(-30.0, 31.0, 2.0))


@dataclass(frozen=True)
class Sampling:
    """Which samples count, and how they are gathered.

    `settle` s at the start and `slowest` rim speed [m/s] cut out what is not steady; `rate` [m/s^2] cuts out changes of
    speed; samples within `correlated` s of each other count as one; `levels` classes of slip are made. `load_error` is
    the relative error of a static load, which does not average: statics leaves out that driving torques load the
    pivots, 5 to 9 % in a simulated climb.
    """

    levels: int = 12
    least: int = 3
    settle: float = 2.0
    slowest: float = 0.005
    rate: float = 0.02
    correlated: float = 0.5
    load_error: float = 0.05


SAMPLING = Sampling()


def read_drive_points(folder: str | Path, sampling: Sampling = SAMPLING) -> TractionPoints:
    """Return the traction points of the drive log in `folder`, which must declare its [motor]."""
    log = read_drive_log(folder)
    if not log.about.motor:
        raise DataError(
            f"{folder}: drive.toml declares no [motor], and the torque is evaluated from its characteristics: "
            "add supply, resistance, k_t and gear."
        )
    return drive_points(log, record_from(Motor, log.about.motor, f"{folder}: [motor]"), sampling)


def drive_points(log: DriveLog, motor: Motor, sampling: Sampling = SAMPLING) -> TractionPoints:
    """Return mean torque factors T / (r W) by class of slip, with the SD of each mean.

    T = K (delta V - K omega) / R from duty and wheel rate, W the static load of the wheel at the body's pitch, S by
    Eq (1) from the wheel rate and the tracked speed of the body along its heading. All wheels are gathered.

    Raises
    ------
    DataError
        A missing channel, or no class of slip with enough steady samples.

    Source: section 4, "the traction force is evaluated from the angular velocity of the wheel using the characteristics
    of the corresponding motor. The normal load on each tire is evaluated ... considering static balance".
    Differs from the paper: nothing; the rotor's and the body's acceleration are neglected, hence the steady samples.
    """
    rover = load_rover(log.rover)
    for trace in log.runs:
        if len(trace.t) < 2:
            raise DataError(f"{log.folder}: run {trace.attrs['file']} has {len(trace.t)} row: leave it out.")
    gathered = [samples(trace, rover, motor, log.about.gravity, sampling) for trace in log.runs]
    slip, factor, worth = (np.concatenate([part[i] for part in gathered]) for i in range(3))
    means = classes(slip, factor, worth, sampling)
    if not means:
        raise DataError(
            f"{log.folder}: no class of slip has {sampling.least} steady, independent samples: drive longer at "
            "constant duty, over slopes that change the slip."
        )
    points = np.array(means)
    return TractionPoints(points[:, 0], points[:, 1], points[:, 2], rover.wheel, TorqueTraction())


def samples(trace: Trace, rover: Rover, motor: Motor, gravity: float, sampling: Sampling) -> tuple[Any, Any, Any]:
    """Return slip, factor and worth (independent samples per sample) of all wheels' steady samples of a run."""
    names = [mount.name for mount in rover.wheels]
    t, v_x, v_y, yaw, pitch = trace.need("t_s", "body_vx", "body_vy", "body_yaw", "body_pitch")
    duties = trace.need(*(f"duty_{name}" for name in names))
    rates = trace.need(*(f"wheel_rate_{name}" for name in names))
    speed = (v_x * np.cos(yaw) + v_y * np.sin(yaw)) / np.cos(pitch)
    table = np.array([wheel_loads(rover, -float(each), gravity=gravity) for each in PITCHES])
    steady = (t - t[0] > sampling.settle) & (np.abs(np.gradient(speed, t)) < sampling.rate)
    found = []
    for i, mount in enumerate(rover.wheels):
        rim, r = float(mount.wheel.r) * rates[i], float(mount.wheel.r)
        use = steady & (rim > sampling.slowest) & (speed > -1e-3) & np.isfinite(rim + speed + duties[i])
        drive = motor.drive(duties[i][use], rates[i][use])
        load = np.interp(pitch[use], PITCHES, table[:, i])
        slip = np.array([float(slip_ratio(a, b)) for a, b in zip(rim[use], speed[use], strict=True)])
        found.append((slip, drive.constant * drive.current / (r * load)))
    worth = min(1.0, float(np.median(np.diff(t))) / sampling.correlated)
    slip, factor = (np.concatenate(each) for each in zip(*found, strict=True))
    return slip, factor, np.full(slip.shape, worth)


def classes(slip: np.ndarray, factor: np.ndarray, worth: np.ndarray, sampling: Sampling) -> list[tuple[float, ...]]:
    """Return (mean slip, mean factor, SD of the mean) of every class of slip from 0 to 1 that has enough samples."""
    made: list[tuple[float, ...]] = []
    edges = np.linspace(0.0, 1.0, sampling.levels + 1)
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = (slip >= low) & (slip < high)
        count = float(np.sum(worth[inside]))
        if count >= sampling.least:
            mean = float(np.mean(factor[inside]))
            sd = math.hypot(float(np.std(factor[inside])) / math.sqrt(count), sampling.load_error * mean)
            made.append((float(np.mean(slip[inside])), mean, sd))
    return made
