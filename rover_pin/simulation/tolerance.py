"""A drive at the step that keeps its tolerance: driven, and measured by its own steps in halves."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.command import Controller
from rover_pin.simulation.driving import Drive, Progress, Ran, Stepper
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.outcome.step_error import StepChange, complete_steps, innermost, repeating, step_change
from rover_pin.simulation.pace import GLANCE
from rover_pin.simulation.resolution import firmness, parts
from rover_pin.simulation.state import DriveState
from rover_pin.simulation.timing import FINER, Timing
from rover_pin.simulation.trace.rows import finite


class DriveJob(NamedTuple):
    """A drive as it is asked for, by the compiled or by the plain step."""

    stepper: Callable[[Model, DriveState, float, bool], Stepper]
    run: Callable[[Drive, float, Progress | None], Ran]
    model: Model
    controller: Controller
    duration: float
    timing: Timing
    symmetric: bool
    progress: Progress | None
    measure_error: bool


class Driven(NamedTuple):
    """A drive as it was driven at one step."""

    drive: Drive
    run: Ran
    rows: np.ndarray
    "those before the first that is not finite"
    change: StepChange | None = None
    "what another step makes of it, where that was measured"
    longer: StepChange | None = None
    "what is left here of the change that halving made of the drive before"

    @property
    def stated(self) -> StepChange | None:
        """The greater of the two."""
        return self.change.or_worse(self.longer) if self.change and self.longer else self.change

    def changed_to(self, repeated: Driven, ratio: float) -> StepChange:
        """Return what another step, of this ratio to its own, made of it."""
        return step_change((self.rows, self.run.stop), (repeated.rows, repeated.run.stop), ratio)

    def excess(self, tolerance: float) -> float:
        """Return by how much the stated error is over its tolerance; without end where none is stated."""
        return self.stated.excess(tolerance) if self.stated else math.inf


def begin_drive(job: DriveJob, state: DriveState) -> Drive:
    """Return a drive that begins in this state, with the step that its ground asks for."""
    model = job.model.begin_at(*place_of(state))
    stepper = job.stepper(model, state, GLANCE, job.symmetric)
    firmer = firmness(stepper, model)
    fine = job.timing.with_parts(parts(model, state, job.timing.dt, firmer))
    stepper.set_step(fine.dt)
    return Drive(model, state, stepper, job.controller, fine)


def place_of(state: DriveState) -> tuple[float, float]:
    """Return x, y [m] of the body."""
    return float(state.q[0]), float(state.q[1])


def driven_from(job: DriveJob, drive: Drive) -> Driven:
    """Drive on from where a drive is."""
    run = job.run(drive, job.duration, job.progress)
    return Driven(drive, run, finite(run.rows))


def from_start(job: DriveJob, state: DriveState, followed: np.ndarray | None = None) -> Driven:
    """Drive from here, the controller from its start, by its own steps or those of these lengths [s]."""
    if hasattr(job.controller, "reset"):
        job.controller.reset()
    return driven_from(job, begin_drive(job, state.copy())._replace(followed=followed))


def driven_to_tolerance(job: DriveJob, state: DriveState) -> Driven:
    """Drive from here at the step, halved up to FINER parts, that keeps the tolerance.

    The error is stated by the same steps in halves: a drive that chose its own would divide them until they misjudge as
    little, and be as far off. Where it is too large the halves are the drive, measured by the one before. A controller
    of one's own is asked once, and its drive only measured; nothing is measured of one whose commands are not known,
    nor where the job does not ask for the error.
    """
    driven, tolerance = from_start(job, state), job.timing.tolerance
    controller = repeating(job.controller, driven.rows, job.timing) if job.measure_error else None
    if controller is None or not len(driven.rows):
        return driven
    finer = job._replace(controller=controller, progress=None, measure_error=False, timing=job.timing.with_half_step())
    halved = from_start(finer, state, _in_halves(driven, job.duration))
    driven = driven._replace(change=driven.changed_to(halved, 0.5))
    if driven.excess(tolerance) <= 1.0 or not hasattr(innermost(job.controller), "native"):
        return driven
    driven = _measure_change(halved, driven, tolerance)
    while driven.excess(tolerance) > 1.0 and finer.timing.divided < FINER * job.timing.divided:
        finer = finer._replace(timing=finer.timing.with_half_step())
        driven = _measure_change(from_start(finer, state, _in_halves(driven, job.duration)), driven, tolerance)
    vars(job.controller).update(vars(controller))  # it goes on as its copy did, which drove the last of them
    return driven


def _measure_change(halved: Driven, driven: Driven, tolerance: float) -> Driven:
    """Return a drive by the steps of another in halves, with what those made of it."""
    change = halved.changed_to(driven, 2.0)
    halved = halved._replace(change=change, longer=driven.change and driven.change.half_step_change())
    return halved._replace(change=change._replace(lessens=halved.excess(tolerance) < driven.excess(tolerance)))


def _in_halves(driven: Driven, duration: float) -> np.ndarray:
    """Return the steps [s] of a drive, each in two."""
    return np.repeat(0.5 * complete_steps(driven.run.lengths, driven.drive.timing.dt, duration), 2)
