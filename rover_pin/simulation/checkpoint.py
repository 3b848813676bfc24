"""Where a drive ended, with all that its next step depends on: to go on from there as if it had not stopped."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import SimulationError
from rover_pin.base.public import brief
from rover_pin.simulation.state import DriveState
from rover_pin.simulation.timing import Timing


class Checkpoint(NamedTuple):
    """How far a drive is."""

    begin: float
    "the time it began [s]"
    steps: int
    size: int
    "of its steps, in parts of dt (`pace.FINEST`)"


@brief
class StepperState(NamedTuple):
    """What a stepper holds between two steps: all arrays that a step changes, duties and servo targets."""

    moving: tuple[np.ndarray, ...]
    duty: np.ndarray
    servo: np.ndarray


@brief
@dataclass(frozen=True, eq=False)
class DriveEnd:
    """The end of a drive, from which `simulate(model, controller, duration, trace.end)` goes on.

    It has the states of the effects, the loads and currents of the last step, and the duties that are held, so that a
    drive in two parts equals one in one to the bit. Give the same model, timing and controller: the controller goes on
    as it is, and is not reset.
    """

    state: DriveState
    checkpoint: Checkpoint
    timing: Timing
    "as asked for"
    fine: Timing
    "with the step as taken"
    place: tuple[float, float]
    "where the drive began, x and y [m]"
    symmetric: bool
    stepper_state: StepperState

    def refuse_other(self, timing: Timing, symmetric: bool, new_state: DriveState) -> None:
        """Refuse to go on in another way, or with a model whose states, as in `new_state`, are not those of this drive.

        Raises SimulationError: they differ, or the drive stopped between two samples of its controller or two rows.
        """
        if (timing, symmetric) != (self.timing, self.symmetric):
            raise SimulationError(
                f"This drive goes on with {self.timing}, symmetric={self.symmetric}, as it began: give the same."
            )
        if _shapes(new_state) != _shapes(self.state):
            raise SimulationError(
                "This drive goes on with its own model: the one given has another number of joints, wheels or states."
            )
        for name in ("control", "sample"):
            period = getattr(timing, name)
            if self.checkpoint.steps % round(period / self.fine.dt):
                raise SimulationError(
                    f"This drive stopped after {self.checkpoint.steps * self.fine.dt:g} s, between two {name} times "
                    f"{period:g} s apart: let it end at a multiple of that to go on."
                )


def _shapes(state: DriveState) -> list[tuple[int, ...]]:
    return [array.shape for array in (state.q, state.v, state.contact, state.motor)]
