"""Wheels that are larger, or smaller, than they are said to be."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class WheelScale(Effect):
    """r <- (1 + e) r for all wheels: the rim speed (1 + e) r omega, the contact arc, and the lever of the soil torque.

    It comes before the slip, so that the slip is that of the true rim. Source: geometry; the size is assumed, a rim
    with lugs or sand on it. Differs from the paper: nothing, its radius is only taken as exact. Neglected: the ride
    height and where the wheel meets the terrain stay those of r, as does the mass.
    """

    title: ClassVar[str] = "wheel radius"
    family: ClassVar[str] = "wheel"
    meaning: ClassVar[str] = "the wheels are larger, or smaller, than they are said to be"
    e: Scalar = quantity(0.02, "", "assumed: 2 %, 1 mm of the paper's 45", -0.3, 0.3, "e")
    before_slip: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"e": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact of the larger wheel."""
        larger = 1.0 + self.e
        return contact._replace(rim=larger * contact.rim, wheel=contact.wheel.replace(r=larger * contact.wheel.r))
