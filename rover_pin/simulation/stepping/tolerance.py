"""Drives whose error is within a tolerance: a drive is computed, its error is measured with halved steps, and if the
error is too large, the drive is repeated with shorter steps.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.command import Controller
from rover_pin.simulation.driving import LoopResult, Progress, RunningDrive
from rover_pin.simulation.engines import Engine
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.state import DriveState
from rover_pin.simulation.stepping.pace import GLANCE
from rover_pin.simulation.stepping.resolution import firmness, parts
from rover_pin.simulation.stepping.step_error import StepChange, complete_steps, innermost, repeating, step_change
from rover_pin.simulation.stepping.timing import MAX_REFINEMENT, Timing
from rover_pin.simulation.trace.record import finite


class DriveJob(NamedTuple):
    """The inputs of a drive (model, controller, duration, timing), and the engine that computes its steps."""

    engine: Engine
    model: Model
    controller: Controller
    duration: float
    "time to drive [s]"
    timing: Timing
    symmetric: bool
    """whether the motion is kept mirror-symmetric about the x-z plane"""
    progress: Progress | None
    measure_error: bool


class DriveResult(NamedTuple):
    """A finished drive with one step size, and its differences from drives with other step sizes if these were
    computed.
    """

    drive: RunningDrive
    run: LoopResult
    rows: np.ndarray
    """rows of the drive up to the first number that is not finite"""
    change: StepChange | None = None
    "difference between this drive and its repetition with another step; None: the drive was not repeated"
    longer: StepChange | None = None
    """difference from the previous drive, whose step was twice this step, reduced to the part that is expected to
    remain with the step of this drive; None: there was no such drive"""

    @property
    def stated(self) -> StepChange | None:
        """The difference that the error of the drive is computed from: `change`, or, if `longer` is known too, the
        larger of both.
        """
        return self.change.or_worse(self.longer) if self.change and self.longer else self.change

    def changed_to(self, repeated: DriveResult, ratio: float) -> StepChange:
        """Return the difference between this drive and its repetition `repeated`. `ratio` is the step of the repetition
        divided by the step of this drive.
        """
        return step_change((self.rows, self.run.stop), (repeated.rows, repeated.run.stop), ratio)

    def excess(self, tolerance: float) -> float:
        """Return the estimated error of x and y and of the loads divided by their tolerance [-], whichever ratio is
        larger; infinity if no error was measured. `tolerance` is the tolerance of x and y [m].
        """
        return self.stated.excess(tolerance) if self.stated else math.inf


def begin_drive(job: DriveJob, state: DriveState) -> RunningDrive:
    """Return a drive that begins in this state and has not moved yet. Its step is as short as the ground needs."""
    # The step is first set so short that nothing moves, because `firmness` measures the stiffness of the contacts in
    # this state.
    model = job.model.begin_at(*place_of(state))
    stepper = job.engine.stepper(model, state, GLANCE, job.symmetric)
    firmer = firmness(stepper, model)
    fine = job.timing.with_parts(parts(model, state, job.timing.dt, firmer))
    stepper.set_step(fine.dt)
    return RunningDrive(model, state, stepper, job.controller, fine)


def place_of(state: DriveState) -> tuple[float, float]:
    """Return x and y of the base in a state [m]."""
    return float(state.q[0]), float(state.q[1])


def continue_drive(job: DriveJob, drive: RunningDrive) -> DriveResult:
    """Drive from the present state of a running drive for the duration of the job, and return the result."""
    run = job.engine.run(drive, job.duration, job.progress)
    return DriveResult(drive, run, finite(run.rows))


def drive_from(job: DriveJob, state: DriveState, followed: np.ndarray | None = None) -> DriveResult:
    """Reset the controller, drive from a state for the duration of the job, and return the result. The steps have the
    lengths `followed` [s]; if `followed` is None, the loop chooses the step sizes.
    """
    if hasattr(job.controller, "reset"):
        job.controller.reset()
    return continue_drive(job, begin_drive(job, state.copy())._replace(followed=followed))


def drive_to_tolerance(job: DriveJob, state: DriveState) -> DriveResult:
    """Drive from a state, and repeat the drive with halved steps until its error is within the tolerance. The steps
    become at most MAX_REFINEMENT times shorter.

    The error is measured by a second drive, which halves each step of the first drive. If the second drive chose its
    own steps, its forecast error would be as large as in the first drive, so that both drives could be equally wrong.
    If the error is too large, the drive with halved steps becomes the result, and its error is measured by comparison
    with the previous drive.

    A user-supplied controller is called in the first drive only. The error of its drive is measured with the commands
    that it gave, and the drive is not repeated with shorter steps. No error is measured if these commands are not
    known, or if the caller does not ask for it.
    """
    # First drive: the result, unless its error is too large.
    result, tolerance = drive_from(job, state), job.timing.tolerance
    controller = repeating(job.controller, result.rows, job.timing) if job.measure_error else None
    if controller is None or not len(result.rows):
        return result
    # Second drive, with every step halved: its change to the first gives the error of the first.
    finer = job._replace(controller=controller, progress=None, measure_error=False, timing=job.timing.with_half_step())
    halved = drive_from(finer, state, _in_halves(result, job.duration))
    result = result._replace(change=result.changed_to(halved, 0.5))
    if result.excess(tolerance) <= 1.0 or not hasattr(innermost(job.controller), "native"):
        return result
    # The error is too large: halve the steps again, and measure the error of each drive by comparison with the previous
    # drive.
    result = _with_change(halved, result, tolerance)
    while result.excess(tolerance) > 1.0 and finer.timing.divided < MAX_REFINEMENT * job.timing.divided:
        finer = finer._replace(timing=finer.timing.with_half_step())
        result = _with_change(drive_from(finer, state, _in_halves(result, job.duration)), result, tolerance)
    # The caller's controller continues from the state of its copy, which drove the accepted drive.
    vars(job.controller).update(vars(controller))
    return result


def _with_change(halved: DriveResult, previous: DriveResult, tolerance: float) -> DriveResult:
    """Return the drive `halved`, whose steps are halves of the previous drive's steps, together with its difference
    from the previous drive. `tolerance` is the tolerance of x and y [m].
    """
    change = halved.changed_to(previous, 2.0)
    halved = halved._replace(change=change, longer=previous.change and previous.change.half_step_change())
    return halved._replace(change=change._replace(lessens=halved.excess(tolerance) < previous.excess(tolerance)))


def _in_halves(result: DriveResult, duration: float) -> np.ndarray:
    """Return the lengths of a drive's steps [s], each divided into two equal parts, for a repetition of the drive with
    halved steps. Steps are added if the drive ended before `duration` [s].
    """
    return np.repeat(0.5 * complete_steps(result.run.lengths, result.drive.timing.dt, duration), 2)
