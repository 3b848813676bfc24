"""A channel with a constant offset."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect


@dataclass(frozen=True)
class SensorBias(SensorEffect):
    """A sensor has a constant zero error: channel -> channel + bias, in the unit of the channel.

    Source: zero error of a potentiometer or a level (assumed form). Differs from the paper: its sensors are exact.
    """

    title: ClassVar[str] = "sensor bias"
    meaning: ClassVar[str] = "a sensor reads a constant too much"
    bias: Scalar = quantity(0.017, "", "assumed: 1 deg, in the channel's unit", -1e3, 1e3, "bias")
    channel: str = "body_pitch"
    neutral: ClassVar[dict[str, float]] = {"bias": 0.0}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the channel as the sensor logs it, with its constant offset."""
        return {self.channel: channels[self.channel] + self.bias} if self.channel in channels else {}
