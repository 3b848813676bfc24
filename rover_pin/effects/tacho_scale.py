"""Tachogenerators that read too fast or too slow."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect


@dataclass(frozen=True)
class TachoScale(SensorEffect):
    """A tachogenerator reads too fast or too slow by a factor: wheel_rate -> (1 + e) wheel_rate.

    The effect acts on the wheel that `wheel` names, or on all wheels if `wheel` is empty.

    Source: gain error of a tachogenerator (assumed form). Differs from the paper: its sensors are exact.
    """

    title: ClassVar[str] = "tachometer scale"
    meaning: ClassVar[str] = "a wheel-rate sensor reads too fast or too slow"
    e: Scalar = quantity(0.02, "", "assumed: a gain 2 % too high", -0.5, 0.5, "e")
    wheel: str = ""
    neutral: ClassVar[dict[str, float]] = {"e": 0.0}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the wheel rates as the sensors log them, with their scale error."""
        return {name: (1.0 + self.e) * values for name, values in channels.items() if self._has(name)}

    def undo(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the true wheel rates that belong to the logged ones."""
        return {name: values / (1.0 + self.e) for name, values in channels.items() if self._has(name)}

    def _has(self, name: str) -> bool:
        """Return whether the channel `name` is the rate of a wheel on which this effect acts."""
        return name.startswith(f"wheel_rate_{self.wheel}")
