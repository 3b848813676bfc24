"""The state of a drive, and how a rover is set down on its terrain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rover_pin.base.public import brief


@brief
@dataclass
class DriveState:
    """Time [s], configuration, velocity, and the own states of the effects (a row per wheel); changed in place."""

    t: float
    q: np.ndarray
    v: np.ndarray
    contact: np.ndarray
    motor: np.ndarray

    def copy(self) -> DriveState:
        """Return an independent copy."""
        return DriveState(self.t, self.q.copy(), self.v.copy(), self.contact.copy(), self.motor.copy())


def roll_pitch_yaw(q: np.ndarray) -> tuple[float, float, float]:
    """Return the base's roll, pitch and yaw [rad], world z-y-x, of a configuration."""
    x, y, z, w = (float(value) for value in q[3:7])
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    return roll, pitch, math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def base_rotation(q: np.ndarray) -> np.ndarray:
    """Return the rotation of the base [3, 3]."""
    return np.array(pin.Quaternion(q[6], q[3], q[4], q[5]).matrix())
