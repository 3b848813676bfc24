"""The state of a drive (configuration, velocity and states of the effects), the indices of the suspension's joints in
it, and the end of a drive, which allows its continuation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import SimulationError
from rover_pin.base.public import brief
from rover_pin.rover.rover import Rover
from rover_pin.simulation.stepping.timing import Timing


@brief
@dataclass
class DriveState:
    """State of a drive at one time: configuration, velocity and states of the effects. A step of the drive changes the
    arrays in place.
    """

    t: float
    """simulated time [s]"""
    q: np.ndarray
    "(nq,) Pinocchio's configuration: position of the base [m], its quaternion x, y, z, w, then the joint angles [rad]"
    v: np.ndarray
    "(nv,) velocity and angular velocity of the base in its own axes [m/s, rad/s], then the joint rates [rad/s]"
    contact: np.ndarray
    """(wheels, states) states of all contact effects at each wheel, in the order of the effects"""
    motor: np.ndarray
    """(wheels, states) states of all motor effects at each wheel, in the order of the effects"""

    def copy(self) -> DriveState:
        """Return a copy of the state with its own arrays, which later steps do not change."""
        return DriveState(self.t, self.q.copy(), self.v.copy(), self.contact.copy(), self.motor.copy())


def roll_pitch_yaw(q: np.ndarray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of the base in a configuration q (nq,).

    A rotation by yaw about z, then by pitch about the new y, then by roll about the new x turns the world's axes into
    the axes of the base. A positive pitch lowers the nose.
    """
    x, y, z, w = (float(value) for value in q[3:7])
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    # Round-off may put the sine slightly beyond 1 where the nose points straight down.
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    return roll, pitch, math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def base_rotation(q: np.ndarray) -> np.ndarray:
    """Return the rotation matrix (3, 3) of the base in a configuration q (nq,). It turns vectors in the base's axes
    into vectors in the world's axes.
    """
    return np.array(pin.Quaternion(q[6], q[3], q[4], q[5]).matrix())


def suspension_dofs(rover: Rover) -> list[int]:
    """Return the indices of the suspension's joints in the velocity v. These are all free joints except the base, the
    wheels and the steering.
    """
    return rover.free_dofs[6:]


@lru_cache(maxsize=8)
def suspension_places(rover: Rover) -> np.ndarray:
    """Return the indices of the suspension's joints in the configuration q, in the order of `suspension_dofs`.

    The array is computed once for each rover; it is read by many callers and must not be changed.
    """
    # Joint 0 is the world and joint 1 the free base, so the joints of the rover begin at 2.
    q_of = {joint.idx_v: joint.idx_q for joint in list(rover.model.joints)[2:]}
    return np.array([q_of[dof] for dof in suspension_dofs(rover)], dtype=np.int64)


class Joints(NamedTuple):
    """The joints of a rover's suspension, as body effects need them: their number, which of them are the two rockers,
    and their names.
    """

    number: int
    rockers: tuple[int, int] | None
    """indices of the left and the right rocker among the suspension's joints, if a differential couples them; None: the
    rover has no differential"""
    names: tuple[str, ...] = ()
    """for each joint, the name of the channel that holds its angle, such as bogie_l"""


def joints_of(rover: Rover) -> Joints:
    """Return the number, the names and the rockers of the joints of a rover's suspension, as body effects need them."""
    dofs, differential = suspension_dofs(rover), rover.differential
    channels = {place: name for name, place in rover.angles.items()}
    rockers = None if differential is None else (dofs.index(differential.left), dofs.index(differential.right))
    return Joints(len(dofs), rockers, tuple(channels[place] for place in suspension_places(rover)))


class Checkpoint(NamedTuple):
    """Progress of a drive, which allows its continuation. Progress is counted in whole steps, so that round-off of the
    time does not accumulate.
    """

    begin: float
    """simulated time at which the drive began [s]"""
    steps: int
    """number of steps of the length dt taken since the beginning; a step that was divided into parts counts once"""
    size: int
    """length of the next step, counted in parts of dt; `pace.FINEST` parts are one dt"""


@brief
class StepperState(NamedTuple):
    """State of a stepper between two steps, which allows the continuation of a drive: all arrays that a step changes,
    and the commands that act at present.
    """

    moving: tuple[np.ndarray, ...]
    """copies of all arrays that a step changes, in the order of `StepArrays.moving`"""
    duty: np.ndarray
    "(wheels,) duties that the motors apply until the next command [-]"
    servo: np.ndarray
    "(servos,) commanded steering angles [rad]"


@brief
@dataclass(frozen=True, eq=False)
class DriveEnd:
    """The end of a drive. `simulate(model, controller, duration, trace.end)` continues from it.

    The continuation is equal to the bit to a drive without interruption, because this object also contains the states
    of the effects, the loads and currents of the last step, and the present duties. The continuation needs an equal
    model, an equal timing, and the controller of this drive, which continues without a reset.
    """

    state: DriveState
    checkpoint: Checkpoint
    timing: Timing
    """step, control period and time between rows that the caller requested"""
    fine: Timing
    """the times of `timing`, but with the step that the drive actually took, which may be shorter"""
    place: tuple[float, float]
    "x and y [m] at which the drive began"
    symmetric: bool
    """whether the motion is kept mirror-symmetric about the x-z plane"""
    stepper_state: StepperState

    def refuse_other(self, timing: Timing, symmetric: bool, new_state: DriveState) -> None:
        """Raise an error if a continuation would not be equal to a drive without interruption.

        Parameters
        ----------
        timing, symmetric
            Timing and symmetry that the caller asks for in the continuation. They must equal the model and the timing
            of this drive.
        new_state : DriveState
            A state of the model that the caller gives for the continuation. The shapes of its arrays must equal the
            shapes of this drive's arrays.

        Raises
        ------
        SimulationError
            Timing, symmetry or shapes differ, or this drive ended between two calls of its controller or between two
            rows.
        """
        # Another step or symmetry would make the second part differ from a drive without interruption.
        if (timing, symmetric) != (self.timing, self.symmetric):
            raise SimulationError(
                f"The drive cannot be continued with other settings than it began with, which are {self.timing}, "
                f"symmetric={self.symmetric}: give the same timing and the same symmetric."
            )
        # A model with other joints, wheels or effect states has arrays of other shapes.
        shapes, new_shapes = (
            [array.shape for array in (state.q, state.v, state.contact, state.motor)]
            for state in (self.state, new_state)
        )
        if new_shapes != shapes:
            raise SimulationError(
                "The drive cannot be continued with the given model, which has another number of joints, wheels or "
                "effect states than the model of the drive: give an equal model."
            )
        # Commands and rows come at whole multiples of their periods from the beginning of the first part.
        for name in ("control", "sample"):
            period = getattr(timing, name)
            if self.checkpoint.steps % round(period / self.fine.dt):
                raise SimulationError(
                    f"The drive cannot be continued, because its first part lasted "
                    f"{self.checkpoint.steps * self.fine.dt:g} s, which is not a whole multiple of its {name} period "
                    f"{period:g} s: simulate the first part again, with a duration that is such a multiple."
                )
