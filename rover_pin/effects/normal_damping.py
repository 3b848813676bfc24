"""Soil that is pushed in gives back less: damping of the normal stress with the approach speed."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class NormalDamping(Effect):
    """The load so far times max(0, 1 + d dh/dt): no force in tension, the static one at rest, f_t / f_n unchanged.

    Source: Hunt and Crossley, J. Applied Mechanics 42 (1975) 440. Differs from the paper: it has no normal dissipation,
    and a rover dropped by 12 mm then bounces for seconds; travel times do not depend on d between 3 and 30 s/m.
    """

    title: ClassVar[str] = "damping of the soil"
    family: ClassVar[str] = "rate"
    meaning: ClassVar[str] = "the soil gives back less than was pressed into it"
    d: Scalar = quantity(10.0, "s/m", "assumed: a 12 mm drop settles at once", 0.0, 1e3, "d")
    neutral: ClassVar[dict[str, float]] = {"d": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what the approach speed adds to the load so far."""
        extra = ca.fmax(0.0, 1.0 + self.d * contact.v_n) - 1.0
        return Load(*(extra * part for part in load))
