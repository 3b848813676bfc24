"""A drive at the step that keeps its tolerance: driven, measured by its own steps taken together, and again at half."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rover_pin.simulation.command import Controller
from rover_pin.simulation.driving import Drive, Progress, Ran, Stepper
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.outcome.step_error import StepChange, completed, grouped, innermost, repeating, step_change
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
    "what is left here of the change between twice and four times the step"

    @property
    def stated(self) -> StepChange | None:
        """The greater of the two."""
        return self.change.or_worse(self.longer) if self.change and self.longer else self.change

    def changed_to(self, repeated: Driven, ratio: float) -> StepChange:
        """Return what another step, of this ratio to its own, made of it."""
        return step_change((self.rows, self.run.stop), (repeated.rows, repeated.run.stop), ratio)

    def after(self, coarser: Driven, tolerance: float) -> Driven:
        """Return the same with what is left of the change at twice the step, and with the one between the two."""
        if not (self.change and coarser.change and coarser.stated):
            return self
        change = self.change.or_worse(self.changed_to(coarser, 2.0)).or_worse(coarser.change.lessened())
        lessens = change.excess(tolerance) < coarser.stated.excess(tolerance)
        return self._replace(change=change._replace(lessens=lessens))


def begun(job: DriveJob, state: DriveState) -> Drive:
    """Return a drive that begins in this state, with the step that its ground asks for."""
    model = job.model.begun(*place_of(state))
    stepper = job.stepper(model, state, GLANCE, job.symmetric)
    firmer = firmness(stepper, model)
    fine = job.timing.refined(parts(model, state, job.timing.dt, firmer))
    stepper.set_step(fine.dt)
    bears_double = job.measure_error and parts(model, state, 2.0 * fine.dt, firmer) == 1
    return Drive(model, state, stepper, job.controller, fine, bears_double=bears_double)


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
    return driven_from(job, begun(job, state.copy())._replace(followed=followed))


def kept(job: DriveJob, state: DriveState) -> Driven:
    """Drive from here at the step, halved up to FINER parts, that keeps the tolerance.

    A controller of one's own is asked once, and its drive only measured.
    """
    driven = _measured(job, state)
    tolerance, finer = job.timing.tolerance, job._replace(progress=None)
    repeatable = hasattr(innermost(job.controller), "native")
    while repeatable and driven.stated and driven.stated.excess(tolerance) > 1.0:
        if finer.timing.divided >= FINER * job.timing.divided:
            break
        finer = finer._replace(timing=finer.timing.halved())
        driven = _measured(finer, state).after(driven, tolerance)
    return driven


def _measured(job: DriveJob, state: DriveState) -> Driven:
    """Drive from here, then by the same steps two and four at a time, or halved where the ground bears no longer ones.

    Where the first drive divided its steps, so do the others: one that chose its own would divide them until they
    misjudge as little, and be as far off. Nothing is measured of a controller whose commands are not known.
    """
    driven = from_start(job, state)
    controller = repeating(job.controller, driven.rows, job.timing)
    if controller is None or not len(driven.rows):
        return driven
    again, fine = job._replace(controller=controller, progress=None, measure_error=False), driven.drive.timing
    lengths = completed(driven.run.lengths, fine.dt, job.duration)
    if not driven.drive.bears_double:
        halved = from_start(again, state, np.repeat(0.5 * lengths, 2))
        return driven._replace(change=driven.changed_to(halved, 0.5))
    double, fourfold = (from_start(again, state, grouped(lengths, fine, n)) for n in (2, 4))
    return driven._replace(change=driven.changed_to(double, 2.0), longer=double.changed_to(fourfold, 2.0).lessened())
