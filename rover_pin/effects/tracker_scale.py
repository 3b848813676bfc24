"""A tracker, camera or visual odometry whose metre is not a metre."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect

PLACES, SPEEDS = ("body_x", "body_y", "body_z"), ("body_vx", "body_vy", "body_vz")


@dataclass(frozen=True)
class TrackerScale(SensorEffect):
    """x -> x(0) + (1 + e) (x - x(0)), v -> (1 + e) v; attitude is right.

    Source: scale error of visual odometry, which begins at a known place (assumed form). Differs from the paper: its
    tracker is exact.
    """

    title: ClassVar[str] = "tracker scale"
    meaning: ClassVar[str] = "the tracked way and speed are too long or too short by a factor"
    e: Scalar = quantity(0.02, "", "assumed: a scale 2 % too large", -0.5, 0.5, "e")
    neutral: ClassVar[dict[str, float]] = {"e": 0.0}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the scaled places and speeds."""
        return _scale_channels(channels, 1.0 + self.e)

    def undo(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the true places and speeds."""
        return _scale_channels(channels, 1.0 / (1.0 + self.e))


def _scale_channels(channels: Mapping[str, np.ndarray], factor: Scalar) -> dict[str, np.ndarray]:
    scaled = {name: factor * channels[name] for name in SPEEDS if name in channels}
    for name in (name for name in PLACES if name in channels):
        first = channels[name][np.isfinite(channels[name])][:1].sum()
        scaled[name] = first + factor * (channels[name] - first)
    return scaled
