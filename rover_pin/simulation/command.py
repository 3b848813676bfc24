"""The data that pass between a drive and its controller: the `Reading` that the controller gets, and the `Command` that
it returns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rover_pin.base.errors import UnknownAttributeError
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD
from rover_pin.simulation.state import suspension_places


class Truth(NamedTuple):
    """Quantities of a simulated rover that no sensor on board measures, such as the slip of its wheels. Only a
    simulator, or for the position an external tracker, knows them.
    """

    slip: np.ndarray
    """(wheels,) slip ratio S of each wheel, Eq (1) of the paper [-]; S > 0: the rim is faster than the wheel travels"""
    sinkage: np.ndarray
    """(wheels,) sinkage of each wheel into the soil [m]"""
    normal: np.ndarray
    """(wheels,) force between each wheel and the soil, normal to the ground [N]"""
    travel: np.ndarray
    "(wheels,) travel speed of the wheel's centre [m/s], positive forwards"
    position: np.ndarray
    "(3,) position of the base in the world [m]"
    velocity: np.ndarray
    "(3,) velocity of the base in the world [m/s]"


@dataclass(frozen=True, eq=False)
class Reading:
    """The measurements that a controller gets at each control instant, together with the true state of the
    simulation.
    """

    t: float
    """simulated time [s]; 0 at the start of a drive that begins with a `Start`"""
    duty: np.ndarray
    """(wheels,) PWM duty that each motor applies at this instant, -1 to 1"""
    wheel_rate: np.ndarray
    "(wheels,) rates of the wheel joints [rad/s], positive when rolling forwards"
    current: np.ndarray
    "(wheels,) motor currents [A]"
    suspension: np.ndarray
    "(joints,) angles of the suspension joints [rad], in the order of the rover's joints"
    attitude: tuple[float, float, float]
    """roll, pitch (positive: nose down) and yaw of the base [rad]"""
    truth: Truth

    if not TYPE_CHECKING:  # for a type checker, the method would mean that every attribute exists

        def __getattr__(self, name: str) -> Any:
            """Raise an error for a name that a reading does not have. For the name of a quantity that no rover
            measures, such as the slip, the error names `truth`.
            """
            hint = f"no rover measures it; in a simulation, reading.truth.{name} has its true value."
            hint = hint if name in Truth._fields else ""
            raise UnknownAttributeError(self, name, [field.name for field in fields(Reading)], hint)

    def replace(self, **changes: Any) -> Reading:
        """Return a copy of the reading with some values replaced, for example by values with sensor noise."""
        return Reading(**{field.name: getattr(self, field.name) for field in fields(Reading)} | changes)


class Command(NamedTuple):
    """The command that a controller returns: duties of the motors and angles of the steered wheels. Each is one number
    for all wheels, or an array with one number for each wheel.
    """

    duty: np.ndarray | float
    """PWM duty of the motors, -1 to 1: one number, or (wheels,)"""
    steer: np.ndarray | float = 0.0
    """target angle of the steered wheels [rad]: one number, or (steered wheels,)"""


Controller = Callable[[Reading], Command | np.ndarray | float]
"""A controller is any callable that takes a `Reading` and returns a `Command`. It may also return the duties alone; the
rover then steers straight. If the controller has a method `reset()`, this method is called at the start of a drive."""

TRUTH_COLUMNS = [RECORD.index(name) for name in ("slip", "sinkage", "normal", "travel")]
CURRENT_COLUMN = RECORD.index("current")
"""TRUTH_COLUMNS and CURRENT_COLUMN: in the array `record` of a drive's row, the indices of the columns that hold the
values of `Truth` (slip, sinkage, normal force, travel speed) and the motor current."""


class ReadingPlaces(NamedTuple):
    """Indices of the measured joints in a row of a drive (`row_type`): the wheels in the velocity v, and the
    suspension's joints in the configuration q.
    """

    wheels: list[int]
    "indices of the wheels in the velocity v"
    suspension: np.ndarray
    "indices of the suspension's joints in the configuration q"

    @classmethod
    def of(cls, model: Model) -> ReadingPlaces:
        """Return the indices of the wheels (in v) and of the suspension joints (in q) for a model's rover."""
        return cls([wheel.dof for wheel in model.rover.wheels], suspension_places(model.rover))


class Instant(Reading):
    """A `Reading` whose values are taken from a row of the drive only when the controller uses them, which saves time.

    The drive does not overwrite this row later, so that a controller may keep its readings.
    """

    def __init__(self, rows: np.ndarray, row: int, places: ReadingPlaces):
        # `Reading` is frozen: its fields are set in the instance's dictionary.
        self.__dict__.update(_rows=rows, _index=row, _places=places)

    @cached_property
    def _row(self) -> Any:
        return self.__dict__["_rows"][self.__dict__["_index"]]

    @cached_property
    def t(self) -> float:
        """Simulated time [s]; 0 at the start of a drive that begins with a `Start`."""
        return float(self._row["t"])

    @cached_property
    def duty(self) -> np.ndarray:
        """PWM duty that each motor applies at this instant (wheels,) [-]."""
        return np.asarray(self._row["duty"])

    @cached_property
    def wheel_rate(self) -> np.ndarray:
        """Rates of the wheel joints (wheels,) [rad/s], positive when rolling forwards."""
        return np.asarray(self._row["v"][self.__dict__["_places"].wheels])

    @cached_property
    def current(self) -> np.ndarray:
        """Currents of the motors (wheels,) [A]."""
        return np.asarray(self._row["record"][:, CURRENT_COLUMN])

    @cached_property
    def suspension(self) -> np.ndarray:
        """Angles of the suspension joints (joints,) [rad]."""
        return np.asarray(self._row["q"][self.__dict__["_places"].suspension])

    @cached_property
    def attitude(self) -> tuple[float, float, float]:
        """Roll, pitch (positive: nose down) and yaw of the base [rad]."""
        roll, pitch, yaw = self._row["attitude"].tolist()
        return roll, pitch, yaw

    @cached_property
    def truth(self) -> Truth:
        """Quantities that only a simulator knows: slip, sinkage, normal force and travel speed of the wheels, and
        position and velocity of the base.
        """
        slip, sinkage, normal, travel = self._row["record"].T[TRUTH_COLUMNS]
        return Truth(slip, sinkage, normal, travel, self._row["q"][:3], self._row["velocity"])
