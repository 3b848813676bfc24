"""A tracker, camera or visual odometry with a scale error."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect

POSITIONS, SPEEDS = ("body_x", "body_y", "body_z"), ("body_vx", "body_vy", "body_vz")


@dataclass(frozen=True)
class TrackerScale(SensorEffect):
    """A tracker, camera or visual odometry has a scale error e: distances from its start, and speeds, are wrong by the
    factor 1 + e.

        x -> x(0) + (1 + e) (x - x(0)),   v -> (1 + e) v

    x is the position, x(0) its first value, and v the velocity. The attitude is correct.

    Source: scale error of visual odometry, which starts at a known position (assumed form). Differs from the paper: its
    tracker is exact.
    """

    title: ClassVar[str] = "tracker scale"
    meaning: ClassVar[str] = "the tracked distance and speed are too large or too small by a factor"
    e: Scalar = quantity(0.02, "", "assumed: a scale 2 % too large", -0.5, 0.5, "e")
    neutral: ClassVar[dict[str, float]] = {"e": 0.0}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the body's positions and velocities as the tracker logs them, with its scale error."""
        return _scale_channels(channels, 1.0 + self.e)

    def undo(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the body's true positions and velocities, for logged ones."""
        return _scale_channels(channels, 1.0 / (1.0 + self.e))


def _scale_channels(channels: Mapping[str, np.ndarray], factor: Scalar) -> dict[str, np.ndarray]:
    """Return the velocities multiplied by `factor`, and the positions scaled by `factor` about their first finite
    value.
    """
    scaled = {name: factor * channels[name] for name in SPEEDS if name in channels}
    for name in (name for name in POSITIONS if name in channels):
        # A tracker starts at a known position, so that distances from the first position are scaled.
        first = channels[name][np.isfinite(channels[name])][:1].sum()
        scaled[name] = first + factor * (channels[name] - first)
    return scaled
