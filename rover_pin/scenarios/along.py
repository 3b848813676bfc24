"""A drive along the steps of another: what a number changes in it is smooth then, where steps that it chooses jump.

Source: Bock, Recent advances in parameter identification techniques for ODE (1983), internal differentiation.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from rover_pin.scenarios.scenario import Scenario
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.compiled_run import run_compiled
from rover_pin.simulation.driving import Drive
from rover_pin.simulation.simulate import set_out
from rover_pin.simulation.timing import Timing
from rover_pin.simulation.trace.record import trace_of
from rover_pin.simulation.trace.rows import finite
from rover_pin.simulation.trace.trace import Trace


class Course(NamedTuple):
    """The steps that a drive took."""

    timing: Timing
    "with the step at which commands are looked at"
    lengths: np.ndarray
    "of its steps [s], shorter where forces ask for it"
    duration: float
    "until it ended [s]"


def course_of(scene: Scenario, trace: Trace) -> Course:
    """Return the steps of the drive that came to this trace."""
    finer = _set_out(scene).timing.dt / trace.attrs["dt_s"]
    timing = dataclasses.replace(scene.timing, divided=scene.timing.divided * round(finer))
    drive = _set_out(dataclasses.replace(scene, timing=timing))
    assert isinstance(drive.stepper, Kernel)
    duration = len(trace.t) * scene.timing.sample
    return Course(drive.timing, run_compiled(drive, duration, None).lengths, duration)


def drive_along(scene: Scenario, course: Course) -> Trace:
    """Return the trace of a drive that takes these steps, as long as they last."""
    drive = _set_out(scene)
    drive.stepper.set_step(course.timing.dt)
    drive = drive._replace(timing=course.timing, followed=course.lengths)
    return trace_of(scene.model, finite(run_compiled(drive, course.duration, None).rows), {})


def _set_out(scene: Scenario) -> Drive:
    if hasattr(scene.controller, "reset"):
        scene.controller.reset()
    return set_out(scene.model, scene.controller, scene.duration, scene.start, scene.timing, scene.symmetric)
