"""Drive a model: the computational flow of Fig 5, step after step."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from rover_pin.errors import SimulationError
from rover_pin.motion.audit import pivot_warning, warnings_of
from rover_pin.motion.command import Command, Controller, Reading, Truth
from rover_pin.motion.failure import Suspension, failure, suspension_of
from rover_pin.motion.happened import happened
from rover_pin.motion.kernel import Kernel
from rover_pin.motion.model import Model
from rover_pin.motion.native.shared import RECORD
from rover_pin.motion.pace import Pace, Steps
from rover_pin.motion.place import SetDown, Start, hovering, set_down
from rover_pin.motion.plain import Plain
from rover_pin.motion.record import trace_of
from rover_pin.motion.resolution import STANDING, firmness, parts
from rover_pin.motion.soil_energy import energy_warning
from rover_pin.motion.state import DriveState, base_rotation, roll_pitch_yaw
from rover_pin.motion.timing import Timing
from rover_pin.motion.trace import Trace


class Stepper(Steps, Protocol):
    """A drive from one step to the next: `Kernel` or `Plain`."""

    record: np.ndarray
    impulse: np.ndarray
    energy: np.ndarray
    duty: np.ndarray
    servo_target: np.ndarray
    servo_wheels: list[int]
    differential: np.ndarray

    @property
    def pivoted(self) -> int:
        """How many steps had to exchange rows to solve for their speeds."""

    def energies(self) -> tuple[float, float]:
        """Return kinetic and potential energy [J]."""


class Drive(NamedTuple):
    """A simulation in progress."""

    model: Model
    state: DriveState
    stepper: Stepper
    controller: Controller
    timing: Timing


Progress = Callable[[float], None]
"""Called now and then with the simulated time [s]."""


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
    return _simulate(Kernel, model, controller, duration, start, timing, symmetric, progress)


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
    return _simulate(Plain, model, controller, duration, start, timing, symmetric, progress)


def _simulate(
    kind: Any,
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
    firmer = firmness(kind(begun, state.copy(), STANDING, symmetric), begun)
    fine = timing.refined(parts(begun, state, timing.dt, firmer))
    drive = Drive(begun, state, kind(begun, state, fine.dt, symmetric), controller, fine)
    pace = Pace(drive.stepper, fine.dt)
    rows, stop = run(drive, pace, duration, progress)
    attrs = {"dt_s": fine.dt, "control_period_s": timing.control, "symmetric": symmetric, "stop": stop}
    attrs |= {"set_down": begin.standing} if begin.standing else {}
    warnings = [*warnings_of(begun, rows, pace), pivot_warning(drive.stepper.pivoted)]
    return told(model, trace_of(model, rows, attrs), [each for each in warnings if each])


def told(model: Model, trace: Trace, warnings: list[str]) -> Trace:
    """Return the trace with what it came to, and with all reasons not to believe it."""
    came_to, energy = happened(trace), energy_warning(model, trace)
    found: dict[str, Any] = {"happened": came_to.sentence} if came_to else {}
    found["warnings"] = [*warnings, energy] if energy else warnings
    return dataclasses.replace(trace, attrs={**trace.attrs, **found})


def run(drive: Drive, pace: Pace, duration: float, progress: Progress | None) -> tuple[list[Row], str]:
    """Step until the end; return the rows and the reason of the stop."""
    timing, state, stepper = drive.timing, drive.state, drive.stepper
    steps = round(duration / timing.dt)
    per_control, per_sample = round(timing.control / timing.dt), round(timing.sample / timing.dt)
    suspension = suspension_of(drive.model)
    rows: list[Row] = []
    begin = state.t
    for k in range(steps):
        if k % per_control == 0:
            obey(drive, k, suspension)
        status = pace.advance(k % per_control == 0 or k % per_sample == 0)
        if status:
            return rows, f"diverged at {state.t:.2f} s: " + ("a velocity is not finite", "the system is singular")[
                status - 1
            ]
        state.t = begin + (k + 1) * timing.dt
        if k % per_sample == per_sample - 1:
            rows.append(row_of(drive))
            reason = failure(drive.model, state, stepper.record, suspension)
            if reason:
                return rows, f"{reason} at {state.t:.2f} s"
            if progress and len(rows) % 50 == 0:
                progress(state.t)
    return rows, "duration"


class Row(NamedTuple):
    """One sampled instant."""

    t: float
    q: np.ndarray
    v: np.ndarray
    record: np.ndarray
    duty: np.ndarray
    servo: np.ndarray
    energy: np.ndarray
    differential: float
    mechanical: tuple[float, float]
    impulse: np.ndarray
    "of the soil's forces on all wheels since the start, in the world (3) [N s]"


def row_of(drive: Drive) -> Row:
    """Return a copy of the present instant."""
    state, stepper = drive.state, drive.stepper
    return Row(
        state.t,
        state.q.copy(),
        state.v.copy(),
        stepper.record.copy(),
        stepper.duty.copy(),
        stepper.servo_target.copy(),
        stepper.energy.copy(),
        float(stepper.differential[0]),
        stepper.energies(),
        stepper.impulse.copy(),
    )


def obey(drive: Drive, k: int, suspension: Suspension) -> None:
    """Ask the controller and apply its command."""
    stepper, wheels = drive.stepper, len(drive.model.rover.wheels)
    command = drive.controller(reading_of(drive, suspension))
    if not isinstance(command, Command):
        command = Command(command)
    duty = np.asarray(command.duty, dtype=float)
    if duty.shape not in ((), (1,), (wheels,)) or not np.all(np.isfinite(duty)):
        raise SimulationError(
            f"At {drive.state.t:.2f} s the controller returned the duty {np.array2string(duty)}: "
            f"give one number, or {wheels} finite numbers, one a wheel."
        )
    stepper.duty[:] = np.clip(duty, -1.0, 1.0)
    steer = np.asarray(command.steer, dtype=float)
    if stepper.servo_wheels:
        if steer.shape not in ((), (len(stepper.servo_wheels),)) or not np.all(np.isfinite(steer)):
            raise SimulationError(
                f"At {drive.state.t:.2f} s the controller returned the steering {np.array2string(steer)}: "
                f"give one number, or {len(stepper.servo_wheels)}, one a steered wheel [rad]."
            )
        stepper.servo_target[:] = steer


def reading_of(drive: Drive, suspension: Suspension) -> Reading:
    """Return what the controller sees now."""
    state, record = drive.state, drive.stepper.record
    column = {name: record[:, i] for i, name in enumerate(RECORD)}
    truth = Truth(
        column["slip"].copy(),
        column["sinkage"].copy(),
        column["normal"].copy(),
        column["travel"].copy(),
        state.q[:3].copy(),
        base_rotation(state.q) @ state.v[:3],
    )
    return Reading(
        state.t,
        drive.stepper.duty.copy(),
        state.v[[wheel.dof for wheel in drive.model.rover.wheels]],
        column["current"].copy(),
        state.q[suspension.places],
        roll_pitch_yaw(state.q),
        truth,
    )


def convergence(model: Model, controller: Controller, duration: float, **options: Any) -> tuple[Trace, float]:
    """Return the trace at the asked step and the largest distance [m] of its base x from that at half the step."""
    timing = options.pop("timing", Timing())
    trace = simulate(model, controller, duration, timing=timing, **options)
    finer = simulate(model, controller, duration, timing=timing.halved(), **options)
    rows = min(len(trace["body_x"]), len(finer["body_x"]))
    return trace, float(np.max(np.abs(trace["body_x"][:rows] - finer["body_x"][:rows])))
