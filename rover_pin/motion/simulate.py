"""Drive a model: the computational flow of Fig 5, step after step."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from rover_pin.errors import SimulationError
from rover_pin.motion.audit import pivot_warning, warnings_of
from rover_pin.motion.command import Controller
from rover_pin.motion.compiled_run import run_compiled
from rover_pin.motion.driving import Drive, Progress, Ran
from rover_pin.motion.going_on import Ended, Held
from rover_pin.motion.happened import happened
from rover_pin.motion.kernel import Kernel
from rover_pin.motion.model import Model
from rover_pin.motion.place import SetDown, Start, hovering, set_down
from rover_pin.motion.plain import Plain
from rover_pin.motion.plain_run import run_plain
from rover_pin.motion.record import trace_of
from rover_pin.motion.resolution import STANDING, firmness, parts
from rover_pin.motion.rows import finite
from rover_pin.motion.soil_energy import energy_warning
from rover_pin.motion.state import DriveState
from rover_pin.motion.timing import Timing
from rover_pin.motion.trace import Trace


def simulate(
    model: Model,
    controller: Controller,
    duration: float,
    start: Start | DriveState | Ended = Start(),
    timing: Timing = Timing(),
    *,
    symmetric: bool = False,
    progress: Progress | None = None,
) -> Trace:
    """Drive `model` under `controller` for `duration` [s] and return the trace.

    Parameters
    ----------
    controller : Controller
        Any callable from a `Reading` to a duty, an array of duties (one a wheel) or a `Command`; sampled, then held.
    start : Start, DriveState or Ended
        Where to set the rover down at rest; a state to begin in; or `trace.end` of a drive that lasted its duration,
        to go on from there, equal to the bit to a drive in one.
    symmetric : bool
        Hold the mirror symmetry about the x-z plane, so that round-off cannot break it in long stuck runs.

    Returns
    -------
    Trace
        `attrs["stop"]` says why it ended: "duration", or "capsized", "buried", "folded" or "diverged" with the time
        and the part. What was driven until then is kept.

    Raises
    ------
    SimulationError
        The run cannot start: it does not settle, it is not symmetric, or its times do not fit.
    """
    return _simulate(Kernel, run_compiled, model, controller, duration, start, timing, symmetric, progress)


def plain_simulate(
    model: Model,
    controller: Controller,
    duration: float,
    start: Start | DriveState | Ended = Start(),
    timing: Timing = Timing(),
    *,
    symmetric: bool = False,
    progress: Progress | None = None,
) -> Trace:
    """Do as `simulate` with the plain NumPy step, far slower; from a `DriveState` it needs no compiler."""
    return _simulate(Plain, run_plain, model, controller, duration, start, timing, symmetric, progress)


def _simulate(
    kind: Any,
    run: Callable[[Drive, float, Progress | None], Ran],
    model: Model,
    controller: Controller,
    duration: float,
    start: Start | DriveState | Ended,
    timing: Timing,
    symmetric: bool,
    progress: Progress | None,
) -> Trace:
    if not (math.isfinite(duration) and duration > 0.0):
        raise SimulationError(f"duration = {duration:g} s is not allowed: give a positive time.")
    if symmetric and not model.terrain.mirror_symmetric:
        raise SimulationError("A mirror-symmetric drive needs a terrain that is the same on the left and on the right.")
    if symmetric and model.built.up[1] != 0.0:
        raise SimulationError("A mirror-symmetric drive needs gravity without a pull to one side: set rise_y to 0.")
    if isinstance(start, Ended):
        return _gone_on(kind, run, model, controller, duration, start, timing, symmetric, progress)
    parts(model, start if isinstance(start, DriveState) else hovering(model, start), timing.dt)
    begin = SetDown(start.copy(), "") if isinstance(start, DriveState) else set_down(model, start, symmetric)
    if hasattr(controller, "reset"):
        controller.reset()
    state = begin.state
    place = (float(state.q[0]), float(state.q[1]))
    begun = model.begun(*place)
    stepper = kind(begun, state, STANDING, symmetric)
    fine = timing.refined(parts(begun, state, timing.dt, firmness(stepper, begun)))
    stepper.set_step(fine.dt)
    drive = Drive(begun, state, stepper, controller, fine)
    attrs = {"set_down": begin.standing} if begin.standing else {}
    return _traced(model, drive, run(drive, duration, progress), attrs, (timing, place, symmetric))


def _gone_on(
    kind: Any,
    run: Callable[[Drive, float, Progress | None], Ran],
    model: Model,
    controller: Controller,
    duration: float,
    end: Ended,
    timing: Timing,
    symmetric: bool,
    progress: Progress | None,
) -> Trace:
    """Drive on from where a drive ended."""
    state, begun = end.state.copy(), model.begun(*end.place)
    end.refuse_other(timing, symmetric, hovering(begun, Start()))
    stepper = kind(begun, state, end.fine.dt, symmetric)
    stepper.restore(end.held.moving)
    stepper.duty[:], stepper.servo_target[:] = end.held.duty, end.held.servo
    drive = Drive(begun, state, stepper, controller, end.fine, end.counted)
    return _traced(model, drive, run(drive, duration, progress), {}, (timing, end.place, symmetric))


def _traced(
    model: Model, drive: Drive, ran: Ran, attrs: dict[str, Any], how: tuple[Timing, tuple[float, float], bool]
) -> Trace:
    """Return a drive's trace, with where it ended if it can go on."""
    (timing, place, symmetric), stepper, rows = how, drive.stepper, finite(ran.rows)
    dt = drive.timing.dt
    attrs |= {"dt_s": dt, "control_period_s": timing.control, "symmetric": symmetric, "stop": ran.stop}
    warnings = [*warnings_of(drive.model, rows, ran.counted.missed), pivot_warning(stepper.pivoted)]
    trace = told(model, trace_of(model, rows, attrs), [each for each in warnings if each])
    if ran.stop != "duration":
        return trace
    held = Held(tuple(stepper.saved()), stepper.duty.copy(), stepper.servo_target.copy())
    end = Ended(drive.state.copy(), ran.counted, timing, drive.timing, place, symmetric, held)
    return dataclasses.replace(trace, end=end)


def told(model: Model, trace: Trace, warnings: list[str]) -> Trace:
    """Return the trace with what it came to, and with all reasons not to believe it."""
    came_to, energy = happened(trace), energy_warning(model, trace)
    found: dict[str, Any] = {"happened": came_to.sentence} if came_to else {}
    found["warnings"] = [*warnings, energy] if energy else warnings
    return dataclasses.replace(trace, attrs={**trace.attrs, **found})


def convergence(model: Model, controller: Controller, duration: float, **options: Any) -> tuple[Trace, float]:
    """Return the trace at the asked step and the largest distance [m] of its base x from that at half the step."""
    timing = options.pop("timing", Timing())
    trace = simulate(model, controller, duration, timing=timing, **options)
    finer = simulate(model, controller, duration, timing=timing.halved(), **options)
    rows = min(len(trace["body_x"]), len(finer["body_x"]))
    return trace, float(np.max(np.abs(trace["body_x"][:rows] - finer["body_x"][:rows])))
