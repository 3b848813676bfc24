"""Whether a drive log can answer at all: refusals, findings that a reader should know of, and what to drive next.

`read_drive_log` has refused before: clocks that run back, text for numbers, duties in percent, undeclared wheels.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from rover_pin.base.errors import DataError
from rover_pin.base.jobs.time_left import telling
from rover_pin.base.quantity import quantities, record_from
from rover_pin.contact import Wheel
from rover_pin.experiments.drive_log.checks import excitation as drive_excitation
from rover_pin.experiments.drive_log.checks.columns import absurd_faults, column_faults, column_findings, gap_findings
from rover_pin.experiments.drive_log.checks.compared import compared_findings
from rover_pin.experiments.drive_log.checks.currents import current_faults, current_findings
from rover_pin.experiments.drive_log.checks.declared import (
    declared_findings,
    far_faults,
    ground_findings,
    rover_faults,
    start_faults,
    start_findings,
)
from rover_pin.experiments.drive_log.checks.driven import Driven
from rover_pin.experiments.drive_log.checks.odometry import odometry_faults, odometry_findings
from rover_pin.experiments.drive_log.checks.sensors import frozen_faults, jump_findings, range_findings, stuck_findings
from rover_pin.experiments.drive_log.checks.signs import differential_findings, sign_faults, wheel_sign_faults
from rover_pin.experiments.drive_log.checks.speeds import speed_faults
from rover_pin.experiments.drive_log.checks.units import unit_faults
from rover_pin.logs.drive_log import DriveLog
from rover_pin.logs.run_terrain import is_of_run
from rover_pin.measurements.finding import Finding, gathered
from rover_pin.rover.wheel_base import base_of
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.terrain import Terrain


class DriveFindings(NamedTuple):
    """What the check of a drive log that can be used found."""

    findings: tuple[Finding, ...]
    too_poor: str
    "why the log cannot answer and what would; empty where it can"


def check(log: DriveLog) -> DriveFindings:
    """Return everything that a reader should know of the log before any result.

    Raises
    ------
    DataError
        What `refuse_unfit` refuses.
    """
    refuse_unfit(log)
    return DriveFindings(findings(log), too_poor(log))


def refuse_unfit(log: DriveLog) -> None:
    """Refuse a log that would mislead whatever the model.

    Raises
    ------
    DataError
        A needed channel that is missing, mostly empty or stuck; an infinite number; a wrong unit; a wrong sign. The
        first of `faults`.
    """
    log_faults = faults(log)
    if log_faults:
        more = f" ({len(log_faults) - 1} more such faults.)" if len(log_faults) > 1 else ""
        raise DataError(f"{log.folder.name}/{log_faults[0]}{more}")


def faults(log: DriveLog) -> tuple[Finding, ...]:
    """Return every reason to refuse the log, those that differ only in their run as one."""
    missing = gathered([*rover_faults(log), *column_faults(log), *absurd_faults(log)])
    if missing:
        return missing
    motor, terrain, length = declared_motor(log), _terrain(log), _length(log)
    full_motor, runs = _whole_motor(log), driven(log)
    return gathered(
        fault
        for run in telling(runs, len(runs), "runs looked at for faults")
        for fault in (*_of_run(run, motor, terrain, length), *(current_faults(run, full_motor) if full_motor else ()))
    )


def _of_run(run: Driven, motor: Motor | None, terrain: Terrain | None, length: float) -> list[Finding]:
    """Return a run's faults: what the speeds tell only where the wheels are right, signs only where units are."""
    run_faults = [*frozen_faults(run), *wheel_sign_faults(run)]
    run_faults = run_faults or [
        *far_faults(run),
        *unit_faults(run, motor),
        *speed_faults(run, motor),
        *start_faults(run),
    ]
    return run_faults or [*sign_faults(run, terrain, length), *odometry_faults(run)]


def _length(log: DriveLog) -> float:
    """Return the length from the rear to the front axle of the rover [m]."""
    return base_of(log.load_rover()).length


def findings(log: DriveLog) -> tuple[Finding, ...]:
    """Return what a reader should know, one line each: channels, gaps, sensors, then excitation."""
    return gathered(_findings(log))


def data_findings(log: DriveLog) -> tuple[Finding, ...]:
    """Return those of the findings that say of the data what any fit to them should know: channels, gaps, sensors."""
    return gathered([*column_findings(log), *_of_runs(log)])


def _findings(log: DriveLog) -> Iterator[Finding]:
    yield from column_findings(log)
    yield from declared_findings(log)
    yield from _of_runs(log)
    yield from compared_findings(log)
    yield from drive_excitation.excitation_findings(driven(log), log.metadata.name)


def _of_runs(log: DriveLog) -> Iterator[Finding]:
    runs, motor = driven(log), declared_motor(log)
    joined = log.load_rover().differential is not None
    terrain, full_motor = _terrain(log), _whole_motor(log)
    for run in telling(runs, len(runs), "runs checked"):
        yield from start_findings(run)
        if terrain is not None:
            yield from ground_findings(run, terrain)
        yield from gap_findings(run.trace)
        yield from stuck_findings(run)
        yield from jump_findings(run)
        yield from range_findings(run, motor)
        yield from odometry_findings(run)
        yield from current_findings(run, full_motor) if full_motor else ()
        if joined:
            yield from differential_findings(run)


def too_poor(log: DriveLog) -> str:
    """Return why the log cannot tell an effect from soil and motor and what would, or an empty string."""
    return drive_excitation.too_poor(driven(log))


def driven(log: DriveLog) -> list[Driven]:
    """Return the runs as the checks look at them, with the wheels' radius as declared, else the rover's."""
    declared_wheel = {name: entry for name, entry in log.metadata.wheel.items() if name == "r"}
    wheel = record_from(Wheel, declared_wheel, f"{log.file}: [wheel]") if declared_wheel else log.load_rover().wheel
    return [Driven(run, float(wheel.r)) for run in log.runs]


def declared_motor(log: DriveLog) -> Motor | None:
    """Return the motor that the log declares, or None; what it declares of it beyond a `Motor` is left out."""
    table = {name: entry for name, entry in log.metadata.motor.items() if name in quantities(Motor)}
    is_declared = {"supply", "resistance"} <= table.keys()
    return record_from(Motor, table, f"{log.file}: [motor]") if is_declared else None


def _whole_motor(log: DriveLog) -> Motor | None:
    """Return the motor of a log that declares all that its current follows from, or None."""
    return declared_motor(log) if {"supply", "resistance", "k_t", "gear"} <= log.metadata.motor.keys() else None


def _terrain(log: DriveLog) -> Terrain | None:
    return log.terrain() if log.metadata.terrain and not is_of_run(log.metadata.terrain) else None
