"""The loop that advances a drive, and the passing of a controller's commands to the motors and the steering servos."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from typing import Any, NamedTuple, Protocol, TypeGuard, cast

import numpy as np

from rover_pin.base.errors import SimulationError
from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.failure import failure
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.control import CompiledController, commands_of
from rover_pin.simulation.native.loop import Loop, LoopStatus
from rover_pin.simulation.state import Checkpoint, DriveState
from rover_pin.simulation.stepping.pace import FINEST, AdjustableStepper
from rover_pin.simulation.stepping.timing import Timing

ROWS_PER_PROGRESS = 50
"""Number of rows between two calls of a progress function, which shows the user the progress of the drive. At 50 rows,
which are 2.5 s of a usual drive, the calls take no noticeable time."""
MAX_STEPS_PER_FOLLOWED = 2
"""Largest number of steps that a drive takes for each step of an earlier drive, when it repeats the earlier drive with
equal or with halved steps. Memory is reserved for this number of steps."""

Progress = Callable[[float], None]
"""A progress function: the drive calls it from time to time with the simulated time [s]."""


class Stepper(AdjustableStepper, Protocol):
    """The object that advances a drive by one step and holds the arrays of the drive. It is either `Kernel` (the
    compiled step) or `PlainStepper` (this step in NumPy and Pinocchio). `native/shared.py` documents the arrays.
    """

    record: np.ndarray
    """(wheels, quantities) quantities of each wheel, such as slip and loads, at the beginning of the last step;
    `RECORD` names the columns"""
    impulse: np.ndarray
    """(3,) impulse since the start of the drive: integral over time of the soil's forces on all wheels [N s]"""
    energy: np.ndarray
    """(terms,) energies that have passed since the start of the drive [J], such as the work of the motors; `ENERGY`
    names the terms"""
    duty: np.ndarray
    """(wheels,) PWM duty of each motor; the controller's command is written here"""
    servo_target: np.ndarray
    """(servos,) commanded angle of each steering servo [rad]; the controller's command is written here"""
    servo_wheels: list[int]
    """indices of the steered wheels among the wheels of the rover"""
    differential: np.ndarray
    "(1,) torque of the differential on the left rocker [N m]"

    @property
    def pivoted(self) -> int:
        """Number of steps so far whose equations were nearly singular, so that their solution needed an exchange of
        rows (pivoting).
        """

    def energies(self) -> tuple[float, float]:
        """Return kinetic and potential energy of the rover in its present state [J]."""


class RunningDrive(NamedTuple):
    """A drive in progress: everything that the loop needs to advance the drive."""

    model: Model
    state: DriveState
    stepper: Stepper
    controller: Controller
    timing: Timing
    checkpoint: Checkpoint | None = None
    """time and step count at which an earlier drive ended, which this drive continues; None: this drive begins anew"""
    followed: np.ndarray | None = None
    """lengths of the steps that the drive has to take [s]; None: the loop chooses the step sizes itself"""


class LoopResult(NamedTuple):
    """Result of the loop of a drive: the recorded rows, the reason why the drive ended, and the data that are needed to
    continue or to repeat the drive.
    """

    rows: np.ndarray
    """the rows that were recorded at each sample period (`row_type`)"""
    stop: str
    """reason why the drive ended: "duration" if the requested time has passed, otherwise a failure and its time"""
    checkpoint: Checkpoint
    lengths: np.ndarray
    """length of each step that the drive took [s], in order"""


def run_compiled(drive: RunningDrive, duration: float, progress: Progress | None) -> LoopResult:
    """Drive for `duration` [s] with the compiled loop, and return the result. `run_plain` does this in readable Python.

    A controller of the package runs within the compiled loop. For any other controller, the loop stops at the beginning
    of each control period, the controller is called from Python, and its command is passed to the stepper.
    """
    # The generator ends when the drive ends; its return value is the result.
    asking = questions(drive, duration, progress)
    while True:
        try:
            obey(drive, next(asking))
        except StopIteration as end:
            return cast("LoopResult", end.value)


def questions(
    drive: RunningDrive, duration: float, progress: Progress | None = None
) -> Generator[Reading, None, LoopResult]:
    """Drive for `duration` [s] with the compiled loop, and yield a reading whenever a controller in Python has to be
    called.

    For each reading, the caller must call the controller and pass its command to the stepper (`obey`) before it asks
    the generator for the next reading. At the end the generator returns the result of the drive. If the controller is
    part of the compiled loop, no reading is yielded.
    """
    loop, native = loop_of(drive, duration)
    # Reserve memory for the lengths of all steps of one call of the loop, each divided as finely as possible.
    steps = min(loop.struct.steps, ROWS_PER_PROGRESS * loop.struct.per_sample)
    loop.keep_history(MAX_STEPS_PER_FOLLOWED * FINEST * steps)
    if native is None:
        loop.ask()
    if drive.checkpoint:
        loop.continue_from(drive.checkpoint)
    stop, lengths = "", []
    while not (stop or loop.done):
        # The loop returns at the next call of `progress`, when a controller has to be called, at a failure, or at the
        # end.
        status = loop.run(ROWS_PER_PROGRESS * (1 + loop.row // ROWS_PER_PROGRESS))
        lengths.append(loop.steps_taken())
        if status is LoopStatus.ASKS:
            yield loop.question()
        elif status is LoopStatus.FAILS:
            reason = failure(drive.model, drive.state, loop.rows["record"][loop.row - 1])
            stop = f"{reason} at {drive.state.t:.2f} s" if reason else ""
        elif status is not LoopStatus.DONE:
            stop = stop_reason(status, drive.state.t)
        elif progress and loop.row % ROWS_PER_PROGRESS == 0:
            progress(drive.state.t)
    loop.kernel.keep_history(None)
    return LoopResult(loop.rows[: loop.row], stop or "duration", loop.checkpoint, np.concatenate(lengths))


def loop_of(drive: RunningDrive, duration: float) -> tuple[Loop, CompiledController | None]:
    """Return the compiled loop of a drive that lasts `duration` [s], and the controller that runs within this loop.
    The controller is None if it has to be called from Python.
    """
    timing = drive.timing
    per_control, per_sample = round(timing.control / timing.dt), round(timing.sample / timing.dt)
    assert isinstance(drive.stepper, Kernel)
    native = commands_of(drive.controller, len(drive.model.rover.wheels), len(drive.stepper.servo_wheels))
    # Count the control instants of this drive. A continued drive begins at the step `first`, which need not be a
    # control instant.
    steps, first = max(1, round(duration / timing.dt)), drive.checkpoint.steps if drive.checkpoint else 0
    samples = math.ceil((first + steps) / per_control) - math.ceil(first / per_control)
    fields: dict[str, Any] = {} if native is None else native.fields(drive.stepper, samples)
    if drive.followed is not None:
        fields["followed"] = np.append(drive.followed, 0.0)  # the 0 marks the end in C
    return Loop(
        drive.stepper, timing.dt, steps, per_sample, per_control=per_control, rough=timing.rough, **fields
    ), native


def stop_reason(status: int, t: float) -> str:
    """Return the reason in words why a step of the drive failed.

    Parameters
    ----------
    status : int
        Status of the failed step: 1 (a velocity is not finite) or 2 (the equations are singular).
    t : float
        Time of the failure [s].
    """
    return f"diverged at {t:.2f} s: " + ("a velocity is not finite", "the system is singular")[status - 1]


def obey(drive: RunningDrive, reading: Reading) -> None:
    """Call the controller of a drive with a reading, and pass its command (duties and steering angles) to the stepper.

    Raises
    ------
    SimulationError
        The command has a wrong shape, contains a duty outside [-1, 1], or contains a number that is not finite.
    """
    stepper, wheels, t = drive.stepper, len(drive.model.rover.wheels), drive.state.t
    # A controller that returns duties alone steers straight.
    command = drive.controller(reading)
    duty, steer = command if isinstance(command, Command) else (command, 0.0)
    # A plain number within its range is the usual case, and is checked without an array.
    if not (_is_finite_number(duty) and -1.0 <= duty <= 1.0):
        duties = _as_numbers(duty)
        if duties.shape not in ((), (1,), (wheels,)) or not (np.abs(duties) <= 1.0).all():
            raise SimulationError(
                f"At {t:.2f} s the controller returned the duty {duty!r}, which is not allowed: it must return one "
                f"number in [-1, 1], or an array of {wheels} such numbers, one for each wheel. If the control law "
                "computes larger values, limit them to this range."
            )
        duty = duties
    stepper.duty[:] = duty
    # A rover without steered wheels ignores the steering.
    if not stepper.servo_wheels:
        return
    if not _is_finite_number(steer):
        servos, angles = len(stepper.servo_wheels), _as_numbers(steer)
        if angles.shape not in ((), (servos,)) or not np.isfinite(angles).all():
            raise SimulationError(
                f"At {t:.2f} s the controller returned the steering {steer!r}, which is not allowed: it must return "
                f"one finite angle [rad], or an array of {servos} such angles, one for each steered wheel."
            )
        steer = angles
    stepper.servo_target[:] = steer


def _is_finite_number(value: Any) -> TypeGuard[float]:
    """Return whether a value is a Python float and finite. Most controllers return such a value, which needs no new
    array.
    """
    return type(value) is float and math.isfinite(value)


def _as_numbers(returned: Any) -> np.ndarray:
    """Return the value that a controller returned as an array. If the value does not consist of numbers, the result is
    NaN, which the checks of the command refuse.
    """
    try:
        return np.asarray(returned, dtype=float)
    except (TypeError, ValueError):
        return np.array(np.nan)
