"""A motor driver that ignores the first part of the duty ratio."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect


@dataclass(frozen=True)
class DeadBand(MotorEffect):
    """The motor driver ignores the first part delta_0 of the duty ratio, because its bridge has dead times and
    thresholds.

        delta <- sgn(delta) max(|delta| - delta_0, 0)

    Below delta_0 the motor is shorted, as at duty 0, and does not coast. The law has corners in the duty only, which is
    a command; it is smooth in every state of the motor.

    Source: assumed form; the dead zone of the standard references on actuators. Differs from the paper: its duty acts
    from 0 on.
    """

    title: ClassVar[str] = "dead band of the driver"
    meaning: ClassVar[str] = "the motor driver swallows the first part of the duty"
    delta_0: Scalar = quantity(0.05, "", "assumed: 0.01 to 0.1 for small drivers", 0.0, 0.9, "delta_0")
    neutral: ClassVar[dict[str, float]] = {"delta_0": 0.0}

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the motor's input with the part of the duty ratio that passes the dead band."""
        # The positive and the negative part are shortened separately; within the band both are 0.
        reaching = ca.fmax(drive.delta - self.delta_0, 0.0) + ca.fmin(drive.delta + self.delta_0, 0.0)
        return drive._replace(delta=reaching)
