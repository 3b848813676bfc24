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
    start: Start | DriveState = Start(),
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
    start : Start or DriveState
        Where to set the rover down at rest, or a state to go on from.
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
    start: Start | DriveState = Start(),
    timing: Timing = Timing(),
    *,
    symmetric: bool = False,
    progress: Progress | None = None,
) -> Trace:
    """Do as `simulate` with the plain NumPy step, about 130 times slower; from a `DriveState` it needs no compiler."""
    return _simulate(Plain, run_plain, model, controller, duration, start, timing, symmetric, progress)


def _simulate(
    kind: Any,
    run: Callable[[Drive, float, Progress | None], Ran],
    model: Model,
    controller: Controller,
    duration: float,
    start: Start | DriveState,
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
    parts(model, start if isinstance(start, DriveState) else hovering(model, start), timing.dt)
    begin = SetDown(start.copy(), "") if isinstance(start, DriveState) else set_down(model, start, symmetric)
    if hasattr(controller, "reset"):
        controller.reset()
    state = begin.state
    begun = model.begun(float(state.q[0]), float(state.q[1]))
    stepper = kind(begun, state, STANDING, symmetric)
    fine = timing.refined(parts(begun, state, timing.dt, firmness(stepper, begun)))
    stepper.set_step(fine.dt)
    drive = Drive(begun, state, stepper, controller, fine)
    ran = run(drive, duration, progress)
    rows = finite(ran.rows)
    attrs = {"dt_s": fine.dt, "control_period_s": timing.control, "symmetric": symmetric, "stop": ran.stop}
    attrs |= {"set_down": begin.standing} if begin.standing else {}
    warnings = [*warnings_of(begun, rows, ran.missed), pivot_warning(drive.stepper.pivoted)]
    return told(model, trace_of(model, rows, attrs), [each for each in warnings if each])


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
