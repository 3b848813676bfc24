"""The engines of a drive: which library computes the motion of the rigid bodies in each step.

Pinocchio always reads the URDF and holds the rover's model. The engine `compiled` then steps with C code that is
generated from a CasADi recursion over this model. The engines `pinocchio-crba` and `pinocchio-aba` step with
Pinocchio's own algorithms, as a reference that shares neither the recursion nor the C code.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from rover_pin.base.errors import UnknownNameError, closest
from rover_pin.simulation.compiled.kernel import Kernel
from rover_pin.simulation.driving import LoopResult, Progress, RunningDrive, Stepper, run_compiled
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.plain.articulated import articulated_stages
from rover_pin.simulation.plain.run import run_plain
from rover_pin.simulation.plain.step import PlainStepper
from rover_pin.simulation.state import DriveState

COMPILED = "compiled"
"""Name of the default engine. A trace names its engine only if the engine is not the default engine."""


class Engine(NamedTuple):
    """The two functions that compute the step and the loop of a drive."""

    stepper: Callable[[Model, DriveState, float, bool], Stepper]
    """function (model, state, step [s], symmetric) -> object that takes the steps of a drive: `Kernel` or
    `PlainStepper`"""
    run: Callable[[RunningDrive, float, Progress | None], LoopResult]
    """function (drive, duration [s], progress) -> result of the loop: `run_compiled` or `run_plain`"""


ENGINES = {
    COMPILED: Engine(Kernel, run_compiled),
    "pinocchio-crba": Engine(PlainStepper, run_plain),
    "pinocchio-aba": Engine(partial(PlainStepper, stages=articulated_stages), run_plain),
}
"""Name of an engine -> its step and its loop."""


def engine_named(name: str) -> Engine:
    """Return the engine of this name.

    Raises UnknownNameError: there is no such engine; the error lists the names.
    """
    if name not in ENGINES:
        raise UnknownNameError(f"There is no engine '{name}': {closest(name, ENGINES)}")
    return ENGINES[name]
