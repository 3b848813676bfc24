"""Simulated drives of a model under a controller, computed step by step as in the paper's Fig 5."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from rover_pin.base.errors import SimulationError
from rover_pin.base.public import public
from rover_pin.simulation.command import Controller
from rover_pin.simulation.driving import Progress, RunningDrive
from rover_pin.simulation.engines import COMPILED, engine_named
from rover_pin.simulation.model.model import Model, implausible
from rover_pin.simulation.outcome.audit import balance_warning, load_warning, pivot_warning, stops_note
from rover_pin.simulation.outcome.outcome import HELD_SINCE, drive_outcome
from rover_pin.simulation.outcome.soil_energy import energy_warning
from rover_pin.simulation.start import SetDown, Start, hovering, set_down
from rover_pin.simulation.state import DriveEnd, DriveState, StepperState
from rover_pin.simulation.stepping.resolution import parts
from rover_pin.simulation.stepping.step_error import innermost
from rover_pin.simulation.stepping.timing import Timing
from rover_pin.simulation.stepping.tolerance import (
    DriveJob,
    DriveResult,
    begin_drive,
    continue_drive,
    drive_to_tolerance,
    place_of,
)
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
    engine: str = COMPILED,
) -> Trace:
    """Simulate a drive of `model` under `controller` for `duration` [s], and return the trace: the recorded channels
    over time.

    Parameters
    ----------
    model : Model
        Rover, ground, soils, motor and effects; `scenario(...).model` gives one.
    controller : Controller
        A callable that takes a `Reading` and returns a duty, an array of duties (one for each wheel) or a `Command`. It
        is called once in each control period, and its command is held until the next call.
    duration : float
        Time to drive [s]. A failure ends the drive earlier.
    start : Start, DriveState or DriveEnd
        A `Start` is a position at which the rover is set down at rest. A `DriveState` is the initial state of the
        drive. A `DriveEnd` (`trace.end` of an earlier drive) continues the earlier drive; the result is then equal to
        the bit to a single drive over the whole time with equal steps.
    timing : Timing
        Step, control period and time between the rows of the trace [s].
    symmetric : bool
        Keep the motion mirror-symmetric about the x-z plane, so that round-off cannot break the symmetry while a rover
        is stuck for a long time.
    progress : callable, optional
        Called from time to time with the simulated time [s].
    measure_error : bool
        Repeat the drive with every step halved. The difference between both drives gives the error that the step size
        causes. While this error exceeds `timing.tolerance`, the step is halved further, up to 16 times
        (`timing.MAX_REFINEMENT`). Most drives take three times the time of a drive with `measure_error=False`, which
        drives once. A user-supplied controller is not called again; the stated error holds for the commands it gave.
    engine : str
        The engine that computes the steps: "compiled", "pinocchio-crba" or "pinocchio-aba" (see Notes).

    Returns
    -------
    Trace
        `attrs["stop"]` is "duration", or the failure that ended the drive and its time: "capsized", "buried", "folded"
        or "diverged". The rows before a failure are kept. `attrs["dt_s"]` is the step that was taken [s].
        `attrs["step_error_m"]` is the estimated error of x and y [m], and `attrs["step_error_load"]` the estimated
        error of the wheels' mean loads, divided by these loads (`StepChange.errors`). If no step size kept the
        tolerance, a warning states this. Both errors are missing if they could not be measured: in a continued drive,
        and under a user-supplied controller whose commands change between rows. `attrs["engine"]` names the engine if
        it is not the compiled one.

    Raises
    ------
    SimulationError
        The drive cannot start: the rover does not come to rest at its start, the ground is not symmetric, or the times
        do not fit together.
    ParameterError
        There is no such engine, or the compiled engine does not know a joint of the rover, or has no room for all its
        joints.

    Notes
    -----
    Every engine takes the same step (`simulation/plain/step.py` contains its equations) over the same model, which
    Pinocchio builds from the URDF. The engines differ in who computes the motion of the rigid bodies:

    - "compiled": C code. CasADi generates its mass matrix, bias force, frames and Jacobians from a recursion over
      Pinocchio's model (`simulation/native/rigid_body.py`); no algorithm of Pinocchio computes a step.
    - "pinocchio-crba": Pinocchio's `crba`, `nonLinearEffects`, frames and Jacobians, in NumPy. The differential is a
      constraint with a multiplier.
    - "pinocchio-aba": the same with Pinocchio's `aba`. The differential is a correction of rank one.

    The traces are equal up to round-off. The engines of Pinocchio support everything that the compiled one does:
    controllers, sensors, effects with states, the error estimate, and drives that continue a drive, also one of another
    engine. They take about 250 times as long. They also drive rovers whose joints the compiled engine does not know,
    but only from a `DriveState`: if `start` is a `Start`, compiled code sets the rover down for every engine.

    Examples
    --------
    >>> from rover_pin import scenario
    >>> flat = scenario("flat").model
    >>> slow = simulate(flat, lambda reading: 0.3, 2.0)
    >>> fast = simulate(flat, lambda reading: 0.6, 2.0)
    >>> bool(0.0 < slow["body_x"][-1] < fast["body_x"][-1]), slow.units["body_x"]
    (True, 'm')
    >>> compiled, reference = (
    ...     simulate(flat, lambda reading: 0.3, 0.1, engine=engine) for engine in ("compiled", "pinocchio-aba")
    ... )
    >>> bool(abs(compiled["body_x"][-1] - reference["body_x"][-1]) < 1e-9)
    True
    """
    job = DriveJob(engine_named(engine), model, controller, duration, timing, symmetric, progress, measure_error)
    # The trace of the default engine does not name it, so that stored traces stay equal.
    attrs: dict[str, Any] = {} if engine == COMPILED else {"engine": engine}
    if not (math.isfinite(duration) and duration > 0.0):
        raise SimulationError(f"duration = {duration:g} s is not allowed: give a positive time.")
    if symmetric and not model.ground.mirror_symmetric:
        raise SimulationError(
            "A drive with symmetric=True needs a terrain that is the same on the left and on the right of y = 0: give "
            "such a terrain, or drive with symmetric=False."
        )
    if symmetric and model.built.up[1] != 0.0:
        raise SimulationError(
            "A drive with symmetric=True needs gravity without a pull to the left or right: set rise_y of the model's "
            "effect GravityTilt to 0, or drive with symmetric=False."
        )
    if isinstance(start, DriveEnd):
        # Effects that depend on the position of the start keep the start of the first part of the drive.
        state, model = start.state.copy(), model.begin_at(*start.place)
        start.refuse_other(timing, symmetric, hovering(model, Start()))
        # The stepper gets back all its arrays, so that the next step equals that of a drive without interruption.
        stepper = job.engine.stepper(model, state, start.fine.dt, symmetric)
        stepper.restore(start.stepper_state.moving)
        stepper.duty[:], stepper.servo_target[:] = start.stepper_state.duty, start.stepper_state.servo
        drive = RunningDrive(model, state, stepper, job.controller, start.fine, start.checkpoint)
        return _drive_trace(job, continue_drive(job, drive), start.place, attrs)
    # Ground that is too stiff for any step is refused before the rover is set down on it.
    parts(model, start if isinstance(start, DriveState) else hovering(model, start), timing.dt)
    begin = SetDown(start.copy(), "") if isinstance(start, DriveState) else set_down(model, start, symmetric)
    attrs |= {"set_down": begin.standing} if begin.standing else {}
    return _drive_trace(job, drive_to_tolerance(job, begin.state), place_of(begin.state), attrs)


def set_out(
    model: Model, controller: Controller, duration: float, start: Start, timing: Timing, symmetric: bool = False
) -> RunningDrive:
    """Set a rover down at rest at `start`, and return a drive that has not yet moved. The caller, for example the FMI
    model of a rover, then advances this drive step by step with the compiled step.
    """
    job = DriveJob(engine_named(COMPILED), model, controller, duration, timing, symmetric, None, False)
    return begin_drive(job, set_down(model, start, job.symmetric).state)


def _drive_trace(job: DriveJob, result: DriveResult, place: tuple[float, float], attrs: dict[str, Any]) -> Trace:
    """Return the trace of a finished drive with its channels, outcome and warnings. If no failure ended the drive, the
    trace also contains the end, so that the drive can be continued.
    """
    drive, run, rows, change = result.drive, result.run, result.rows, result.stated
    # Attributes: the step that was taken, the reason of the end, and the errors if they were measured.
    stepper, symmetric = drive.stepper, job.symmetric
    attrs |= {"dt_s": drive.timing.dt, "control_period_s": job.timing.control, "symmetric": symmetric}
    attrs |= {"stop": run.stop, **(change.errors if change else {})}
    # Controllers of a route or a turn know since when they hold the wheels still, and whether they have reached their
    # aim.
    aiming = innermost(job.controller)
    held_since = getattr(aiming, "stands_since", math.inf)
    trace = trace_of(job.model, rows, attrs | ({HELD_SINCE: held_since} if held_since < math.inf else {}))
    shortfall, turned = (getattr(aiming, name, lambda trace: "")(trace) for name in ("shortfall", "turn_shortfall"))
    warnings = [
        shortfall,
        load_warning(drive.model, rows),
        balance_warning(trace),
        *(f"{text}." for text in implausible(job.model)),
        change.warning(job.timing.tolerance) if change else "",
        pivot_warning(stepper.pivoted),
        energy_warning(job.model, trace),
    ]
    # Controllers without an aim have no such texts; empty texts are dropped.
    trace = annotate_trace(trace, warnings, turned, stops_note(job.model, trace))
    if run.stop != "duration":
        return trace
    # A complete drive can be continued from its end.
    stepper_state = StepperState(tuple(stepper.saved_arrays()), stepper.duty.copy(), stepper.servo_target.copy())
    end = DriveEnd(drive.state.copy(), run.checkpoint, job.timing, drive.timing, place, symmetric, stepper_state)
    return dataclasses.replace(trace, end=end)


def annotate_trace(trace: Trace, warnings: list[str], turned: str = "", stops: str = "") -> Trace:
    """Return the trace with texts about the drive added to its `attrs`: the outcome, the note `turned` on a turn that
    the controller aimed at, the note `stops` on end stops of the suspension that yielded, and the warnings.

    Empty notes and empty warnings are omitted.
    """
    outcome = drive_outcome(trace)
    attrs: dict[str, Any] = {"outcome": outcome.sentence} if outcome else {}
    attrs |= {name: text for name, text in (("turned", turned), ("stops", stops)) if text}
    attrs["warnings"] = [warning for warning in warnings if warning]
    return dataclasses.replace(trace, attrs={**trace.attrs, **attrs})
