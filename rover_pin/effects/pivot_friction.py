"""Friction in the pivots of the suspension."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Body, BodyEffect, Push

TINY = 1e-9
"""Keeps tanh(x) / x from 0 / 0; its relative error is far below round-off."""


@dataclass(frozen=True)
class PivotFriction(BodyEffect):
    """torque = -tau_c tanh(q' / w_s) - b q' on every joint of the suspension, rockers and bogies alike.

    Below w_s it is viscous: a loaded pivot creeps at the rate w_s load / tau_c instead of holding for ever. Source:
    Coulomb and viscous friction, the sign smoothed by tanh (Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica
    30 (1994) 1083, name its parts); sizes assumed. Differs from the paper: its pivots turn freely.
    """

    title: ClassVar[str] = "friction in the pivots"
    meaning: ClassVar[str] = "the suspension's pivots resist turning"
    tau_c: Scalar = quantity(0.03, "N m", "assumed: bushings and cables of a 6 kg rover", 0.0, 10.0, "tau_c")
    b: Scalar = quantity(0.01, "N m s/rad", "assumed", 0.0, 100.0, "b")
    w_s: Scalar = quantity(0.02, "rad/s", "assumed: slow beside the 0.5 rad/s over a bump", 1e-4, 10.0, "w_s")
    only_resists: ClassVar[bool] = True
    in_pivots: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"tau_c": 0.0, "b": 0.0}

    def push(self, body: Body) -> Push:
        """Return the friction of each joint: a positive factor of the known rate, times the rate."""
        pairs = zip(body.known_rates, body.rates, strict=True)
        return Push(joints=tuple(-(self._factor(known_rate) + self.b) * rate for known_rate, rate in pairs))

    def _factor(self, rate: Scalar) -> Scalar:
        x = ca.sqrt((rate / self.w_s) ** 2 + TINY**2)
        return self.tau_c / self.w_s * ca.tanh(x) / x
