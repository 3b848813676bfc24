"""Lugs that bite the more the wheel slips: sand held between them shears on sand, where a smooth rim slides."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect

STEEPEST = math.tan(math.radians(60.0))
"""Tangent of the greatest friction angle of a `Soil`."""


@dataclass(frozen=True)
class LugGrip(Effect):
    """tan phi <- g tan phi, c <- g c, g = 1 + (h_l / h_g) max(S, 0): the strength that the rim brings to bear.

    What slides between lugs and sand is a smooth rim's friction where the rim rolls; as the lugs move through the sand
    they shear it in itself. Braked wheels of one sand, with 5 mm lugs and without, pull alike within 0.6 N of 7 to 24
    N, and so they do rolling; driving, lugs give 0.15 S of the load more. With h_l = 5 mm and S = 1 the grip that is
    found, 26 deg, comes near the sand's angle of repose, 29 deg. Limit: lugs of other heights were not measured; g is a
    straight line in h_l, and lugs of twice h_g or more bite harder than sand can.
    Source: derived here, new, from four measured sets; rims that slide before the sand shears: Potyondy, Geotechnique
    11 (1961) 339. Differs from the paper: smooth wheels.
    """

    title: ClassVar[str] = "grip of lugs"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "lugs shear the sand in itself the more the wheel slips"
    h_l: Scalar = quantity(0.005, "m", "assumed: 1 to 5 mm on a wheel of this size", 0.0, 0.05, "h_l")
    h_g: Scalar = quantity(0.01, "m", "measured sets of 5 mm lugs (studies/wheel_laws.py)", 1e-3, 1.0, "h_g")
    neutral: ClassVar[dict[str, float]] = {"h_l": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on sand as strong as the lugs find it."""
        soil, grip = contact.soil, 1.0 + self.h_l / self.h_g * ca.fmax(contact.S, 0.0)
        phi = ca.atan(ca.fmin(grip * ca.tan(soil.phi), STEEPEST))
        return contact._replace(soil=soil.replace(phi=phi, c=grip * soil.c))
