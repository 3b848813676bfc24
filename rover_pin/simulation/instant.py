"""What a controller reads of a drive: values that are looked up when they are asked for."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from rover_pin.simulation.command import Reading, Truth
from rover_pin.simulation.compiled.suspension import suspension_places
from rover_pin.simulation.model.model import Model
from rover_pin.simulation.native.shared import RECORD

TRUTH = [RECORD.index(name) for name in ("slip", "sinkage", "normal", "travel")]
CURRENT = RECORD.index("current")


class Places(NamedTuple):
    """Where a row (`row_type`) has what a controller reads: the wheels in v, the suspension in q."""

    wheels: list[int]
    suspension: np.ndarray

    @classmethod
    def of(cls, model: Model) -> Places:
        """Return the places of a model's rover."""
        return cls([wheel.dof for wheel in model.rover.wheels], suspension_places(model.rover))


class Instant(Reading):
    """A reading that costs nothing until it is read: a row of a drive, which stays as it was when the drive goes on."""

    def __init__(self, rows: np.ndarray, at: int, places: Places):
        self.__dict__.update(_rows=rows, _at=at, _places=places)

    @cached_property
    def _row(self) -> Any:
        return self.__dict__["_rows"][self.__dict__["_at"]]

    @cached_property
    def t(self) -> float:
        """Time [s]."""
        return float(self._row["t"])

    @cached_property
    def duty(self) -> np.ndarray:
        """Duty now applied."""
        return np.asarray(self._row["duty"])

    @cached_property
    def wheel_rate(self) -> np.ndarray:
        """Rate of the wheel joints [rad/s]."""
        return np.asarray(self._row["v"][self.__dict__["_places"].wheels])

    @cached_property
    def current(self) -> np.ndarray:
        """Motor currents [A]."""
        return np.asarray(self._row["record"][:, CURRENT])

    @cached_property
    def suspension(self) -> np.ndarray:
        """Angles of the suspension joints [rad]."""
        return np.asarray(self._row["q"][self.__dict__["_places"].suspension])

    @cached_property
    def attitude(self) -> tuple[float, float, float]:
        """Roll, pitch, yaw of the base [rad]."""
        roll, pitch, yaw = self._row["attitude"].tolist()
        return roll, pitch, yaw

    @cached_property
    def truth(self) -> Truth:
        """What only a simulator knows."""
        slip, sinkage, normal, travel = self._row["record"].T[TRUTH]
        return Truth(slip, sinkage, normal, travel, self._row["q"][:3], self._row["velocity"])
