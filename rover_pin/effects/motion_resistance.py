"""A resistance that opposes motion, for traction forms that leave compaction out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.quantity import quantity


@dataclass(frozen=True)
class MotionResistance(Effect):
    """f_t = -R f_n v / sqrt(v^2 + v_0^2): a fraction R of the load, against the travel.

    Eq (7) holds the compaction resistance as a force that pushes even a parked rover backwards; the torque and gross
    forms have none, and would run at S < 0 on the flat. R is chosen so that the flat is driven at a stated slip.
    Source: assumed (the paper's torque-derived factor has no such term).
    """

    R: Scalar = quantity(0.028, "", "assumed: F(S = 0.05) of the torque form with Table 1", 0.0, 1.0, "R")
    v_0: Scalar = quantity(0.005, "m/s", "assumed: a tenth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    neutral: ClassVar[dict[str, float]] = {"R": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance."""
        sense = contact.v_x / ca.sqrt(contact.v_x * contact.v_x + self.v_0 * self.v_0)
        return Load(f_t=-self.R * load.f_n * sense)
