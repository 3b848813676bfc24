"""The side force of a wheel that is pushed or steered across its plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.quantity import quantity
from rover_pin.soil.angles import SinkageAngles


@dataclass(frozen=True)
class SideShear(Effect):
    """f_y = -sgn(j_y) scale (c A / f_n + tan phi) f_n (1 - exp(-|j_y| / k)), j_y = S_y r (theta_1 - theta_2) / 2.

    j_y is the sideways shear displacement half-way through the contact, A = r b (theta_1 - theta_2) its area, with the
    soil's own k, c and phi. Source: Yoshida and Ishigami, IROS 2004 (lateral shear by Janosi's law; there the shear is
    integrated over the contact, here taken at its middle). Differs from the paper: it has no side force at all.
    """

    scale: Scalar = quantity(1.0, "", "assumed: the soil shears sideways as it does along", 0.0, 5.0, "scale")
    neutral: ClassVar[dict[str, float]] = {"scale": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the side force."""
        wheel, soil = contact.wheel, contact.soil
        theta_1, theta_2 = SinkageAngles().angles(contact.h, wheel, soil)
        length = wheel.r * (theta_1 - theta_2)
        j_y = contact.S_y * length / 2.0
        strength = soil.c * wheel.b * length + load.f_n * ca.tan(soil.phi)
        grip = ca.if_else(j_y < 0.0, ca.expm1(j_y / soil.k), -ca.expm1(-j_y / soil.k))
        return Load(f_y=-self.scale * strength * grip)
