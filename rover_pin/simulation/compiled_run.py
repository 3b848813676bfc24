"""A drive by the compiled loop, which comes back to ask a controller that is not built in."""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any, cast

import numpy as np

from rover_pin.simulation.command import Reading
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.driving import OFTEN, Drive, Progress, Ran, obey, stop_reason
from rover_pin.simulation.failure import failure
from rover_pin.simulation.native.control import commands_of
from rover_pin.simulation.native.loop import Loop, Outcome
from rover_pin.simulation.pace import FINEST

HALVED = 2
"""The most steps that a drive takes for one of the drive whose steps it follows."""


def run_compiled(drive: Drive, duration: float, progress: Progress | None) -> Ran:
    """Drive until the end; `run_plain` does the same, readably."""
    asking = questions(drive, duration, progress)
    while True:
        try:
            obey(drive, next(asking))
        except StopIteration as end:
            return cast("Ran", end.value)


def questions(drive: Drive, duration: float, progress: Progress | None = None) -> Generator[Reading, None, Ran]:
    """Yield what there is to be read at every sample at which the controller is asked; `obey` it before going on."""
    timing = drive.timing
    per_control, per_sample = round(timing.control / timing.dt), round(timing.sample / timing.dt)
    assert isinstance(drive.stepper, Kernel)
    native = commands_of(drive.controller, len(drive.model.rover.wheels), len(drive.stepper.servo_wheels))
    steps, first = max(1, round(duration / timing.dt)), drive.checkpoint.steps if drive.checkpoint else 0
    samples = math.ceil((first + steps) / per_control) - math.ceil(first / per_control)
    loop_fields: dict[str, Any] = {} if native is None else native.fields(drive.stepper, samples)
    if drive.followed is not None:
        loop_fields["followed"] = np.append(drive.followed, 0.0)
    loop = Loop(drive.stepper, timing.dt, steps, per_sample, per_control=per_control, rough=timing.rough, **loop_fields)
    loop.keep_history(HALVED * FINEST * min(steps, OFTEN * per_sample))
    if native is None:
        loop.ask()
    if drive.checkpoint:
        loop.go_on(drive.checkpoint)
    stop, lengths = "", []
    while not (stop or loop.done):
        outcome = loop.run(OFTEN * (1 + loop.row // OFTEN))
        lengths.append(loop.steps_taken())
        if outcome is Outcome.ASKS:
            yield loop.question()
        elif outcome is Outcome.FAILS:
            reason = failure(drive.model, drive.state, loop.rows["record"][loop.row - 1])
            stop = f"{reason} at {drive.state.t:.2f} s" if reason else ""
        elif outcome is not Outcome.DONE:
            stop = stop_reason(outcome, drive.state.t)
        elif progress and loop.row % OFTEN == 0:
            progress(drive.state.t)
    drive.stepper.keep_history(None)
    return Ran(loop.rows[: loop.row], stop or "duration", loop.checkpoint, np.concatenate(lengths))
