"""Sand that is not one power law: the sinkage exponent changes with depth, and so the stiffness with load."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.effects.slip_sinkage import HIGHEST_EXPONENT, LOWEST_EXPONENT


@dataclass(frozen=True)
class LoadExponent(Effect):
    """n <- min(max(n + n_h h / b, 0.05), 3): the exponent of Eq (4) follows the sinkage, the first term of a series.

    A loaded wheel sinks further, so this is how wheels of one soil under different loads give different exponents. n_h
    > 0 softens what lies deeper (h < b). Source: assumed form. Differs from the paper: it holds n.
    """

    title: ClassVar[str] = "exponent that changes with depth"
    family: ClassVar[str] = "load and depth"
    meaning: ClassVar[str] = "the sand stiffens with depth otherwise than by one power law"
    n_h: Scalar = quantity(0.5, "", "assumed: n differs by 0.05 to 0.1 at h / b = 0.1 to 0.2", -1.0, 2.0, "n_h")
    neutral: ClassVar[dict[str, float]] = {"n_h": 0.0}
    unpaid: ClassVar[bool] = True

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the exponent of its depth."""
        n = contact.soil.n + self.n_h * contact.h / contact.wheel.b
        n = ca.fmin(ca.fmax(n, LOWEST_EXPONENT), HIGHEST_EXPONENT)
        return contact._replace(soil=contact.soil.replace(n=n))
