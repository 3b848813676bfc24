"""One motor that gives less than the others."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect


@dataclass(frozen=True)
class WeakMotor(MotorEffect):
    """torque -> (1 - g) torque at the wheel with the number `wheel`, so far as the effects before it give it.

    A worn gear or a demagnetised motor passes a share 1 - g of its torque on; g < 0 is a motor stronger than its data.
    Source: assumed form. Differs from the paper: its six motors are alike.
    """

    title: ClassVar[str] = "weak motor"
    meaning: ClassVar[str] = "one motor passes on less torque than the others"
    g: Scalar = quantity(0.2, "", "assumed: a fifth of the torque is lost", -0.5, 1.0, "g")
    wheel: int = 0
    "which wheel of the rover, counted from 0"
    neutral: ClassVar[dict[str, float]] = {"g": 0.0}

    def torque(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> Scalar:
        """Return what is lost."""
        return ca.if_else(ca.fabs(drive.wheel - self.wheel) < 0.5, -self.g * torque, 0.0)
