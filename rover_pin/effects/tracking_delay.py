"""An external tracker that reports the body late."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect


@dataclass(frozen=True)
class TrackingDelay(SensorEffect):
    """An external tracker reports the body late by the time d: body(t) -> body(t - d) for position, attitude and
    velocity.

    Before the start of the log the first sample holds.

    Source: latency of video tracking (assumed form). Differs from the paper: its tracker is in step with the wheels.
    """

    title: ClassVar[str] = "late tracking"
    meaning: ClassVar[str] = "the external tracker reports where the rover was a moment ago"
    d: Scalar = quantity(0.1, "s", "assumed: three frames at 30 Hz", 0.0, 5.0, "d")
    neutral: ClassVar[dict[str, float]] = {"d": 0.0}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the body's channels as the tracker logs them, with the delay."""
        return _at(np.asarray(t) - self.d, t, channels)

    def undo(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the body's channels without the delay. After the end of the log, the last sample is used."""
        return _at(np.asarray(t) + self.d, t, channels)


def _at(times: np.ndarray, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the body's channels at other `times` [s], interpolated linearly between the samples at `t` [s]."""
    # np.interp holds the first and the last sample beyond the ends of the log.
    return {name: np.interp(times, t, values) for name, values in channels.items() if name.startswith("body_")}
