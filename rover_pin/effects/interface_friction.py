"""A smooth rim slides on the sand before the sand shears in itself."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class InterfaceFriction(Effect):
    """tan phi <- m tan phi, c <- m c, m = tan delta / tan phi: the weaker of sand and interface limits the shear.

    delta is the friction angle between rim and sand; written as a share m <= 1 of the soil's own strength the weaker of
    the two is taken without a corner, and m = 1 is a rim as rough as the sand. Adhesion is taken as the same share of
    c.
    Source: Potyondy, Geotechnique 11 (1961) 339, ratios of skin friction to soil friction by material and finish.
    Differs from the paper: Eq (3) has the soil's strength alone.
    """

    title: ClassVar[str] = "smooth rim"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "the rim slides on the sand before the sand itself shears"
    m: Scalar = quantity(0.7, "", "assumed: between smooth and rough metal on dry sand", 0.05, 1.0, "m")
    neutral: ClassVar[dict[str, float]] = {"m": 1.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on soil that is as strong as the interface."""
        soil = contact.soil
        phi = ca.atan(self.m * ca.tan(soil.phi))
        return contact._replace(soil=soil.replace(phi=phi, c=self.m * soil.c))
