"""Drive a model: the computational flow of Fig 5, step after step."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from rover_pin.base.errors import SimulationError
from rover_pin.base.public import public
from rover_pin.simulation.checkpoint import DriveEnd, StepperState
from rover_pin.simulation.command import Controller
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled_run import run_compiled
from rover_pin.simulation.driving import Drive, Progress
from rover_pin.simulation.model.implausible import implausible
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.outcome.audit import balance_warning, load_warning, pivot_warning
from rover_pin.simulation.outcome.outcome import HELD, drive_outcome
from rover_pin.simulation.outcome.soil_energy import energy_warning
from rover_pin.simulation.outcome.step_error import innermost
from rover_pin.simulation.plain.run import run_plain
from rover_pin.simulation.plain.step import Plain
from rover_pin.simulation.resolution import parts
from rover_pin.simulation.start.place import SetDown, Start, hovering, set_down
from rover_pin.simulation.state import DriveState
from rover_pin.simulation.timing import Timing
from rover_pin.simulation.tolerance import DriveJob, Driven, begin_drive, driven_from, driven_to_tolerance, place_of
from rover_pin.simulation.trace.record import trace_of
from rover_pin.simulation.trace.trace import Trace


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
        Drive again by the same steps in halves, which tells their error, and by these, up to FINER times as fine,
        until that is within `timing.tolerance`. Most drives take 3 times as long. A controller of one's own is not
        asked again: the error is that under its commands. False: once.

    Returns
    -------
    Trace
        `attrs["stop"]` says why it ended: "duration", or "capsized", "buried", "folded" or "diverged" with the time
        and the part. What was driven until then is kept. `attrs["step_error_m"]` is 4 times the greatest distance
        in x and y from the drive by its steps in halves; of a drive that was halved, twice that from the one before,
        or, where that is more, as much as a quarter of the change before leaves;
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
    return _drive_trace(job, driven_to_tolerance(job, begin.state), place_of(begin.state), attrs)


def set_out(
    model: Model, controller: Controller, duration: float, start: Start, timing: Timing, symmetric: bool = False
) -> Drive:
    """Return a drive over the compiled step that has been set down at rest at `start`, and goes on step by step."""
    job = DriveJob(Kernel, run_compiled, model, controller, duration, timing, symmetric, None, False)
    return begin_drive(job, set_down(model, start, job.symmetric).state)


def _gone_on(job: DriveJob, end: DriveEnd) -> Trace:
    """Drive on from where a drive ended."""
    state, begun = end.state.copy(), job.model.begin_at(*end.place)
    end.refuse_other(job.timing, job.symmetric, hovering(begun, Start()))
    stepper = job.stepper(begun, state, end.fine.dt, job.symmetric)
    stepper.restore(end.stepper_state.moving)
    stepper.duty[:], stepper.servo_target[:] = end.stepper_state.duty, end.stepper_state.servo
    drive = Drive(begun, state, stepper, job.controller, end.fine, end.checkpoint)
    return _drive_trace(job, driven_from(job, drive), end.place, {})


def _drive_trace(job: DriveJob, driven: Driven, place: tuple[float, float], attrs: dict[str, Any]) -> Trace:
    """Return the trace of a drive, with where it ended if it can go on."""
    drive, run, rows, change = driven.drive, driven.run, driven.rows, driven.stated
    stepper, symmetric = drive.stepper, job.symmetric
    attrs |= {"dt_s": drive.timing.dt, "control_period_s": job.timing.control, "symmetric": symmetric}
    attrs |= {"stop": run.stop, **(change.errors if change else {})}
    aims = innermost(job.controller)
    since = getattr(aims, "stands_since", math.inf)
    trace = trace_of(job.model, rows, attrs | ({HELD: since} if since < math.inf else {}))
    certain = [load_warning(drive.model, rows), balance_warning(trace)]
    oddities = [f"{text}." for text in implausible(job.model)]
    step_warning, energy = change.warning(job.timing.tolerance) if change else "", energy_warning(job.model, trace)
    shortfall, turned = (getattr(aims, name, lambda trace: "")(trace) for name in ("shortfall", "turn_shortfall"))
    warnings = [shortfall, *certain, *oddities, step_warning, pivot_warning(stepper.pivoted), energy]
    trace = annotate_trace(trace, warnings, turned)
    if run.stop != "duration":
        return trace
    stepper_state = StepperState(tuple(stepper.saved_arrays()), stepper.duty.copy(), stepper.servo_target.copy())
    end = DriveEnd(drive.state.copy(), run.checkpoint, job.timing, drive.timing, place, symmetric, stepper_state)
    return dataclasses.replace(trace, end=end)


def annotate_trace(trace: Trace, warnings: list[str], turned: str = "") -> Trace:
    """Return the trace with what it came to, and with all reasons not to believe it; empty ones are none."""
    came_to = drive_outcome(trace)
    attrs: dict[str, Any] = {"outcome": came_to.sentence} if came_to else {}
    attrs |= {"turned": turned} if turned else {}
    attrs["warnings"] = [warning for warning in warnings if warning]
    return dataclasses.replace(trace, attrs={**trace.attrs, **attrs})
