"""A smooth rim that slides on the sand before the sand itself shears."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class InterfaceFriction(Effect):
    """The rim is so smooth that it slides on the sand before the sand itself shears: the interface limits the shear
    stress.

        tan phi <- m tan phi,   c <- m c,   m = tan delta / tan phi

    delta is the friction angle between rim and sand. Given as a fraction m <= 1 of the soil's own strength, the minimum
    of both strengths needs no corner; m = 1 is a rim as rough as the sand. The adhesion is assumed to be the fraction m
    of the cohesion c.

    Source: Potyondy, Geotechnique 11 (1961) 339, ratios of skin friction to soil friction by material and finish.
    Differs from the paper: Eq (3) has the soil's strength only.
    """

    title: ClassVar[str] = "smooth rim"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "the rim slides on the sand before the sand itself shears"
    m: Scalar = quantity(0.7, "", "assumed: between smooth and rough metal on dry sand", 0.05, 1.0, "m")
    neutral: ClassVar[dict[str, float]] = {"m": 1.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with a soil whose strength is reduced to the strength of the interface between rim and
        sand.
        """
        soil = contact.soil
        # The tangent of phi is scaled, not the angle: the friction force is proportional to the tangent.
        phi = ca.atan(self.m * ca.tan(soil.phi))
        return contact._replace(soil=soil.replace(phi=phi, c=self.m * soil.c))
