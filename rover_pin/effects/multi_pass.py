"""Wheels that run in soil that the wheels in front of them have compacted."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class MultiPass(Effect):
    """A wheel runs in soil that p wheels of its side have compacted before: stiffer soil, in which the shear builds up
    sooner.

        k_1, k_2 <- (1 + p g) (k_1, k_2),   k <- k / (1 + p g_k)

    k_1 and k_2 are the pressure moduli of Eq (4), and k is the shear displacement of Eq (2). g and g_k are their
    growths per pass [-]. p follows the direction of
    travel: in reverse, the rear wheels are first.

    Source: assumed form, linear in the passes; Wong, Theory of Ground Vehicles, for the growth of a rut's stiffness and
    shear modulus with repeated passes. Differs from the paper: all its wheels meet fresh soil. Differs from a rut: the
    ground is not lowered for the wheels that follow, and a wheel that is steered out of the track still counts as
    following. In the forms `torque` and `gross` of the traction law, the motion resistance R is a given
    number, so that it stays constant, although the part of R that compacts the soil would fall (by 15 % for n = 1 and
    two passes of 30 %).
    """

    title: ClassVar[str] = "multi-pass"
    family: ClassVar[str] = "ground"
    meaning: ClassVar[str] = "wheels run in soil that the wheels in front of them have compacted"
    stiffening: Scalar = quantity(0.3, "", "assumed: 30 % a pass", 0.0, 5.0, "g")
    shear_stiffening: Scalar = quantity(0.3, "", "assumed: 30 % a pass", 0.0, 5.0, "g_k")
    neutral: ClassVar[dict[str, float]] = {"stiffening": 0.0, "shear_stiffening": 0.0}
    unpaid: ClassVar[bool] = True

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the soil that the wheels in front have compacted."""
        # `axle` is the number of wheels of this side that ran here before, counted in the direction of travel.
        soil, stiffer = contact.soil, 1.0 + contact.axle * self.stiffening
        k = soil.k / (1.0 + contact.axle * self.shear_stiffening)
        return contact._replace(soil=soil.replace(k_1=stiffer * soil.k_1, k_2=stiffer * soil.k_2, k=k))
