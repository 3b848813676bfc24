"""A drive in progress: its stepper, what its controller reads, and what it is told to do."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from rover_pin.errors import SimulationError
from rover_pin.motion.command import Command, Controller, Reading, Truth
from rover_pin.motion.failure import Suspension
from rover_pin.motion.going_on import Counted
from rover_pin.motion.model import Model
from rover_pin.motion.native.shared import RECORD
from rover_pin.motion.pace import Steps
from rover_pin.motion.state import DriveState, base_rotation, roll_pitch_yaw
from rover_pin.motion.timing import Timing


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
    counted: Counted | None = None
    "where it goes on; None: it begins"


Progress = Callable[[float], None]
"""Called now and then with the simulated time [s]."""
TRUTH = [RECORD.index(name) for name in ("slip", "sinkage", "normal", "travel")]
CURRENT = RECORD.index("current")
OFTEN = 50
"""Rows between two such calls."""


class Ran(NamedTuple):
    """What came of a drive: its rows (`row_type`), why it ended, and how far it is."""

    rows: np.ndarray
    stop: str
    counted: Counted


def diverged(status: int, t: float) -> str:
    """Return why a drive ended whose step returned this status."""
    return f"diverged at {t:.2f} s: " + ("a velocity is not finite", "the system is singular")[status - 1]


def obey(drive: Drive, suspension: Suspension) -> None:
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
    slip, sinkage, normal, travel = (record[:, column].copy() for column in TRUTH)
    truth = Truth(
        slip,
        sinkage,
        normal,
        travel,
        state.q[:3].copy(),
        base_rotation(state.q) @ state.v[:3],
    )
    return Reading(
        state.t,
        drive.stepper.duty.copy(),
        state.v[[wheel.dof for wheel in drive.model.rover.wheels]],
        record[:, CURRENT].copy(),
        state.q[suspension.places],
        roll_pitch_yaw(state.q),
        truth,
    )
