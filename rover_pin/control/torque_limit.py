"""The duty at which a motor would ask more of the soil than its bound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from rover_pin.body.statics import wheel_loads
from rover_pin.control.bounds import SLIP_LIMIT, TorqueBounds, WheelBounds
from rover_pin.motion.command import Reading
from rover_pin.motion.model import Model
from rover_pin.motion.motor import Motor

PITCHES = np.radians(np.arange(-40.0, 41.0, 5.0))
"""Pitches [rad] at which the limits are prepared; linear in between."""


@dataclass(frozen=True)
class NoLimit:
    """No torque limit."""

    def duty(self, reading: Reading) -> np.ndarray | float:
        """Return the highest duty allowed [-]."""
        return 1.0


@dataclass(frozen=True)
class TorqueLimit:
    """delta <= (T + K^2 omega / R) / (K V / R): the motor's torque stays below a bound T(W) of the soil.

    W is the static load of each wheel at the body's present pitch ("the normal load is evaluated from the body attitude
    ... considering static balance", section 4). `saturation` bounds by the greatest shear, as section 5 says; on soils
    of large k a wheel spins long before it, and `at_slip` is the limit that acts.
    """

    motor: Motor
    torques: tuple[tuple[float, ...], ...]
    "at each of PITCHES, one value a wheel [N m]"

    @classmethod
    def saturation(cls, model: Model) -> Self:
        """Return the limit at the soil's greatest shear, T_sat."""
        return cls(model.motor, tuple(tuple(bounds.saturation) for bounds in _bounds(model, SLIP_LIMIT)))

    @classmethod
    def at_slip(cls, model: Model, slip_limit: float) -> Self:
        """Return the limit at a slip, T_lim."""
        return cls(model.motor, tuple(tuple(bounds.limit) for bounds in _bounds(model, slip_limit)))

    def torque(self, pitch: float) -> np.ndarray:
        """Return the greatest torque of each wheel [N m] at a body pitch [rad], nose down positive."""
        return np.array([np.interp(pitch, PITCHES, column) for column in np.array(self.torques).T])

    def duty(self, reading: Reading) -> np.ndarray:
        """Return the highest duty allowed, one value a wheel [-]."""
        back = reading.wheel_rate / float(self.motor.no_load_rate)
        most = self.torque(reading.attitude[1]) / float(self.motor.stall_torque) + back
        return np.clip(most, 0.0, 1.0)


def _bounds(model: Model, slip_limit: float) -> list[WheelBounds]:
    """Return the bounds on the model's ground at each of PITCHES; a wheel that statics would lift is unloaded."""
    wheels = [mount.wheel for mount in model.rover.wheels]
    bounds = TorqueBounds(wheels, model.soils[0], slip_limit)
    loads = [wheel_loads(model.rover, -float(pitch), gravity=model.gravity) for pitch in PITCHES]
    return [bounds(np.maximum(load, 0.0)) for load in loads]
