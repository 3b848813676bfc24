"""A motor that gives less torque than the others."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect


@dataclass(frozen=True)
class WeakMotor(MotorEffect):
    """The motor of one wheel gives less torque than the others: torque -> (1 - g) torque at the wheel with the number
    `wheel`.

    A worn gear or a demagnetised motor passes on a fraction 1 - g of its torque, which includes the torque of all
    earlier effects. g < 0 is a motor that is stronger than its data.

    Source: assumed form. Differs from the paper: its six motors are equal.
    """

    title: ClassVar[str] = "weak motor"
    meaning: ClassVar[str] = "one motor gives less torque than the others"
    g: Scalar = quantity(0.2, "", "assumed: a fifth of the torque is lost", -0.5, 1.0, "g")
    wheel: int = 0
    """index of the wheel with the weak motor, counted from 0"""
    neutral: ClassVar[dict[str, float]] = {"g": 0.0}

    def torque(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> Scalar:
        """Return the torque [N m] that is missing at the wheel of the weak motor, as a negative number; 0 for all other
        wheels.
        """
        # The wheel's index is a float or a CasADi expression, so that it is compared within one half.
        return ca.if_else(ca.fabs(drive.wheel - self.wheel) < 0.5, -self.g * torque, 0.0)
