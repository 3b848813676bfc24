"""A braked wheel ploughs: part of the sand that it meets is pushed ahead instead of carrying it."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar, fading
from rover_pin.effects.effect import Effect, State
from rover_pin.effects.slip_sinkage import rut_cost
from rover_pin.effects.slip_softening import approach, lift, loosen, share_of, softer
from rover_pin.soil.passive import passive
from rover_pin.soil.slip import TURNED, positive_part

LOCKED, SHARPNESS = 0.2, 16
"""Least 1 + S, rounded: a locked wheel stands on sand like a plate, and ploughs as one at S = -0.8 (assumed)."""
FOREMOST = 0.9
"""Share of the arc in front of the axle that is lost at most."""


@dataclass(frozen=True)
class Ploughing(Effect):
    """p = 1 - (1 + S)^a_b for S < 0, the share of the sand pushed ahead; k_1, k_2 <- (1 - p) (k_1, k_2).

    A wheel meets sand at v and its rim takes on r omega = (1 + S) v: with a_b = 1 what is left over, p = -S, is pushed
    ahead. Three things follow, each with its own number. The rest carries the load: the stiffness falls by (1 - p). The
    heap pushes back like a wall as deep as the wheel, f_t = -B p b D_1 (c h + D_2 gamma h^2 / 2). The wheel leans on
    it and loses the rear of its contact: lambda <- max(lambda - e_b p, -0.9), theta_2 alike, beyond 0 to in front of
    the axle. -ln(1 + S) is followed over the way L; the deeper rut pays by `rut_cost`, and the lift where the skid ends
    as in `SlipSoftening`.

    Source: an assumed form, compared with others in studies/wheel_laws.py; earth pressure: Hegedus (1960); that a
    skidding wheel separates from the soil in front of its bottom: Wong and Reece, J. Terramechanics 4(2) (1967) 7.
    Differs from the paper: driving laws are used for S < 0.
    """

    title: ClassVar[str] = "ploughing"
    family: ClassVar[str] = "resistance"
    meaning: ClassVar[str] = "a braked wheel pushes part of the sand ahead instead of standing on it"
    a_b: Scalar = quantity(1.0, "", "conservation of volume; 0.6 to 1 fitted on one measured wheel", 0.0, 4.0, "a_b")
    share: Scalar = quantity(1.0, "", "assumed: the heap is as wide as the wheel", 0.0, 5.0, "B")
    e_b: Scalar = quantity(0.4, "", "one measured wheel (studies/wheel_laws.py): 0.3 to 0.5", 0.0, 2.0, "e_b")
    gamma: Scalar = quantity(15700.0, "N/m^3", "assumed: loose dry sand, 1600 kg/m^3, on Earth", 0.0, 1e5, "gamma")
    phi_f: Scalar = quantity(math.radians(30.0), "rad", "assumed: Table 1's sand", 0.0, math.radians(60.0), "phi_f")
    length: Scalar = quantity(0.066, "m", "assumed: that of SlipSoftening", 1e-3, 1.0, "L")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    states: ClassVar[tuple[State, ...]] = (State("ploughed"),)
    neutral: ClassVar[dict[str, float]] = {"a_b": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on what is left to carry, without the rear that is lost."""
        contact, lost = loosen(contact, self.a_b * x[0]), self.e_b * self._pushed_share(x[0])
        soil = contact.soil
        ratio = ca.fmax(soil.exit_ratio - lost, -FOREMOST)
        theta_2 = ca.fmin(soil.theta_2 + lost * soil.theta_1, FOREMOST * soil.theta_1)
        return contact._replace(soil=soil.replace(exit_ratio=ratio, theta_2=theta_2))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what the heap, the deeper rut and the way out of it take of the pull."""
        h = ca.fmax(contact.h, 0.0)
        wall = contact.wheel.b * passive(self.phi_f).per_width(h, contact.soil.c, self.gamma)
        up = lift(contact, load, self.a_b * (x[0] - _skid(contact)), self.length)
        heap = self.share * self._pushed_share(x[0]) * wall * self._facing(contact)
        firm = softer(contact, share_of(contact, self.a_b * x[0]))
        return Load(f_t=-heap - up * contact.sense(self.v_0) - rut_cost(contact, firm))

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return d/dt of what -ln(1 + S) has come to."""
        return (approach(contact, _skid(contact) - x[0]) / self.length,)

    def _facing(self, contact: Contact) -> Scalar:
        """Return v / sqrt(v^2 + kappa^2 v_y^2 + u^2), kappa of `against_travel`: the wall faces the heading."""
        v, v_y, u = contact.v_x, TURNED * contact.v_y, fading(contact.rim, self.v_0, 1.0)
        return v / ca.sqrt(v * v + v_y * v_y + u * u)

    def _pushed_share(self, skid: Scalar) -> Scalar:
        return -ca.expm1(-self.a_b * ca.fmax(skid, 0.0))


def _skid(contact: Contact) -> Scalar:
    rolled = 1.0 - positive_part(-contact.S)
    return ca.log((1.0 + LOCKED**SHARPNESS) / (rolled**SHARPNESS + LOCKED**SHARPNESS)) / SHARPNESS
