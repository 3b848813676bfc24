"""Friction in the pivots of the suspension."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Body, BodyEffect, Push

MIN_RATE_RATIO = 1e-9
"""Smallest x in tanh(x) / x, which avoids 0 / 0. The relative error is far below round-off."""


@dataclass(frozen=True)
class PivotFriction(BodyEffect):
    """The joints of the suspension, rockers and bogies alike, resist turning with Coulomb and viscous friction.

        torque = -tau_c tanh(q' / w_s) - b q'

    q' is the rate of the joint. Below the rate w_s the Coulomb part tau_c is viscous too: a loaded pivot creeps at the
    rate w_s load / tau_c instead of holding.

    Source: Coulomb and viscous friction, whose parts are named by Armstrong-Helouvry, Dupont and Canudas de Wit,
    Automatica 30 (1994) 1083, with the sign smoothed by tanh; the sizes are assumed. Differs from the paper: its pivots
    turn freely.
    """

    title: ClassVar[str] = "friction in the pivots"
    meaning: ClassVar[str] = "the suspension's pivots resist turning"
    tau_c: Scalar = quantity(0.03, "N m", "assumed: bushings and cables of a 6 kg rover", 0.0, 10.0, "tau_c")
    b: Scalar = quantity(0.01, "N m s/rad", "assumed", 0.0, 100.0, "b")
    w_s: Scalar = quantity(0.02, "rad/s", "assumed: slow compared with 0.5 rad/s over a bump", 1e-4, 10.0, "w_s")
    only_resists: ClassVar[bool] = True
    in_pivots: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"tau_c": 0.0, "b": 0.0}

    def push(self, body: Body) -> Push:
        """Return the friction torque of each suspension joint.

        The torque is a positive factor that depends on the known rate at the start of the step, times the rate that the
        implicit step solves for.
        """
        torques = []
        for known_rate, rate in zip(body.known_rates, body.rates, strict=True):
            # tanh(x) / x at the known rate is positive, so that the implicit step only ever slows the joint down.
            x = ca.sqrt((known_rate / self.w_s) ** 2 + MIN_RATE_RATIO**2)
            torques.append(-(self.tau_c / self.w_s * ca.tanh(x) / x + self.b) * rate)
        return Push(joints=tuple(torques))
