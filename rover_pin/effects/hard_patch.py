"""A stretch of the ground that is firmer, or looser, than the rest."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect

EDGE = 0.01
"""Width of an edge of the patch [m] (assumed): from 12 % to 88 % of the change."""
STEEPEST = math.radians(60.0)


@dataclass(frozen=True)
class HardPatch(Effect):
    """k_1, k_2 <- (1 + g w) (k_1, k_2), k <- k / (1 + g_k w), phi <- phi + dphi w between x_from and x_from + length.

    w = (tanh(2 (x - x_from) / EDGE) - tanh(2 (x - x_from - length) / EDGE)) / 2, with x of the wheel's centre in the
    world: a band across the bed. phi is kept within 0 and 60 deg. Source: assumed form; that compaction raises
    stiffness and friction together: Wong, Theory of Ground Vehicles. Differs from the paper: its soil is everywhere
    the same.
    """

    title: ClassVar[str] = "patch of other soil"
    family: ClassVar[str] = "ground"
    meaning: ClassVar[str] = "a stretch of the ground is firmer, or looser, than the rest"
    g: Scalar = quantity(1.0, "", "assumed: twice as stiff", -0.9, 100.0, "g")
    g_k: Scalar = quantity(1.0, "", "assumed: shear within half the length", -0.9, 100.0, "g_k")
    dphi: Scalar = quantity(math.radians(2.0), "rad", "assumed: 2 deg", -math.pi / 6, math.pi / 6, "dphi")
    x_from: Scalar = quantity(0.5, "m", "where it begins; no default is better than another", -1e4, 1e4, "x_from")
    length: Scalar = quantity(0.3, "m", "assumed: a wheelbase or less", 0.0, 1e4, "length")
    neutral: ClassVar[dict[str, float]] = {"g": 0.0, "g_k": 0.0, "dphi": 0.0}
    unpaid: ClassVar[bool] = True
    places: ClassVar[tuple[str, ...]] = ("x_from", "length")

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on the soil at its place."""
        soil, inside = contact.soil, self.share(contact.x)
        stiffer = 1.0 + self.g * inside
        phi = ca.fmax(0.0, ca.fmin(STEEPEST, soil.phi + self.dphi * inside))
        k = soil.k / (1.0 + self.g_k * inside)
        return contact._replace(soil=soil.replace(k_1=stiffer * soil.k_1, k_2=stiffer * soil.k_2, k=k, phi=phi))

    def share(self, x: Scalar) -> Scalar:
        """Return w, how far x [m] is inside: 0 to 1."""
        begin, end = (2.0 * (x - edge) / EDGE for edge in (self.x_from, self.x_from + self.length))
        return 0.5 * (ca.tanh(begin) - ca.tanh(end))
