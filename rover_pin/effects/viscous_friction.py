"""Friction of bearings and grease that grows with speed."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect


@dataclass(frozen=True)
class ViscousFriction(MotorEffect):
    """Friction of bearings and grease grows in proportion to the wheel rate omega: torque = -b_v omega.

    Without logged currents, this effect cannot be distinguished from a motor with a lower no-load rate.

    Source: Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083. Differs from the paper: it has no
    friction.
    """

    title: ClassVar[str] = "viscous friction"
    meaning: ClassVar[str] = "bearings and grease resist in proportion to speed"
    b_v: Scalar = quantity(0.01, "N m s", "assumed: 2 % of the stall torque at full speed", 0.0, 10.0, "b_v")
    neutral: ClassVar[dict[str, float]] = {"b_v": 0.0}

    def torque(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> Scalar:
        """Return the friction torque [N m] that this effect adds at the wheel."""
        return -self.b_v * drive.omega
