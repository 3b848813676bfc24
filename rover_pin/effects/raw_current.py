"""Motor currents in the counts of a logger, with unknown scale and zero."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect

MAX_COUNTS = 1e9
"""Bound of the scale and the offset of a logged current. No converter counts to higher values."""


@dataclass(frozen=True)
class RawCurrent(SensorEffect):
    """The current of one wheel's motor is logged in counts: channel = scale current + offset.

    The effect has no neutral values: a log in counts lacks nothing, only its scale and its zero are unknown.

    Source: an uncalibrated shunt or converter (assumed form). Differs from the paper: its sensors are exact.
    """

    title: ClassVar[str] = "raw motor current"
    meaning: ClassVar[str] = "a current is logged in counts of unknown scale and zero"
    scale: Scalar = quantity(1.0, "", "assumed: in the channel's unit per A", -MAX_COUNTS, MAX_COUNTS, "scale")
    offset: Scalar = quantity(0.0, "", "assumed: in the channel's unit", -MAX_COUNTS, MAX_COUNTS, "offset")
    motor: str = "fl"
    """name of the wheel whose motor current is logged"""
    channel: str = "raw_current_fl"

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the logged channel: the motor's current in counts."""
        true = f"current_{self.motor}_A"
        return {self.channel: self.scale * channels[true] + self.offset} if true in channels else {}
