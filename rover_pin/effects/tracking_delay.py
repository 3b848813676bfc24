"""An external tracker whose picture of the body is late."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect


@dataclass(frozen=True)
class TrackingDelay(SensorEffect):
    """body(t) -> body(t - d) for position, attitude and velocity; before the first sample, the first sample.

    Source: latency of video tracking (assumed form). Differs from the paper: its tracker is in step with the wheels.
    """

    title: ClassVar[str] = "late tracking"
    meaning: ClassVar[str] = "the external tracker reports where the rover was a moment ago"
    d: Scalar = quantity(0.1, "s", "assumed: three frames at 30 Hz", 0.0, 5.0, "d")
    neutral: ClassVar[dict[str, float]] = {"d": 0.0}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the late channels."""
        return _at(np.asarray(t) - self.d, t, channels)

    def undo(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the channels as they were before the delay; after the last sample, the last."""
        return _at(np.asarray(t) + self.d, t, channels)


def _at(times: np.ndarray, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: np.interp(times, t, values) for name, values in channels.items() if name.startswith("body_")}
