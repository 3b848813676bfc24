"""A drive along the steps of another: what a number changes in it is smooth then, where steps that it chooses jump.

Source: Bock, Recent advances in parameter identification techniques for ODE (1983), internal differentiation.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from rover_pin.scenarios.scenario import Scenario
from rover_pin.simulation.compiled_run import run_compiled
from rover_pin.simulation.driving import Drive
from rover_pin.simulation.outcome.step_error import complete_steps
from rover_pin.simulation.replay import StepsTaken
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.trace.record import trace_of
from rover_pin.simulation.trace.rows import finite
from rover_pin.simulation.trace.trace import Trace


def course_of(scene: Scenario, trace: Trace) -> StepsTaken:
    """Return the steps of the drive that came to this trace: those that it chose, in halves where it was refined."""
    drive, duration = _set_out(scene), len(trace.t) * scene.timing.sample
    dt, parts = drive.timing.dt, round(drive.timing.dt / trace.attrs["dt_s"])
    lengths = complete_steps(run_compiled(drive, duration, None).lengths, dt, duration)
    return StepsTaken(dt / parts, np.repeat(lengths / parts, parts))


def drive_along(scene: Scenario, course: StepsTaken) -> Trace:
    """Return the trace of a drive that takes these steps, as long as they last."""
    drive = _set_out(scene)
    drive.stepper.set_step(course.dt)
    timing = dataclasses.replace(drive.timing, dt=course.dt)
    run = run_compiled(drive._replace(timing=timing, followed=course.lengths), float(course.lengths.sum()), None)
    return trace_of(scene.model, finite(run.rows), {})


def _set_out(scene: Scenario) -> Drive:
    if hasattr(scene.controller, "reset"):
        scene.controller.reset()
    return set_out(scene.model, scene.controller, scene.duration, scene.start, scene.timing, scene.symmetric)
