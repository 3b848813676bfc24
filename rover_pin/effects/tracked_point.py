"""The point of the rover whose position is measured: an antenna, prism or marker is seldom above the base's origin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect

DRAWN = "drawn_yaw"
"""Name of a channel of a replay: the rotation [rad] of the replay towards the logged heading, which its body_yaw does
not contain."""


@dataclass(frozen=True)
class TrackedPoint(SensorEffect):
    """The position is measured of a point (x, y) of the rover, such as an antenna or a prism, and not of the base's
    origin.

        body_x + i body_y -> body_x + i body_y + (x + i y) exp(i yaw), and its rate for body_vx and body_vy

    The effect has no neutral values: a log of another point lacks nothing, only the position of the point on the rover
    is unknown.

    Source: rigid-body kinematics in the plane; pitch and roll move the point by less. Differs from the paper: its
    tracker measures the base.
    """

    title: ClassVar[str] = "tracked point"
    meaning: ClassVar[str] = "the measured position is the position of a point that is not the base's origin"
    x: Scalar = quantity(0.0, "m", "assumed: over the base's origin; forward", -10.0, 10.0, "x")
    y: Scalar = quantity(0.0, "m", "assumed: over the base's origin; to the left", -10.0, 10.0, "y")

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the position and velocity of the tracked point, from the position and velocity of the base's
        origin.
        """
        return self._move_channels(t, channels, 1.0)

    def undo(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the position and velocity of the base's origin, from the position and velocity of the tracked
        point.
        """
        return self._move_channels(t, channels, -1.0)

    def _move_channels(self, t: np.ndarray, channels: Mapping[str, np.ndarray], sense: float) -> dict[str, np.ndarray]:
        """Return positions and velocities that are moved from the base's origin to the tracked point (`sense` 1), or
        from the point back to the origin (`sense` -1).
        """
        # The arm from the base's origin to the point, in the world, as a complex number x + i y.
        arm = sense * (self.x + 1j * self.y) * np.exp(1j * (channels["body_yaw"] + channels.get(DRAWN, 0.0)))
        # The velocity of the point differs by the rate of this arm.
        rate = np.gradient(arm, t)
        # Only channels that the log has are moved.
        added = {"body_x": arm.real, "body_y": arm.imag, "body_vx": rate.real, "body_vy": rate.imag}
        return {name: channels[name] + more for name, more in added.items() if name in channels}
