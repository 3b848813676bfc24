"""A drive log as traction factors by slip, and what moves the points that were worked out of it: motor and lag."""

from collections.abc import Iterator

import numpy as np

from rover_pin.base.quantity import declared_sds, quantities, record_from
from rover_pin.discrepancy.standalone import Parts
from rover_pin.effects.slip import RelaxedSlip
from rover_pin.estimation.parameter import declared_in, parameter_of
from rover_pin.experiments.drive_log.model import MOTOR_SD, usual_soil
from rover_pin.experiments.traction_factors import Shift, TractionFactors
from rover_pin.logs.drive_log import DriveLog
from rover_pin.measurements.drive_points import IN_POINTS, SAMPLING, drive_points, points_of_log
from rover_pin.measurements.known import DECLARED_SD
from rover_pin.measurements.traction_points import TractionPoints
from rover_pin.simulation.model.defaults import usual_slip
from rover_pin.simulation.model.motor import Motor

OF_MOTOR = ("supply", "resistance", "k_t", "gear")


def factors_of(log: DriveLog) -> TractionFactors:
    """Return the traction factors of a drive log that declares its [motor], as section 4 of the paper takes them.

    Raises
    ------
    DataError
        What `points_of_log` refuses.
    """
    points = points_of_log(log)
    motor = record_from(Motor, log.metadata.motor, f"{log.file}: [motor]")
    lag = usual_slip(log.load_rover())
    soil = usual_soil(log.load_rover()).replace(**points.declared)
    declared = Parts({"soil": soil, "wheel": points.wheel, "motor": motor, "RelaxedSlip": lag})
    shifts = (*_of_motor(log, motor, points), *_of_lag(log, motor, lag, points))
    return TractionFactors(points, declared, shifts, log.metadata.name)


def _of_motor(log: DriveLog, motor: Motor, points: TractionPoints) -> Iterator[Shift]:
    """Yield the motor's constants whose error is not among those that the points share."""
    sds = declared_sds(log.metadata.motor, Motor, f"{log.file}: [motor]")
    for name in OF_MOTOR:
        value = float(getattr(motor, name))
        sd = sds.get(name, MOTOR_SD.get(name, 0.0) * value)
        if sd > 0.0 and not (name in sds and name in IN_POINTS):
            source = declared_in("motor", name, log.metadata.motor, sds)
            number = parameter_of(f"motor.{name}", motor, sd, declared=source)
            yield Shift(number, _moved(drive_points(log, motor.replace(**{name: value + sd})), points))


def _of_lag(log: DriveLog, motor: Motor, lag: RelaxedSlip, points: TractionPoints) -> Iterator[Shift]:
    """Yield length and damping of the lag of the slip, which nobody declares."""
    for name in quantities(lag):
        value = float(getattr(lag, name))
        sd = DECLARED_SD * value
        if sd > 0.0:
            moved = drive_points(log, motor, SAMPLING, lag.replace(**{name: value + sd}))
            yield Shift(parameter_of(f"RelaxedSlip.{name}", lag, sd), _moved(moved, points))


def _moved(moved: TractionPoints, points: TractionPoints) -> np.ndarray:
    """Return what a model must add to its factor at each point where the log was read with a wrong number.

    The points of the right number are higher by their difference; each is compared with the nearest of them by slip
    and load, which is as a rule of the same class.
    """
    places = [np.column_stack([each.slip * SAMPLING.levels, _log_load(each)]) for each in (points, moved)]
    distance = np.linalg.norm(places[0][:, None] - places[1][None], axis=2)
    return np.asarray(points.factor - moved.factor[distance.argmin(axis=1)])


def _log_load(points: TractionPoints) -> np.ndarray:
    loads = points.loads
    return np.log(loads) / SAMPLING.loads if loads.size else np.zeros(len(points.slip))
