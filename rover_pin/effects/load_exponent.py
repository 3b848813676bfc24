"""Sand whose pressure does not follow one power law: the sinkage exponent changes with depth."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.effects.slip_sinkage import MAX_EXPONENT, MIN_EXPONENT


@dataclass(frozen=True)
class LoadExponent(Effect):
    """The sinkage exponent n of Eq (4) changes with the depth, for sand whose pressure does not follow one power law.

        n <- min(max(n + n_h h / b, 0.05), 3)

    The law is the first term of a series in the sinkage h over the wheel's width b. A wheel with a larger load sinks
    deeper, so that wheels in one soil show different exponents at different loads. With n_h > 0 the soil is softer at
    depth (for h < b).

    Source: assumed form. Differs from the paper: it holds n constant.
    """

    title: ClassVar[str] = "exponent that changes with depth"
    family: ClassVar[str] = "load and depth"
    meaning: ClassVar[str] = "the pressure in the sand does not follow one power law of the depth"
    n_h: Scalar = quantity(0.5, "", "assumed: n differs by 0.05 to 0.1 at h / b = 0.1 to 0.2", -1.0, 2.0, "n_h")
    neutral: ClassVar[dict[str, float]] = {"n_h": 0.0}
    unpaid: ClassVar[bool] = True

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the sinkage exponent n that holds at the wheel's present sinkage."""
        n = contact.soil.n + self.n_h * contact.h / contact.wheel.b
        # The bounds are those of a soil, because a smaller exponent would make the pressure independent of the depth.
        n = ca.fmin(ca.fmax(n, MIN_EXPONENT), MAX_EXPONENT)
        return contact._replace(soil=contact.soil.replace(n=n))
