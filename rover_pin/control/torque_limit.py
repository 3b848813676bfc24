"""The duty at which a motor would ask more of the soil than its greatest shear."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from rover_pin.body.statics import wheel_loads
from rover_pin.motion.command import Reading
from rover_pin.motion.model import Model
from rover_pin.motion.motor import Motor
from rover_pin.soil.limits import saturation_torque

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
    """delta <= (T_sat(W) + K^2 omega / R) / (K V / R): the motor's torque stays below the soil's greatest shear.

    T_sat is taken at the static load of each wheel for the body's present pitch ("the normal load is evaluated from the
    body attitude ... considering static balance", section 4).
    """

    motor: Motor
    pitches: tuple[float, ...]
    torques: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, model: Model) -> Self:
        """Return the limit for a model's rover, motors and ground."""
        rows = []
        for pitch in PITCHES:
            loads = wheel_loads(model.rover, -float(pitch), gravity=model.gravity)
            rows.append(
                tuple(
                    float(saturation_torque(max(float(load), 0.0), wheel.wheel, model.soils[0]))
                    for load, wheel in zip(loads, model.rover.wheels, strict=True)
                )
            )
        return cls(model.motor, tuple(map(float, PITCHES)), tuple(rows))

    def torque(self, pitch: float) -> np.ndarray:
        """Return the greatest torque of each wheel [N m] at a body pitch [rad], nose down positive."""
        table = np.array(self.torques)
        return np.array([np.interp(pitch, self.pitches, column) for column in table.T])

    def duty(self, reading: Reading) -> np.ndarray:
        """Return the highest duty allowed, one value a wheel [-]."""
        pitch = reading.attitude[1]
        back = self.motor.stall_torque * reading.wheel_rate / self.motor.no_load_rate
        most = (self.torque(pitch if math.isfinite(pitch) else 0.0) + back) / self.motor.stall_torque
        return np.clip(most, 0.0, 1.0)
