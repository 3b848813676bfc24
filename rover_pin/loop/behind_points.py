"""What traction points of a drive log were worked out with: motor, loads and the lag of slip, each with its doubt."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from rover_pin.effects.slip import RelaxedSlip
from rover_pin.experiments.drive_log.model import MOTOR_SD
from rover_pin.identification.result import Held
from rover_pin.measurements.drive_points import SAMPLING, drive_points
from rover_pin.measurements.known import ASSUMED, DECLARED_SD, range_of
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.motion.defaults import usual_slip
from rover_pin.motion.drive_log import DriveLog, read_drive_log
from rover_pin.motion.motor import Motor
from rover_pin.paths import is_file
from rover_pin.quantity import declared_sds, quantities, record_from
from rover_pin.trust import Trust

IN_POINTS = ("gear", "k_t")
"""Motor constants whose declared SD is an error that all points share."""
OF_MOTOR = ("supply", "resistance", "k_t", "gear")


def behind_points(path: str | Path, trust: Trust = Trust()) -> tuple[Held, ...]:
    """Return the numbers with which a drive log's points were worked out; nothing for other data.

    A number whose error is not in the points' own moves them: its ends are the points worked out again.
    """
    if not is_file(Path(path) / "drive.toml") or is_file(Path(path) / "rig.toml"):
        return ()
    log = read_drive_log(path, trust)
    motor = record_from(Motor, log.about.motor, f"{path}: [motor]")
    return (*_of_motor(log, motor), *_of_lag(log, motor), *_of_loads(log))


def _of_motor(log: DriveLog, motor: Motor) -> Iterator[Held]:
    """Yield the motor's constants; supply and k_t that state no SD share that of resistance and gear."""
    table: Mapping[str, Any] = log.about.motor
    sds = declared_sds(table, Motor, f"{log.folder}: [motor]")
    for name in OF_MOTOR:
        value, about = float(getattr(motor, name)), quantities(motor)[name]
        source = "declared with the data" if name in table else about.source
        row = partial(Held, f"motor.{name}", about.unit, value, source)
        if name in sds and name in IN_POINTS:
            yield row(value, value, f"its declared SD, {sds[name] / value:.2g} of it, is in the points' errors")
        elif name not in sds and name not in MOTOR_SD:
            yield row(value, value, f"in the doubt of {'resistance' if name == 'supply' else 'gear'}")
        else:
            sd = sds.get(name, MOTOR_SD.get(name, 0.0) * value)
            again = [partial(_points, log, motor.replace(**{name: end})) for end in range_of(value, sd)]
            yield row(*range_of(value, sd), "its declared SD" if name in sds else ASSUMED, (again[0], again[1]))


def _of_lag(log: DriveLog, motor: Motor) -> Iterator[Held]:
    lag = usual_slip(log.load_rover())
    for name, about in quantities(lag).items():
        value = float(getattr(lag, name))
        low, high = range_of(value, DECLARED_SD, relative=True)
        ends = [partial(_points, log, motor, lag.replace(**{name: end})) for end in (low, high)]
        yield Held(f"RelaxedSlip.{name}", about.unit, value, about.source, low, high, ASSUMED, (ends[0], ends[1]))


def _of_loads(log: DriveLog) -> Iterator[Held]:
    mass, g = float(log.load_rover().mass), float(log.about.gravity)
    share = f"{SAMPLING.load_error:.0%} of all loads is in the points' errors (assumed)"
    yield Held("gravity", "m/s^2", g, "the log's", g, g, "exact")
    yield Held("mass", "kg", mass, f"the rover's, '{log.about.rover}'", mass, mass, share)


def _points(log: DriveLog, motor: Motor, lag: RelaxedSlip | None = None) -> TractionPoints:
    return drive_points(log, motor, SAMPLING, lag)
