"""What traction points of a drive log were worked out with: motor, loads and the lag of slip, each with its doubt."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from rover_pin.base.quantity import declared_sds, quantities, record_from
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.experiments.drive_log.model import MOTOR_SD
from rover_pin.identification.result import Held
from rover_pin.logs.drive_log import DriveLog
from rover_pin.measurements.drive_points import IN_POINTS, SAMPLING, drive_points
from rover_pin.measurements.known import ASSUMED, DECLARED_SD, range_of
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.simulation.model.defaults import usual_slip
from rover_pin.simulation.model.motor import Motor

OF_MOTOR = ("supply", "resistance", "k_t", "gear")


def derivation_inputs(log: DriveLog | None) -> tuple[Held, ...]:
    """Return the numbers with which a drive log's points were worked out; nothing for data that are of no log.

    A number whose error is not in the points' own moves them: its ends are the points worked out again.
    """
    if log is None:
        return ()
    motor = record_from(Motor, log.metadata.motor, f"{log.folder}: [motor]")
    return (*_of_motor(log, motor), *_of_lag(log, motor), *_of_loads(log))


def _of_motor(log: DriveLog, motor: Motor) -> Iterator[Held]:
    """Yield the motor's constants; supply and k_t that state no SD share that of resistance and gear."""
    table: Mapping[str, Any] = log.metadata.motor
    sds = declared_sds(table, Motor, f"{log.folder}: [motor]")
    for name in OF_MOTOR:
        value, spec = float(getattr(motor, name)), quantities(motor)[name]
        source = "declared with the data" if name in table else spec.source
        row = partial(Held, f"motor.{name}", spec.unit, value, source)
        if name in sds and name in IN_POINTS:
            yield row(value, value, f"its declared SD, {sds[name] / value:.2g} of it, is in the points' errors")
        elif name not in sds and name not in MOTOR_SD:
            yield row(value, value, f"in the doubt of {'resistance' if name == 'supply' else 'gear'}")
        else:
            sd = sds.get(name, MOTOR_SD.get(name, 0.0) * value)
            low, high = range_of(value, sd)
            ends = (_again(log, motor.replace(**{name: low})), _again(log, motor.replace(**{name: high})))
            yield row(low, high, "its declared SD" if name in sds else ASSUMED, ends)


def _of_lag(log: DriveLog, motor: Motor) -> Iterator[Held]:
    lag = usual_slip(log.load_rover())
    for name, spec in quantities(lag).items():
        value = float(getattr(lag, name))
        low, high = range_of(value, DECLARED_SD, relative=True)
        ends = (_again(log, motor, lag.replace(**{name: low})), _again(log, motor, lag.replace(**{name: high})))
        yield Held(f"RelaxedSlip.{name}", spec.unit, value, spec.source, low, high, ASSUMED, ends)


def _of_loads(log: DriveLog) -> Iterator[Held]:
    mass, g = float(log.load_rover().mass), float(log.metadata.gravity)
    share = f"{SAMPLING.load_error:.0%} of all loads is in the points' errors (assumed)"
    yield Held("gravity", "m/s^2", g, "the log's", g, g, "exact")
    yield Held("mass", "kg", mass, f"the rover's, '{log.metadata.rover}'", mass, mass, share)


def _again(log: DriveLog, motor: Motor, lag: RelaxedSlip | None = None) -> Callable[[], TractionPoints]:
    return partial(drive_points, log, motor, lag=lag)
