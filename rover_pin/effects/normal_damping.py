"""Soil that is pushed in gives back less: damping of the normal stress with the approach speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.quantity import quantity


@dataclass(frozen=True)
class NormalDamping(Effect):
    """sigma -> sigma max(0, 1 + d dh/dt): no force in tension, none at rest.

    Source: Hunt and Crossley, J. Applied Mechanics 42 (1975) 440. Differs from the paper: it has no normal dissipation,
    and a rover dropped by 12 mm then bounces for seconds; travel times do not depend on d between 3 and 30 s/m.
    """

    d: Scalar = quantity(10.0, "s/m", "assumed: a 12 mm drop settles at once", 0.0, 1e3, "d")
    neutral: ClassVar[dict[str, float]] = {"d": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Scale the soil's stiffness."""
        factor = ca.fmax(0.0, 1.0 + self.d * contact.v_n)
        soil = contact.soil
        return contact._replace(soil=soil.replace(k_1=soil.k_1 * factor, k_2=soil.k_2 * factor))
