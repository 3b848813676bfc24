"""Side force of a wheel that is pushed or steered across its plane."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.stress import mobilised_both_ways

MIN_RESERVE = 0.05
"""Smallest fraction of the contact's shear strength that remains for the side force, however large the tangential force
is. It keeps the square root smooth."""


@dataclass(frozen=True)
class SideShear(Effect):
    """The soil resists a wheel that is pushed or steered across its plane, with the shear strength that f_t leaves
    unused.

        f_y = -sgn(j_y) scale sqrt(T^2 - f_t^2) (1 - exp(-|j_y| / k)),   T = c A + f_n tan phi

    T is the shear strength of the contact (Mohr-Coulomb) with the area A = r b (theta_1 - theta_2), so that the
    resultant of f_t and f_y obeys Eq (3). j_y = S_y r (theta_1 - theta_2) / 2 is the sideways shear displacement in the
    middle of the contact. The lever arm of f_y about the vertical is the distance r sin((theta_1 + theta_2) / 2) of
    this middle from the axle.

    Source: Yoshida and Ishigami, IROS 2004 (lateral shear by Janosi's law, which they integrate over the contact; here
    it is taken in the middle). Differs from the paper: it has no side force.
    """

    title: ClassVar[str] = "side shear"
    family: ClassVar[str] = "side wall"
    meaning: ClassVar[str] = "the soil resists a wheel that is pushed across its plane"
    scale: Scalar = quantity(1.0, "", "assumed: sideways shear like shear along the heading", 0.0, 5.0, "scale")
    neutral: ClassVar[dict[str, float]] = {"scale": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the load of the shear across the wheel: the side force f_y [N], and its moment about the vertical [N
        m].
        """
        wheel, soil = contact.wheel, contact.soil
        theta_1, theta_2 = SinkageAngles().angles(contact.h, wheel, soil)
        length = wheel.r * (theta_1 - theta_2)
        # Shear displacement across the wheel and shear strength of the contact area, both at the angles of the sinkage.
        j_y = contact.S_y * length / 2.0
        strength = soil.c * wheel.b * length + load.f_n * ca.tan(soil.phi)
        # The shear builds up with the sideways displacement, as along the heading.
        grip = mobilised_both_ways(j_y / soil.k)
        # Strength that f_t uses is not available for f_y.
        reserve = ca.fmax(strength * strength - load.f_t * load.f_t, (MIN_RESERVE * strength) ** 2 + 1e-24)
        f_y = -self.scale * ca.sqrt(reserve) * grip
        return Load(f_y=f_y, moment_z=f_y * wheel.r * ca.sin((theta_1 + theta_2) / 2.0))
