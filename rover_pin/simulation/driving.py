"""A drive in progress: its stepper, what its controller reads, and what it is commanded."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeGuard

import numpy as np

from rover_pin.base.errors import SimulationError
from rover_pin.simulation.checkpoint import Checkpoint
from rover_pin.simulation.command import Command, Controller, Reading
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.pace import Steps
from rover_pin.simulation.state import DriveState
from rover_pin.simulation.timing import Timing


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
    checkpoint: Checkpoint | None = None
    "where it goes on; None: it begins"
    followed: np.ndarray | None = None
    "lengths [s] of the steps to take; None: it chooses them"


Progress = Callable[[float], None]
"""Called now and then with the simulated time [s]."""
OFTEN = 50
"""Rows between two such calls."""


class Ran(NamedTuple):
    """What came of a drive: its rows (`row_type`), why it ended, and how far it is."""

    rows: np.ndarray
    stop: str
    checkpoint: Checkpoint
    lengths: np.ndarray
    "of the steps taken [s]"


def stop_reason(status: int, t: float) -> str:
    """Return why a drive ended whose step returned this status."""
    return f"diverged at {t:.2f} s: " + ("a velocity is not finite", "the system is singular")[status - 1]


def obey(drive: Drive, reading: Reading) -> None:
    """Ask the controller and apply its command."""
    stepper, wheels = drive.stepper, len(drive.model.rover.wheels)
    command = drive.controller(reading)
    duty, steer = command if isinstance(command, Command) else (command, 0.0)
    valid = _is_number(duty) and -1.0 <= duty <= 1.0
    stepper.duty[:] = duty if valid else _duties(duty, wheels, drive.state.t)
    if stepper.servo_wheels:
        stepper.servo_target[:] = (
            steer if _is_number(steer) else _angles(steer, len(stepper.servo_wheels), drive.state.t)
        )


def _is_number(value: Any) -> TypeGuard[float]:
    return type(value) is float and math.isfinite(value)


def _duties(returned: Any, wheels: int, t: float) -> np.ndarray:
    duty = _numbers(returned)
    if duty.shape not in ((), (1,), (wheels,)) or not (np.abs(duty) <= 1.0).all():
        raise SimulationError(
            f"At {t:.2f} s the controller returned the duty {returned!r}: "
            f"give one number in [-1, 1], or {wheels}, one a wheel; clip it where your law saturates."
        )
    return duty


def _angles(returned: Any, servos: int, t: float) -> np.ndarray:
    steer = _numbers(returned)
    if steer.shape not in ((), (servos,)) or not np.isfinite(steer).all():
        raise SimulationError(
            f"At {t:.2f} s the controller returned the steering {returned!r}: "
            f"give one number, or {servos}, one a steered wheel [rad]."
        )
    return steer


def _numbers(returned: Any) -> np.ndarray:
    """Return what a controller returned as numbers; of what is none, one that is none."""
    try:
        return np.asarray(returned, dtype=float)
    except (TypeError, ValueError):
        return np.array(np.nan)
