"""Where on the rover its place is measured: an antenna, a prism or a marker is seldom over the base's origin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect

DRAWN = "drawn_yaw"
"""Channel of a replay: how far it was turned towards the logged heading [rad], which is not in its body_yaw."""


@dataclass(frozen=True)
class TrackedPoint(SensorEffect):
    """body_x + i body_y -> body_x + i body_y + (x + i y) exp(i yaw), and its rate for body_vx and body_vy.

    It has no neutral values: nothing is missing where it acts, its numbers are just not known.
    Source: rigid-body kinematics in the plane; pitch and roll move the point by less. Differs from the paper: its
    tracker measures the base.
    """

    title: ClassVar[str] = "tracked point"
    meaning: ClassVar[str] = "the place is measured of a point that is not the base's origin"
    x: Scalar = quantity(0.0, "m", "assumed: over the base's origin; forward", -10.0, 10.0, "x")
    y: Scalar = quantity(0.0, "m", "assumed: over the base's origin; to the left", -10.0, 10.0, "y")

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the place and the speed of the point."""
        return self._move_channels(t, channels, 1.0)

    def undo(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the place and the speed of the base's origin."""
        return self._move_channels(t, channels, -1.0)

    def _move_channels(self, t: np.ndarray, channels: Mapping[str, np.ndarray], sense: float) -> dict[str, np.ndarray]:
        arm = sense * (self.x + 1j * self.y) * np.exp(1j * (channels["body_yaw"] + channels.get(DRAWN, 0.0)))
        rate = np.gradient(arm, t)
        added = {"body_x": arm.real, "body_y": arm.imag, "body_vx": rate.real, "body_vy": rate.imag}
        return {name: channels[name] + more for name, more in added.items() if name in channels}
