"""A differential that gives way: a shaft that twists, gears with play."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Body, BodyEffect, Push

STIFFEST = 1e-6
"""Least compliance of a differential that is not rigid [rad/(N m)]: it twists by 1e-6 rad under 1 N m."""


@dataclass(frozen=True)
class DifferentialCompliance(BodyEffect):
    """torque = -(o + T_d o') / compliance on either rocker, o = e outside of +-backlash / 2, e = theta_s1 + theta_s2.

    o = max(|e| - backlash / 2, 0) sign(e); within the play the rockers are free. Both parameters at 0 are the rigid
    differential; towards 0 the drive goes towards that. Source: Kelvin-Voigt shaft behind a dead zone (Nordin and
    Gutman, Automatica 38 (2002) 1633); sizes assumed. Differs from the paper: there theta_s1 = -theta_s2.
    """

    title: ClassVar[str] = "soft differential"
    meaning: ClassVar[str] = "the differential between the rockers gives way"
    compliance: Scalar = quantity(0.005, "rad/(N m)", "assumed: 0.3 deg under 1 N m", 0.0, 1.0, "1/k")
    backlash: Scalar = quantity(0.01, "rad", "assumed: 0.6 deg, a small bevel gear", 0.0, 0.5, "backlash")
    relaxation: Scalar = quantity(0.01, "s", "assumed: the twist dies out within a step or two", 1e-4, 1.0, "T_d")
    neutral: ClassVar[dict[str, float]] = {"compliance": 0.0, "backlash": 0.0}

    @property
    def frees_differential(self) -> bool:
        """Whether there is anything to give way."""
        return bool(self.compliance > 0.0 or self.backlash > 0.0)

    def push(self, body: Body) -> Push:
        """Return the torque on either rocker; none where the differential is rigid, and holds by itself."""
        half, over = 0.5 * self.backlash, self._over(body)
        torque = -(over + self.relaxation * body.twist_rate) / ca.fmax(self.compliance, STIFFEST)
        acts = ca.logic_and(self.compliance + self.backlash > 0.0, ca.fabs(body.twist) > half)
        return Push(differential=ca.if_else(acts, torque, 0.0))

    def stored_energy(self, body: Body) -> Scalar:
        """Return the energy of the twisted shaft, o^2 / (2 compliance)."""
        elastic = 0.5 * self._over(body) ** 2 / ca.fmax(self.compliance, STIFFEST)
        return ca.if_else(self.compliance + self.backlash > 0.0, elastic, 0.0)

    def _over(self, body: Body) -> Scalar:
        """Return by how much the twist is beyond the play [rad]."""
        half = 0.5 * self.backlash
        return body.twist - ca.fmax(-half, ca.fmin(half, body.twist))
