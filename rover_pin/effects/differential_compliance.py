"""A differential between the rockers that is not rigid: its shaft twists, and its gears have backlash."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Body, BodyEffect, Push

MIN_COMPLIANCE = 1e-6
"""Smallest compliance [rad/(N m)] as the divisor of the torque: such a differential twists by 1e-6 rad under 1 N m. A
smaller value would divide by almost zero."""


@dataclass(frozen=True)
class DifferentialCompliance(BodyEffect):
    """The differential between the rockers is not rigid: its shaft twists under load, and its gears have backlash.

        torque on each rocker = -(o + T_d do/dt) / compliance,
        o = e - clip(e, -backlash / 2, backlash / 2),   e = theta_s1 + theta_s2.

    e is the sum of both rocker angles, which a rigid differential holds at 0, and o is the part of e beyond the
    backlash: the twist of the shaft. Within the backlash the rockers are free. T_d (`relaxation`) damps the twist. With
    compliance and backlash at 0 the differential is rigid, and a drive approaches the drive with a rigid differential
    as both approach 0.

    Source: Kelvin-Voigt shaft behind a dead zone (Nordin and Gutman, Automatica 38 (2002) 1633); the sizes are assumed.
    Differs from the paper: there theta_s1 = -theta_s2.
    """

    title: ClassVar[str] = "soft differential"
    meaning: ClassVar[str] = "the differential between the rockers twists or has backlash"
    compliance: Scalar = quantity(0.005, "rad/(N m)", "assumed: 0.3 deg under 1 N m", 0.0, 1.0, "1/k")
    backlash: Scalar = quantity(0.01, "rad", "assumed: 0.6 deg, a small bevel gear", 0.0, 0.5, "backlash")
    relaxation: Scalar = quantity(0.01, "s", "assumed: the twist dies out within a step or two", 1e-4, 1.0, "T_d")
    neutral: ClassVar[dict[str, float]] = {"compliance": 0.0, "backlash": 0.0}

    @property
    def frees_differential(self) -> bool:
        """Whether the differential has compliance or backlash, so that its torque replaces the rigid constraint between
        the rockers.
        """
        return bool(self.compliance > 0.0 or self.backlash > 0.0)

    def push(self, body: Body) -> Push:
        """Return the torque of the differential on each rocker.

        The torque is zero within the backlash. It is also zero for a rigid differential, which the simulator holds by a
        constraint.
        """
        # A Kelvin-Voigt shaft: a spring and a damper act on the twist beyond the backlash.
        half, over = 0.5 * self.backlash, self._over(body)
        torque = -(over + self.relaxation * body.twist_rate) / ca.fmax(self.compliance, MIN_COMPLIANCE)
        # Without compliance and backlash the rigid constraint acts, and the spring torque must vanish.
        acts = ca.logic_and(self.compliance + self.backlash > 0.0, ca.fabs(body.twist) > half)
        return Push(differential=ca.if_else(acts, torque, 0.0))

    def stored_energy(self, body: Body) -> Scalar:
        """Return the elastic energy of the twisted shaft [J]: o^2 / (2 compliance), with the twist o beyond the
        backlash [rad].
        """
        elastic = 0.5 * self._over(body) ** 2 / ca.fmax(self.compliance, MIN_COMPLIANCE)
        return ca.if_else(self.compliance + self.backlash > 0.0, elastic, 0.0)

    def _over(self, body: Body) -> Scalar:
        """Return the part of the sum of both rocker angles that exceeds the backlash [rad]. The shaft is twisted by
        this part.
        """
        half = 0.5 * self.backlash
        return body.twist - ca.fmax(-half, ca.fmin(half, body.twist))
