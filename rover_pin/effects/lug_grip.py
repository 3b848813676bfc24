"""Lugs that grip more as the wheel slips: sand between the lugs shears on sand, while a smooth rim slides."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect

MAX_TAN_PHI = math.tan(math.radians(60.0))
"Tangent of the largest friction angle of a `Soil`, which the grip of lugs cannot exceed."


@dataclass(frozen=True)
class LugGrip(Effect):
    """Lugs grip more the more the wheel slips: the strength that the rim mobilises grows by the factor g.

        tan phi <- g tan phi,   c <- g c,   g = 1 + (h_l / h_g) max(S, 0)

    A rolling rim slides on the sand between its lugs with the friction of a smooth rim. As lugs of height h_l move
    through the sand, they shear the sand itself, so that the strength grows with slip. The law is fitted to four
    measured sets of wheels with and without lugs of 5 mm (`studies/wheel_laws.py`). Limit: lugs of other heights were
    not measured. g is linear in h_l, so that lugs of 2 h_g or more grip more than sand can.

    Source: derived here, new, from four measured sets; Potyondy, Geotechnique 11 (1961) 339, for rims that slide before
    the sand shears. Differs from the paper: its wheels are smooth.
    """

    title: ClassVar[str] = "grip of lugs"
    family: ClassVar[str] = "grip"
    meaning: ClassVar[str] = "lugs shear the sand itself, the more the wheel slips"
    h_l: Scalar = quantity(0.005, "m", "assumed: 1 to 5 mm on a wheel of this size", 0.0, 0.05, "h_l")
    h_g: Scalar = quantity(0.01, "m", "measured sets of 5 mm lugs (studies/wheel_laws.py)", 1e-3, 1.0, "h_g")
    neutral: ClassVar[dict[str, float]] = {"h_l": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with sand of the strength that the lugs mobilise at the present slip."""
        # No lug grips at S <= 0: there a rolling rim slides on the sand between its lugs.
        soil, grip = contact.soil, 1.0 + self.h_l / self.h_g * ca.fmax(contact.S, 0.0)
        phi = ca.atan(ca.fmin(grip * ca.tan(soil.phi), MAX_TAN_PHI))
        return contact._replace(soil=soil.replace(phi=phi, c=grip * soil.c))
