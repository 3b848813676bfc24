"""Whether a drive log can answer at all: refusals, findings that a reader should know of, and what to drive next.

`read_drive_log` has refused before: clocks that run back, text for numbers, duties in percent, undeclared wheels.
"""

from collections.abc import Callable, Iterator

from rover_pin.base.errors import DataError
from rover_pin.base.jobs.time_left import telling
from rover_pin.base.quantity import quantities, record_from
from rover_pin.contact import Wheel
from rover_pin.experiments.drive_log.checks import columns, declared, excitation, odometry, sensors, signs, speeds
from rover_pin.experiments.drive_log.checks.driven import Declared, Driven, Remarks
from rover_pin.experiments.drive_log.checks.units import unit_faults
from rover_pin.experiments.drive_log.features import BLOCK, logged_run
from rover_pin.experiments.drive_log.readings.lane_borders import lanes_under
from rover_pin.logs.drive_log import DriveLog
from rover_pin.logs.run_terrain import is_of_run
from rover_pin.measurements.checks import Finding, merge_findings
from rover_pin.rover.wheel_base import base_of
from rover_pin.simulation.model.motor import Motor


def refuse_unfit(log: DriveLog) -> None:
    """Refuse a log that would mislead whatever the model.

    Raises DataError: a needed channel that is missing, mostly empty or stuck; an infinite number; a wrong unit; a wrong
    sign. The first of `faults`.
    """
    log_faults = faults(log)
    if log_faults:
        more = f" ({len(log_faults) - 1} more such faults.)" if len(log_faults) > 1 else ""
        raise DataError(f"{log.folder.name}/{log_faults[0]}{more}")


def faults(log: DriveLog) -> tuple[Finding, ...]:
    """Return every reason to refuse the log, those that differ only in their run as one."""
    missing = [*declared.rover_faults(log), *columns.column_faults(log), *columns.absurd_faults(log)]
    return merge_findings(missing or _faults_of_runs(log))


def _faults_of_runs(log: DriveLog) -> Iterator[Finding]:
    """Yield of each run what the first stage finds that finds anything, and currents that are not its motors'."""
    runs = driven_runs(log)
    for run in telling(runs, len(runs), "runs looked at for faults"):
        by_stage = ([finding for check in checks for finding in _by(check, run)] for checks in FAULTS)
        yield from (*next(filter(None, by_stage), []), *_by(sensors.current_faults, run))


Check = Callable[[Driven], Remarks]
FAULTS: tuple[tuple[Check, ...], ...] = (
    (sensors.frozen_faults, signs.wheel_sign_faults),
    (declared.far_faults, unit_faults, speeds.velocity_faults, speeds.height_faults, speeds.racing_faults,
     declared.start_faults),
    (signs.heading_faults, signs.pitch_faults, odometry.odometry_faults),
)  # fmt: skip
"""What refuses a run: speeds tell something only where the wheels are right, signs only where the units are."""
FINDINGS: tuple[Check, ...] = (
    declared.start_findings, declared.ground_findings, columns.gap_findings, columns.clock_findings,
    columns.ambiguous_step_findings, sensors.stuck_findings, sensors.jump_findings, sensors.range_findings,
    sensors.supply_findings, odometry.odometry_findings, sensors.current_findings, signs.differential_findings,
)  # fmt: skip
"""What a reader should know of a run."""


def _by(check: Check, run: Driven) -> Iterator[Finding]:
    return (Finding(what, run.name, todo) for what, todo in check(run))


def findings(log: DriveLog) -> tuple[Finding, ...]:
    """Return what a reader should know, one line each: channels, gaps, sensors, then excitation."""
    of_data = [*columns.column_findings(log), *declared.declared_findings(log), *_of_runs(log)]
    of_loop = excitation.excitation_findings(driven_runs(log), log.metadata.name)
    return merge_findings([*of_data, *compared_findings(log), *of_loop])


def data_findings(log: DriveLog) -> tuple[Finding, ...]:
    """Return those of the findings that say of the data what any fit to them should know: channels, gaps, sensors."""
    return merge_findings([*columns.column_findings(log), *_of_runs(log)])


def _of_runs(log: DriveLog) -> Iterator[Finding]:
    runs = driven_runs(log)
    for run in telling(runs, len(runs), "runs checked"):
        for check in FINDINGS:
            yield from _by(check, run)


def too_poor(log: DriveLog) -> str:
    """Return why the log cannot tell an effect from soil and motor and what would, or an empty string."""
    return excitation.too_poor(driven_runs(log))


def driven_runs(log: DriveLog) -> list[Driven]:
    """Return the runs as the checks look at them, with the wheels' radius as declared, else the rover's."""
    rover, metadata = log.load_rover(), log.metadata
    declared_wheel = {name: entry for name, entry in metadata.wheel.items() if name == "r"}
    wheel = record_from(Wheel, declared_wheel, f"{log.file}: [wheel]") if declared_wheel else rover.wheel
    of_log = Declared(
        _motor(log, {"supply", "resistance"}),
        _motor(log, {"supply", "resistance", "k_t", "gear"}),
        log.terrain() if metadata.terrain and not is_of_run(metadata.terrain) else None,
        base_of(rover).length,
        rover.differential is not None,
    )
    return [Driven(run, float(wheel.r), of_log) for run in log.runs]


def _motor(log: DriveLog, needed: set[str]) -> Motor | None:
    """Return the motor of a log that declares what is needed of it, or None, without what is no part of a `Motor`."""
    table = {name: entry for name, entry in log.metadata.motor.items() if name in quantities(Motor)}
    return record_from(Motor, table, f"{log.file}: [motor]") if needed <= table.keys() else None


def compared_findings(log: DriveLog) -> Iterator[Finding]:
    """Yield each run without a half-second mean that is compared: left out like any other, it tells nothing.

    Yield also how long a wheel stood on the border of two lanes, where that was long enough to be missed.
    """
    rover, shared = log.load_rover(), log.terrain()
    for trace in log.runs:
        run = logged_run(trace, rover, lanes_under(log, trace, shared))
        if run.on_border > BLOCK:
            yield Finding(
                f"for {run.on_border:.1f} s a wheel stands on the border of lanes of other heights: what carries it "
                "there is not declared, and not compared",
                str(trace.attrs["file"]),
                "drive in the middle of the lanes, or declare the ground as a grid",
            )
        if not run.usable.any():
            yield Finding(
                "the rover stands or turns on the spot, so nothing of this run is compared, and leaving it out tests "
                "nothing",
                str(trace.attrs["file"]),
                "drop it from drive.toml, or drive ahead or back for 5 s or more in it",
            )
