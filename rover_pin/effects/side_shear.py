"""The side force of a wheel that is pushed or steered across its plane."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.stress import mobilised_both_ways

LEAST_SHARE = 0.05
"""Share of the strength that is left for f_y however large f_t is: keeps the root smooth."""


@dataclass(frozen=True)
class SideShear(Effect):
    """f_y = -sgn(j_y) scale sqrt(T^2 - f_t^2) (1 - exp(-|j_y| / k)), T = c A + f_n tan phi.

    j_y = S_y r (theta_1 - theta_2) / 2 is the sideways shear displacement half-way through the contact,
    A = r b (theta_1 - theta_2) its area. What f_t takes of the strength T is not there for f_y, so that the resultant
    obeys Eq (3). The middle, r sin((theta_1 + theta_2) / 2) ahead of the axle, is its arm about the vertical.
    Source: Yoshida and Ishigami, IROS 2004 (lateral shear by Janosi's law; there the shear is integrated over the
    contact, here taken at its middle). Differs from the paper: it has no side force at all.
    """

    title: ClassVar[str] = "side shear"
    family: ClassVar[str] = "side wall"
    meaning: ClassVar[str] = "the soil resists a wheel that is pushed across its plane"
    scale: Scalar = quantity(1.0, "", "assumed: the soil shears sideways as it does along", 0.0, 5.0, "scale")
    neutral: ClassVar[dict[str, float]] = {"scale": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the side force."""
        wheel, soil = contact.wheel, contact.soil
        theta_1, theta_2 = SinkageAngles().angles(contact.h, wheel, soil)
        length = wheel.r * (theta_1 - theta_2)
        j_y = contact.S_y * length / 2.0
        strength = soil.c * wheel.b * length + load.f_n * ca.tan(soil.phi)
        grip = mobilised_both_ways(j_y / soil.k)
        reserve = ca.fmax(strength * strength - load.f_t * load.f_t, (LEAST_SHARE * strength) ** 2 + 1e-24)
        f_y = -self.scale * ca.sqrt(reserve) * grip
        return Load(f_y=f_y, moment_z=f_y * wheel.r * ca.sin((theta_1 + theta_2) / 2.0))
