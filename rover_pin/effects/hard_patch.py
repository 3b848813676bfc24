"""A band of the ground whose soil is firmer or looser than the rest."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect

EDGE = 0.01
"""Width [m] of each edge of the band (assumed). Within it, the change of the soil rises from 12 % to 88 %."""
MAX_PHI = math.radians(60.0)
"""Largest friction angle of a `Soil` [rad]; the soil in the band cannot exceed it."""


@dataclass(frozen=True)
class HardPatch(Effect):
    """The soil in a band across the bed, from x_from to x_from + length, is firmer or looser than the rest.

        k_1, k_2 <- (1 + g w) (k_1, k_2),   k <- k / (1 + g_k w),   phi <- phi + dphi w,
        w = (tanh(2 (x - x_from) / EDGE) - tanh(2 (x - x_from - length) / EDGE)) / 2.

    The weight w is 1 inside the band and 0 outside, with smooth edges; x is the position of the wheel's centre in the
    world. The pressure moduli k_1 and k_2, the shear displacement k and the friction angle phi change; phi stays within
    0 and 60 deg.

    Source: assumed form; Wong, Theory of Ground Vehicles, for the fact that compaction raises stiffness and friction
    together. Differs from the paper: its soil is uniform.
    """

    title: ClassVar[str] = "patch of other soil"
    family: ClassVar[str] = "ground"
    meaning: ClassVar[str] = "a stretch of the ground is firmer, or looser, than the rest"
    g: Scalar = quantity(1.0, "", "assumed: twice as stiff", -0.9, 100.0, "g")
    g_k: Scalar = quantity(1.0, "", "assumed: shear within half the length", -0.9, 100.0, "g_k")
    dphi: Scalar = quantity(math.radians(2.0), "rad", "assumed: 2 deg", -math.pi / 6, math.pi / 6, "dphi")
    x_from: Scalar = quantity(0.5, "m", "beginning of the band; the default is arbitrary", -1e4, 1e4, "x_from")
    length: Scalar = quantity(0.3, "m", "assumed: a wheelbase or less", 0.0, 1e4, "length")
    neutral: ClassVar[dict[str, float]] = {"g": 0.0, "g_k": 0.0, "dphi": 0.0}
    unpaid: ClassVar[bool] = True
    places: ClassVar[tuple[str, ...]] = ("x_from", "length")

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the soil at the wheel's position: the band's soil inside the band, the unchanged soil
        outside.
        """
        # Stiffness and friction change together, as compaction changes them; phi stays within the bounds of a soil.
        soil, inside = contact.soil, self.share(contact.x)
        stiffer = 1.0 + self.g * inside
        phi = ca.fmax(0.0, ca.fmin(MAX_PHI, soil.phi + self.dphi * inside))
        k = soil.k / (1.0 + self.g_k * inside)
        return contact._replace(soil=soil.replace(k_1=stiffer * soil.k_1, k_2=stiffer * soil.k_2, k=k, phi=phi))

    def share(self, x: Scalar) -> Scalar:
        """Return the weight of the band's soil at the position x [m]: 1 inside the band, 0 outside, with
        smooth edges.
        """
        # Two smooth steps, up at the beginning and down at the end of the band.
        begin, end = (2.0 * (x - edge) / EDGE for edge in (self.x_from, self.x_from + self.length))
        return 0.5 * (ca.tanh(begin) - ca.tanh(end))
