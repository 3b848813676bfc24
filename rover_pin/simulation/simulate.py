"""Drive a model: the computational flow of Fig 5, step after step."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import SimulationError
from rover_pin.base.public import public
from rover_pin.simulation.checkpoint import DriveEnd, StepperState
from rover_pin.simulation.command import Controller
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled_run import run_compiled
from rover_pin.simulation.driving import Drive, Progress, Ran, Stepper
from rover_pin.simulation.model.implausible import implausible
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.outcome.audit import balance_warning, load_warning, pivot_warning
from rover_pin.simulation.outcome.outcome import HELD, drive_outcome
from rover_pin.simulation.outcome.soil_energy import energy_warning
from rover_pin.simulation.outcome.step_error import StepChange, completed, innermost, paired, repeating, step_change
from rover_pin.simulation.pace import GLANCE
from rover_pin.simulation.plain.run import run_plain
from rover_pin.simulation.plain.step import Plain
from rover_pin.simulation.resolution import firmness, parts
from rover_pin.simulation.start.place import SetDown, Start, hovering, set_down
from rover_pin.simulation.state import DriveState
from rover_pin.simulation.timing import FINER, Timing
from rover_pin.simulation.trace.record import trace_of
from rover_pin.simulation.trace.rows import finite
from rover_pin.simulation.trace.trace import Trace


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


@public
def simulate(
    model: Model,
    controller: Controller,
    duration: float,
    start: Start | DriveState | DriveEnd = Start(),
    timing: Timing = Timing(),
    *,
    symmetric: bool = False,
    progress: Progress | None = None,
    measure_error: bool = True,
) -> Trace:
    """Drive `model` under `controller` for `duration` [s] and return the trace.

    Parameters
    ----------
    model : Model
        Rover, ground, soils, motor and effects, as `scenario(...).model` has them.
    controller : Controller
        Any callable from a `Reading` to a duty, an array of duties (one a wheel) or a `Command`; sampled, then held.
    start : Start, DriveState or Ended
        Where to set the rover down at rest; a state to begin in; or `trace.end` of a drive that lasted its duration,
        to go on from there, equal to the bit to a drive in one at the same step.
    duration : float
        How long to drive [s], if nothing ends it before.
    timing : Timing
        Step, control period and rows of the trace [s].
    symmetric : bool
        Hold the mirror symmetry about the x-z plane, so that round-off cannot break it in long stuck runs.
    progress : callable, optional
        Called with the time driven so far [s].
    measure_error : bool
        Drive once more by the same steps taken two at a time, which tells their error, and again at half of the step,
        up to FINER times as fine, until that is within `timing.tolerance`: most drives take half as long again. A
        controller of one's own is not asked again: the error is that under the commands it gave. False: once, as it is.

    Returns
    -------
    Trace
        `attrs["stop"]` says why it ended: "duration", or "capsized", "buried", "folded" or "diverged" with the time
        and the part. What was driven until then is kept. `attrs["step_error_m"]` is twice the greatest distance in x
        and y from the drive at twice the steps, or four times that at half of them where the ground asks for fine ones;
        `attrs["step_error_load"]` the same of the wheels' mean loads, as a share of them. `attrs["dt_s"]`
        is the step that kept the tolerance; a warning says where none did. No error is there where it was not
        measured: a part that goes on, a controller of one's own between the rows.

    Raises
    ------
    SimulationError
        The run cannot start: it does not settle, it is not symmetric, or its times do not fit.

    Examples
    --------
    >>> from rover_pin import scenario
    >>> flat = scenario("flat").model
    >>> slow = simulate(flat, lambda reading: 0.3, 2.0)
    >>> fast = simulate(flat, lambda reading: 0.6, 2.0)
    >>> bool(0.0 < slow["body_x"][-1] < fast["body_x"][-1]), slow.units["body_x"]
    (True, 'm')
    """
    job = DriveJob(Kernel, run_compiled, model, controller, duration, timing, symmetric, progress, measure_error)
    return _simulate(job, start)


@public
def plain_simulate(
    model: Model,
    controller: Controller,
    duration: float,
    start: Start | DriveState | DriveEnd = Start(),
    timing: Timing = Timing(),
    *,
    symmetric: bool = False,
    progress: Progress | None = None,
    measure_error: bool = True,
) -> Trace:
    """Do as `simulate` with the plain NumPy step, far slower; from a `DriveState` it needs no compiler.

    Parameters
    ----------
    model, controller, duration, start, timing, symmetric, progress, measure_error
        As those of `simulate`.

    Returns
    -------
    Trace
        As that of `simulate`, equal to it to round-off.

    Raises
    ------
    SimulationError
        As `simulate`.

    Examples
    --------
    >>> from rover_pin import ConstantDuty, scenario
    >>> flat = scenario("flat").model
    >>> plain, compiled = (drive(flat, ConstantDuty(), 0.1) for drive in (plain_simulate, simulate))
    >>> bool(abs(plain["body_x"][-1] - compiled["body_x"][-1]) < 1e-9)
    True
    """
    job = DriveJob(Plain, run_plain, model, controller, duration, timing, symmetric, progress, measure_error)
    return _simulate(job, start)


def _simulate(job: DriveJob, start: Start | DriveState | DriveEnd) -> Trace:
    model, duration, timing, symmetric = job.model, job.duration, job.timing, job.symmetric
    if not (math.isfinite(duration) and duration > 0.0):
        raise SimulationError(f"duration = {duration:g} s is not allowed: give a positive time.")
    if symmetric and not model.ground.mirror_symmetric:
        raise SimulationError("A mirror-symmetric drive needs a terrain that is the same on the left and on the right.")
    if symmetric and model.built.up[1] != 0.0:
        raise SimulationError("A mirror-symmetric drive needs gravity without a pull to one side: set rise_y to 0.")
    if isinstance(start, DriveEnd):
        return _gone_on(job, start)
    parts(model, start if isinstance(start, DriveState) else hovering(model, start), timing.dt)
    begin = SetDown(start.copy(), "") if isinstance(start, DriveState) else set_down(model, start, symmetric)
    attrs = {"set_down": begin.standing} if begin.standing else {}
    driven = (_kept if job.measure_error else _from_start)(job, begin.state)
    return _traced(job, driven, _place(begin.state), attrs)


class Driven(NamedTuple):
    """A drive as it was driven at one step."""

    drive: Drive
    run: Ran
    rows: np.ndarray
    "those before the first that is not finite"
    change: StepChange | None = None
    "what another step makes of it, where that was measured"


def _driven(job: DriveJob, drive: Drive) -> Driven:
    run = job.run(drive, job.duration, job.progress)
    return Driven(drive, run, finite(run.rows))


def _from_start(job: DriveJob, state: DriveState) -> Driven:
    """Drive from here, the controller from its start."""
    if hasattr(job.controller, "reset"):
        job.controller.reset()
    return _driven(job, begun(job, state.copy()))


def _kept(job: DriveJob, state: DriveState) -> Driven:
    """Drive from here at the step, halved up to FINER parts, that keeps the tolerance.

    A controller of one's own is asked once, and its drive only measured.
    """
    driven = _measured(job, state)
    tolerance, finer = job.timing.tolerance, job._replace(progress=None)
    repeatable = hasattr(innermost(job.controller), "native")
    while repeatable and driven.change and driven.change.excess(tolerance) > 1.0:
        if finer.timing.divided >= FINER * job.timing.divided:
            break
        finer = finer._replace(timing=finer.timing.halved())
        refined = _measured(finer, state)
        if refined.change:
            between = step_change(refined.rows, refined.run.stop, driven.rows, driven.run.stop, 2.0)
            change = refined.change.or_worse(between)
            lessens = change.excess(tolerance) < driven.change.excess(tolerance)
            refined = refined._replace(change=change._replace(lessens=lessens))
        driven = refined
    return driven


def _measured(job: DriveJob, state: DriveState) -> Driven:
    """Drive from here, and once more by the same steps two at a time, or halved where the ground bears no longer ones.

    Where the first drive divided its steps, so does the second: one that chose its own would divide them until they
    misjudge as little, and be as far off. Nothing is measured of a controller whose commands are not known.
    """
    driven = _from_start(job, state)
    controller = repeating(job.controller, driven.rows, job.timing)
    if controller is None or not len(driven.rows):
        return driven
    fine = driven.drive.timing
    lengths = completed(driven.run.lengths, fine.dt, job.duration)
    double = driven.drive.bears_double
    followed = paired(lengths, fine) if double else np.repeat(0.5 * lengths, 2)
    repeated = begun(job._replace(controller=controller), state.copy())._replace(followed=followed)
    run = job.run(repeated, job.duration, None)
    ratio = 2.0 if double else 0.5
    return driven._replace(change=step_change(driven.rows, driven.run.stop, finite(run.rows), run.stop, ratio))


def _place(state: DriveState) -> tuple[float, float]:
    return float(state.q[0]), float(state.q[1])


def set_out(
    model: Model, controller: Controller, duration: float, start: Start, timing: Timing, symmetric: bool = False
) -> Drive:
    """Return a drive over the compiled step that has been set down at rest at `start`, and goes on step by step."""
    job = DriveJob(Kernel, run_compiled, model, controller, duration, timing, symmetric, None, False)
    return begun(job, set_down(model, start, job.symmetric).state)


def begun(job: DriveJob, state: DriveState) -> Drive:
    """Return a drive that begins in this state, with the step that its ground asks for."""
    model = job.model.begun(*_place(state))
    stepper = job.stepper(model, state, GLANCE, job.symmetric)
    firmer = firmness(stepper, model)
    fine = job.timing.refined(parts(model, state, job.timing.dt, firmer))
    stepper.set_step(fine.dt)
    bears_double = parts(model, state, 2.0 * fine.dt, firmer) == 1
    return Drive(model, state, stepper, job.controller, fine, bears_double=bears_double)


def _gone_on(job: DriveJob, end: DriveEnd) -> Trace:
    """Drive on from where a drive ended."""
    state, begun = end.state.copy(), job.model.begun(*end.place)
    end.refuse_other(job.timing, job.symmetric, hovering(begun, Start()))
    stepper = job.stepper(begun, state, end.fine.dt, job.symmetric)
    stepper.restore(end.stepper_state.moving)
    stepper.duty[:], stepper.servo_target[:] = end.stepper_state.duty, end.stepper_state.servo
    drive = Drive(begun, state, stepper, job.controller, end.fine, end.checkpoint)
    return _traced(job, _driven(job, drive), end.place, {})


def _traced(job: DriveJob, driven: Driven, place: tuple[float, float], attrs: dict[str, Any]) -> Trace:
    """Return the trace of a drive, with where it ended if it can go on."""
    drive, run, rows, change = driven
    stepper, symmetric = drive.stepper, job.symmetric
    attrs |= {"dt_s": drive.timing.dt, "control_period_s": job.timing.control, "symmetric": symmetric}
    attrs |= {"stop": run.stop, **(change.errors if change else {})}
    aims = innermost(job.controller)
    since = getattr(aims, "stands_since", math.inf)
    trace = trace_of(job.model, rows, attrs | ({HELD: since} if since < math.inf else {}))
    certain = [load_warning(drive.model, rows), balance_warning(trace)]
    oddities = [f"{text}." for text in implausible(job.model)]
    step_warning, energy = change.warning(job.timing.tolerance) if change else "", energy_warning(job.model, trace)
    shortfall, turned = (getattr(aims, name, lambda trace: "")(trace) for name in ("shortfall", "turned"))
    warnings = [shortfall, *certain, *oddities, step_warning, pivot_warning(stepper.pivoted), energy]
    trace = annotate_trace(trace, warnings, turned)
    if run.stop != "duration":
        return trace
    stepper_state = StepperState(tuple(stepper.saved()), stepper.duty.copy(), stepper.servo_target.copy())
    end = DriveEnd(drive.state.copy(), run.checkpoint, job.timing, drive.timing, place, symmetric, stepper_state)
    return dataclasses.replace(trace, end=end)


def annotate_trace(trace: Trace, warnings: list[str], turned: str = "") -> Trace:
    """Return the trace with what it came to, and with all reasons not to believe it; empty ones are none."""
    came_to = drive_outcome(trace)
    attrs: dict[str, Any] = {"happened": came_to.sentence} if came_to else {}
    attrs |= {"turned": turned} if turned else {}
    attrs["warnings"] = [warning for warning in warnings if warning]
    return dataclasses.replace(trace, attrs={**trace.attrs, **attrs})
