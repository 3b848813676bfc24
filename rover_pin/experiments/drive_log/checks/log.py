"""Apply all checks of a drive log, and list them in tables with their limits and remedies.

A check of a run is a row (statistic, limit, remedy) of the table REFUSALS or NOTES. `refuse_unfit` stops the search for
missing effects before it fits a log that would mislead every model. `findings` returns the notes for the reader. Checks
of the whole log (its rover, channels, declared values and manoeuvres) are called directly. `read_drive_log` has already
refused decreasing times, text in place of numbers, duties in percent, and undeclared wheels.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from rover_pin.base.errors import DataError
from rover_pin.base.jobs.time_left import showing_progress
from rover_pin.base.quantity import Record, quantities, record_from
from rover_pin.contact import Wheel
from rover_pin.estimation.wording import MAX_NOISE_RATIO
from rover_pin.experiments.drive_log.checks import channels, excitation, motors, pose
from rover_pin.experiments.drive_log.checks.run_blocks import (
    SUSPECT_RATIO,
    WRONG_RATIO,
    DeclaredFacts,
    Remarks,
    RunBlocks,
)
from rover_pin.experiments.drive_log.excluded_rows import lanes_under, white_noise_sd
from rover_pin.experiments.drive_log.features import BLOCK, logged_run
from rover_pin.experiments.drive_log.model import is_rate_driven, undeclared_constants, usual_soil
from rover_pin.logs.drive_log import FILE, NOISE, DriveLog, kind_of
from rover_pin.logs.run_terrain import is_of_run
from rover_pin.measurements.checks import Finding, merge_findings
from rover_pin.rover.wheel_base import base_of
from rover_pin.simulation.model.defaults import own_motor
from rover_pin.simulation.model.motor import Motor
from rover_pin.terrain.files import LARGEST

MAX_WHEEL_ERROR = 0.02
"""Maximum relative difference between a declared wheel radius or width and the radius or width of the rover's wheel. A
larger difference is not a rounding error: the smallest wheels have 5 mm, rounded to 0.1 mm."""

MAX_NUMBER = 1e12
"""Maximum absolute value of a number in a channel. A larger number is a code of a program for a missing value, because
no quantity of a rover comes near this number."""


class Check(NamedTuple):
    """A check of one run: a statistic, its limit (a statistic beyond it shows a fault), and the remedy of the fault."""

    statistic: Callable[[RunBlocks, Any], Remarks]
    """function of a run and the limit, which yields pairs (fault, remedy)"""
    limit: Any
    """limit of the statistic, in the unit of the statistic; the docstring of the statistic explains it"""
    remedy: str
    """remedy of the check, which is printed for faults whose own remedy is empty"""

    def findings(self, run: RunBlocks) -> Iterator[Finding]:
        """Apply the check to a run, and yield each fault as a finding with the name of the run's file and the
        remedy.
        """
        return (Finding(what, run.name, todo or self.remedy) for what, todo in self.statistic(run, self.limit))


REFUSALS: tuple[tuple[Check, ...], ...] = (
    (
        Check(channels.frozen_sensors, 0.1,
              "the sensor is stuck or unplugged: replace its data, or leave the run out"),
        Check(motors.wrong_wheel_signs, motors.OPPOSITE, "multiply the channel by -1"),
    ),
    (
        Check(pose.far_places, 10.0 * LARGEST, "give metres from an origin on the declared ground"),
        Check(channels.slow_sampling, 1.0,
              "if t_s is in milliseconds, divide t_s by 1000; otherwise log two rows a second or more"),
        Check(pose.wrong_speed_units, (0.5, 5.0),
              "check the units of wheel_rate_*, body_x and body_y, and the wheel's radius"),
        Check(channels.angles_in_degrees, channels.MAX_ANGLES,
              "if the channel is in degrees, multiply the channel by pi / 180"),
        Check(channels.thousandths, (channels.MAX_VOLTS, channels.MAX_AMPERES), "divide the channel by 1000"),
        Check(pose.wrong_velocity, 2.0, "give m/s, or leave body_vx and body_vy out"),
        Check(pose.racing_height, SUSPECT_RATIO, "give metres: if body_z is in mm, divide body_z by 1000"),
        Check(motors.racing_wheels, SUSPECT_RATIO, "give duties from -1 to 1, and correct [motor]"),
        Check(pose.start_offset, (0.25, math.radians(30.0)),
              "give start in the axes and units of body_x, body_y and body_yaw, or leave start out"),
    ),
    (
        Check(pose.wrong_heading, pose.MAX_ASTRAY,
              "check the axes of body_x and body_y, and that body_yaw is in radians and 0 along the x axis; or leave "
              "body_yaw out, so that import-log takes the direction of travel as heading"),
        Check(pose.wrong_pitch, 5.0, "multiply body_pitch by pi / 180, or by -1"),
        Check(pose.pose_of_the_wheels, 0.005,
              "give a pose from another sensor, such as a camera, GNSS or a total station; or write place = "
              "'odometry' in drive.toml: then only currents, tilts and turn rates are compared, and no slip"),
    ),
    (Check(motors.currents_off_the_motor, WRONG_RATIO, "give amperes, or leave the currents out"),),
)  # fmt: skip
"""Checks whose faults refuse a run, in four stages. Only the first of the first three stages that has a fault is
reported: speeds can be judged only after the wheels are right, and signs only after the units are right. The last stage
is always reported."""

NOTES: tuple[Check, ...] = (
    Check(pose.start_offset, (0.03, math.radians(6.0)),
          "the first seconds of the run are affected: correct start, or leave start out"),
    Check(pose.beyond_the_ground, 0.0, "the ground there is guessed: extend the terrain's file"),
    Check(channels.gaps, (channels.NOTABLE_SHARE, channels.NOTABLE_LENGTH), ""),
    Check(channels.late_samples, channels.MAX_LATE_PERIODS,
          "look for dropped frames; the motion between these samples is unknown"),
    Check(channels.ambiguous_duty_steps, 1, "the half-seconds around these steps are not compared"),
    Check(channels.stuck_channels, 3.0, "empty these cells, or leave the run out"),
    Check(channels.outlying_poses, 1, ""),
    Check(channels.jumps, channels.MIN_ANGLE_JUMP, "the tracker has probably lost the rover: empty the wrong cells"),
    Check(channels.spikes, 4.0, "empty these cells"),
    Check(motors.travel_against_wheels, 0.05,
          "the rover slides, or the clocks of tracker and wheels differ: compare their times"),
    Check(motors.negative_slip, -0.15,
          "check the wheel's radius and the tracker's scale, unless the rover drives downhill"),
    Check(motors.wrong_supply, 0.3, "correct the supply in [motor], or the voltage's scale"),
    Check(motors.currents_beyond_stall, 1.5,
          "correct resistance and supply in [motor], or the current's scale"),
    Check(pose.pose_like_the_wheels, 0.05,
          "if they are wheel odometry, give a measured pose; otherwise add runs on slopes, where the slip varies"),
    Check(motors.currents_off_the_motor, SUSPECT_RATIO,
          "check their scale, and supply, resistance, k_t and gear of [motor]"),
    Check(pose.unlevel_differential, 0.02,
          "take the potentiometers' zero on level ground, or expect a sensor bias"),
    Check(motors.doubtful_current_signs, motors.OPPOSITE, "check the zero and the sign of the channel"),
)  # fmt: skip
"""Checks whose faults are notes for the reader. The search for missing effects uses such a run and takes the fault into
account."""


def refuse_unfit(log: DriveLog) -> None:
    """Raise DataError if the log has a fault that would mislead every model, such as a wrong unit or a wrong sign.

    The error message states the first fault and the number of further faults.
    """
    log_faults = faults(log)
    if log_faults:
        more = f" ({len(log_faults) - 1} more such faults.)" if len(log_faults) > 1 else ""
        raise DataError(f"{log.folder.name}/{log_faults[0]}{more}")


def faults(log: DriveLog) -> tuple[Finding, ...]:
    """Return all faults that lead to the refusal of a drive log. A fault that several runs have is one finding.

    If the rover or a channel of the log is wrong, only these faults are returned, because the checks of the runs need
    correct channels.
    """
    of_log = [*rover_faults(log), *channels.missing_channels(log), *channels.absurd_numbers(log, MAX_NUMBER)]
    if of_log:
        return merge_findings(of_log)
    of_runs: list[Finding] = []
    runs = driven_runs(log)
    for run in showing_progress(runs, len(runs), "runs looked at for faults"):
        # A stage is computed only if the stages before find nothing: its statistics need the checked channels.
        *stages, last = REFUSALS
        by_stage = ([finding for check in stage for finding in check.findings(run)] for stage in stages)
        of_runs += next(filter(None, by_stage), [])
        of_runs += (finding for check in last for finding in check.findings(run))
    return merge_findings(of_runs)


def findings(log: DriveLog) -> tuple[Finding, ...]:
    """Return the notes of the data check for the reader: on channels, declared values, runs, and missing manoeuvres.

    A log with notes is fitted nevertheless. `faults` returns the faults that lead to a refusal.
    """
    # The same fault in several runs becomes one finding.
    of_data = [*channels.unrecorded_channels(log), *declared_findings(log), *_notes_of_runs(log)]
    of_loop = excitation.excitation_findings(driven_runs(log), log.metadata.name)
    return merge_findings([*of_data, *compared_findings(log), *of_loop])


def data_findings(log: DriveLog) -> tuple[Finding, ...]:
    """Return the notes that concern every fit to the log: on channels that are not recorded, gaps, and faulty
    sensors.
    """
    return merge_findings([*channels.unrecorded_channels(log), *_notes_of_runs(log)])


def _notes_of_runs(log: DriveLog) -> Iterator[Finding]:
    """Apply the checks of the table NOTES to all runs, and yield their findings."""
    runs = driven_runs(log)
    for run in showing_progress(runs, len(runs), "runs checked"):
        for check in NOTES:
            yield from check.findings(run)


def too_poor(log: DriveLog) -> str:
    """Return why the runs cannot distinguish a missing effect from wrong soil and motor constants, with the remedy.

    The text is empty if they can distinguish it.
    """
    return excitation.too_poor(driven_runs(log))


def driven_runs(log: DriveLog) -> list[RunBlocks]:
    """Return the runs of a log in the form that the checks need, with means over blocks of time.

    The radius of the wheels is the radius that the log declares, or otherwise the radius of the rover's wheels.
    """
    # A declared radius replaces that of the rover, as the user states it for this log.
    rover, metadata = log.load_rover(), log.metadata
    declared_wheel = {name: entry for name, entry in metadata.wheel.items() if name == "r"}
    wheel = record_from(Wheel, declared_wheel, f"{log.file}: [wheel]") if declared_wheel else rover.wheel
    # Checks of the motor use only what the log itself declares, because a usual motor could be another one.
    facts = DeclaredFacts(
        _motor(log, {"supply", "resistance"}),
        _motor(log, {"supply", "resistance", "k_t", "gear"}),
        log.terrain() if metadata.terrain and not is_of_run(metadata.terrain) else None,
        base_of(rover).length,
        rover.differential is not None,
    )
    return [RunBlocks(run, float(wheel.r), facts) for run in log.runs]


def _motor(log: DriveLog, needed: set[str]) -> Motor | None:
    """Return the motor that a log declares in its table [motor], or None if one of the `needed` numbers is not
    declared.

    Keys of the table that are not numbers of a motor are ignored.
    """
    # A motor with assumed numbers would accuse a correct log, so all needed numbers must be declared.
    table = {name: entry for name, entry in log.metadata.motor.items() if name in quantities(Motor)}
    return record_from(Motor, table, f"{log.file}: [motor]") if needed <= table.keys() else None


def rover_faults(log: DriveLog) -> Iterator[Finding]:
    """Yield a finding for each difference between the wheels of a log and the wheels of its rover, in name, radius or
    width.
    """
    rover = log.load_rover()
    # Every column of a wheel is found by the wheel's name, so the names must agree.
    rover_wheels = tuple(wheel.name for wheel in rover.wheels)
    if set(rover_wheels) != set(log.metadata.wheels):
        log_wheels = ", ".join(log.metadata.wheels)
        what = f"the wheels are {log_wheels}, but those of the rover '{rover.name}' are {', '.join(rover_wheels)}"
        yield Finding(what, FILE, "give the rover that was driven, and name wheels and columns as it does")
    for name in ("r", "b"):
        if name in log.metadata.wheel:
            size = float(getattr(record_from(Wheel, {name: log.metadata.wheel[name]}, f"{log.file}: [wheel]"), name))
            actual = float(getattr(rover.wheel, name))
            if abs(size - actual) > MAX_WHEEL_ERROR * actual:
                has = f"the wheels of the rover '{rover.name}' have {name} = {1e3 * actual:.4g} mm"
                what = f"[wheel] has {name} = {1e3 * size:.4g} mm, but {has}"
                yield Finding(what, FILE, "every simulation uses the rover's wheel: correct [wheel], or the rover")


def declared_findings(log: DriveLog) -> Iterator[Finding]:
    """Yield notes on the declared values of a log: soil and motor numbers that are not declared, and noise that is too
    small.

    A number that is not declared is reported with the value that the search for missing effects assumes. A declared
    noise is too small if the samples scatter by more than MAX_NOISE_RATIO times the declared SD.
    """
    rover = log.load_rover()
    records: dict[str, Record] = {"soil": usual_soil(rover)}
    # Without duties, a replay holds the wheels to their rates, so that the motor does not matter.
    if not is_rate_driven(log):
        records["motor"] = own_motor(rover).value
    for title, values in undeclared_constants(log, records).items():
        # The assumed values are printed, so that the reader sees what the loop would use.
        what = f"[{title}] does not declare {', '.join(values)}, so {', '.join(values.values())} are assumed"
        yield Finding(what, FILE, f"a wrong {title} can look like a missing effect: declare the known numbers")
    # Only the channel with the largest scatter of each kind is compared with [noise], so that a kind has one note.
    largest: dict[str, tuple[float, str, str]] = {}
    for run in log.runs:
        for name in (channel for channel in run.channels if kind_of(channel) in log.noise_sd):
            kind, scatter = kind_of(name), (white_noise_sd(run[name]), name, str(run.attrs["file"]))
            largest[kind] = max(largest.get(kind, scatter), scatter)
    for kind, (sd, name, where) in largest.items():
        stated = log.noise_sd[kind]
        if sd > MAX_NOISE_RATIO * stated:
            what = f"[noise] declares {kind} = {stated:.3g} {NOISE[kind]}, but {name} scatters by {sd:.3g}"
            yield Finding(what, where, "correct [noise]; until then the loop uses the scatter of the samples as noise")


def compared_findings(log: DriveLog) -> Iterator[Finding]:
    """Yield a finding for each run without compared rows, and for each run with a wheel on the border of two lanes.

    If no half-second mean of a run is compared, a fit to the other runs cannot be tested on it. If a wheel is on the
    border between two lanes with different heights, the height under this wheel is unknown.
    """
    rover, shared = log.load_rover(), log.terrain()
    for trace in log.runs:
        # The same function as in the fit decides which rows are compared.
        run, where = logged_run(trace, rover, lanes_under(log, trace, shared)), str(trace.attrs["file"])
        # Up to one block, a crossing of the border costs nothing worth a note.
        if run.on_border > BLOCK:
            yield Finding(
                f"for {run.on_border:.1f} s a wheel is on the border of lanes with different heights: the height under "
                "it is not declared, so this time is not compared",
                where,
                "drive in the middle of the lanes, or declare the ground as a grid",
            )
        if not run.usable.any():
            yield Finding(
                "the rover stands or turns on the spot, so nothing of this run is compared, and holding it out of a "
                "fit tests nothing",
                where,
                "remove the run from drive.toml, or drive ahead or back for 5 s or more in it",
            )
