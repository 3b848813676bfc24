"""The wheels that follow run in soil that those before have pressed."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class MultiPass(Effect):
    """k_1, k_2 <- (1 + p g) (k_1, k_2), k <- k / (1 + p g_k), p = wheels of this side that have passed before.

    Pressed soil is stiffer, and reaches its shear strength sooner. p follows the direction of travel: the rear wheels
    are first in reverse. Source: assumed form, linear in the passes; that stiffness and shear modulus of a rut grow
    with repeated passes: Wong, Theory of Ground Vehicles. Differs from the paper: its wheels all meet fresh soil.
    Differs from a rut: the ground is not lowered for those that follow, and a wheel steered out of the track still
    counts as following; in the torque and gross forms R stays, where compaction would fall (15 % for n = 1, 2 x 30 %).
    """

    title: ClassVar[str] = "multi-pass"
    family: ClassVar[str] = "ground"
    meaning: ClassVar[str] = "the wheels that follow run in soil that those ahead have pressed"
    stiffening: Scalar = quantity(0.3, "", "assumed: 30 % a pass", 0.0, 5.0, "g")
    shear_stiffening: Scalar = quantity(0.3, "", "assumed: 30 % a pass", 0.0, 5.0, "g_k")
    neutral: ClassVar[dict[str, float]] = {"stiffening": 0.0, "shear_stiffening": 0.0}
    unpaid: ClassVar[bool] = True

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on the soil that the wheels before have left."""
        soil, stiffer = contact.soil, 1.0 + contact.axle * self.stiffening
        k = soil.k / (1.0 + contact.axle * self.shear_stiffening)
        return contact._replace(soil=soil.replace(k_1=stiffer * soil.k_1, k_2=stiffer * soil.k_2, k=k))
