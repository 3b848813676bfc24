"""Wheels that are larger or smaller than declared."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class WheelScale(Effect):
    """All wheels are larger or smaller than declared: r <- (1 + e) r for the rim speed, the contact arc and the lever
    of the soil torque.

    The effect acts before the slip, so that the slip is the slip of the true rim. Neglected: the ride height, the
    position of the contact with the terrain, and the mass do not change with e.

    Source: geometry; the size is assumed, for a rim with lugs or with adhering sand. Differs from the paper: the paper
    takes the radius as exact.
    """

    title: ClassVar[str] = "wheel radius"
    family: ClassVar[str] = "wheel"
    meaning: ClassVar[str] = "the wheels are larger, or smaller, than declared"
    e: Scalar = quantity(0.02, "", "assumed: 2 %, 1 mm of the paper's 45", -0.3, 0.3, "e")
    before_slip: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"e": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact of a wheel with its true radius: both the rim speed and the wheel's radius are scaled."""
        # The rim speed is scaled as well, because this effect acts before the slip is computed from it.
        larger = 1.0 + self.e
        return contact._replace(rim=larger * contact.rim, wheel=contact.wheel.replace(r=larger * contact.wheel.r))
