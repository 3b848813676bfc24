"""A driver that swallows the first part of the duty."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect


@dataclass(frozen=True)
class DeadBand(MotorEffect):
    """delta <- sgn(delta) max(|delta| - delta_0, 0): dead time and thresholds of the bridge.

    Below delta_0 the motor is shorted, as at duty 0, not free. It has corners in delta alone, which is a command, so
    that every state still sees a smooth motor.
    Source: assumed form; the dead zone of the standard references on actuators. Differs from the paper: duty acts from
    0.
    """

    title: ClassVar[str] = "dead band of the driver"
    meaning: ClassVar[str] = "the motor driver swallows the first part of the duty"
    delta_0: Scalar = quantity(0.05, "", "assumed: 0.01 to 0.1 for small drivers", 0.0, 0.9, "delta_0")
    neutral: ClassVar[dict[str, float]] = {"delta_0": 0.0}

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the drive with the duty that reaches the motor."""
        reaching = ca.fmax(drive.delta - self.delta_0, 0.0) + ca.fmin(drive.delta + self.delta_0, 0.0)
        return drive._replace(delta=reaching)
