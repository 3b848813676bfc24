"""Lugs dig: their pockets carry sand back, and the wheel runs in the trench that they cut."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect, State

TOUCH = 1e-4
"""Sinkage [m] from which lugs cut at full rate: none in the air."""
STANDING = 1e-4
"""Travel speed [m/s] that keeps the way per travel finite where the wheel stands."""


@dataclass(frozen=True)
class LugExcavation(Effect):
    """L dD/dt = E h_l max(r omega - V, 0) (1 - 2 D / r) - D V; h <- max(h - D, 0).

    Pockets of depth h_l move back past the ground at r omega - V and carry off a layer of E h_l; fresh ground comes in
    at V, the speed over the ground, so at constant slip D = E h_l S / (1 - S), levelling off towards r / 2: nothing at
    S = 0, a trench that deepens without end but the wheel's where V = 0. The wheel runs on the trench's bottom at
    constant height and pays there for pressing the bottom alone; where the trench becomes shallower it is lifted, and
    pays the lift, f_t = -f_n max(-dD/dt, 0) / v. What lifting the carried sand costs (gamma b D h, some mN) is left
    out.
    Source: conservation of volume, with E = 1 where pockets are full; that lugs dig: Ding et al., J. Terramechanics 48
    (2011) 27. Differs from the paper: smooth wheels, and no digging.
    """

    title: ClassVar[str] = "lugs that dig"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "lugs carry sand back, and the wheel runs in the trench they cut"
    h_l: Scalar = quantity(0.003, "m", "assumed: 1 to 5 mm on a wheel of this size", 0.0, 0.05, "h_l")
    filled: Scalar = quantity(1.0, "", "full pockets; one measured wheel: 0.7 (studies/wheel_laws.py)", 0.0, 2.0, "E")
    length: Scalar = quantity(0.066, "m", "assumed: that of SlipSoftening", 1e-3, 1.0, "L")
    states: ClassVar[tuple[State, ...]] = (State("cut"),)
    neutral: ClassVar[dict[str, float]] = {"h_l": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on the bottom of the trench."""
        return contact._replace(h=ca.fmax(contact.h - x[0], 0.0), trench=contact.trench + x[0])

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what the way out of the trench costs."""
        v = contact.v_x
        rise = ca.fmax(-self.rate(contact, load, x)[0], 0.0) * v / (v * v + STANDING**2)
        return Load(f_t=-load.f_n * rise)

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return dD/dt."""
        V = contact.travel
        passing = V - ca.fabs(contact.v_x) + contact.v_x
        cut = self.h_l * self.filled * ca.fmax(contact.rim - passing, 0.0) * ca.fmin(contact.h / TOUCH, 1.0)
        return ((cut * (1.0 - 2.0 * x[0] / contact.wheel.r) - x[0] * V) / self.length,)
