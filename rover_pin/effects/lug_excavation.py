"""Lugs that dig: their pockets carry sand backwards, and the wheel runs in the trench that they cut."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect, State

TOUCH = 1e-4
"""Minimum sinkage [m] of lugs that cut at their full rate. Below this sinkage, the rate falls linearly, to 0 without
contact."""
MIN_TRAVEL_SPEED = 1e-4
"""Minimum travel speed [m/s] for the full rise of the wheel per metre of travel. Below this speed, the rise is reduced,
so that it stays finite at standstill."""


@dataclass(frozen=True)
class LugExcavation(Effect):
    """Lugs dig: the pockets between them carry sand backwards, and the wheel runs on the bottom of the trench that they
    cut, of depth D.

        L dD/dt = E h_l max(r omega - V, 0) (1 - 2 D / r) - D V,
        h <- max(h - D, 0),   f_t = -f_n max(-dD/dt, 0) / v.

    Pockets of depth h_l move backwards over the ground at r omega - V and carry away a layer of thickness E h_l, while
    fresh ground arrives at the speed V of the wheel over the ground. At constant slip D = E h_l S / (1 - S), which
    levels off towards r / 2. There is no trench at S = 0, and at V = 0 the trench deepens up to the limit of the wheel.
    The wheel runs at constant height on the bottom of the trench and pays there for compacting the bottom only. If the
    trench becomes shallower, the wheel is lifted and pays for the lift by f_t. The work of lifting the carried sand
    (gamma b D h, some mN) is neglected.

    Source: conservation of volume, with E = 1 for full pockets; Ding et al., J. Terramechanics 48 (2011) 27, for the
    fact that lugs dig. Differs from the paper: its wheels are smooth, and it has no digging.
    """

    title: ClassVar[str] = "lugs that dig"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "lugs carry sand back, and the wheel runs in the trench they cut"
    h_l: Scalar = quantity(0.003, "m", "assumed: 1 to 5 mm on a wheel of this size", 0.0, 0.05, "h_l")
    filled: Scalar = quantity(1.0, "", "full pockets; one measured wheel: 0.7 (studies/wheel_laws.py)", 0.0, 2.0, "E")
    length: Scalar = quantity(0.066, "m", "assumed: the length L of SlipSoftening", 1e-3, 1.0, "L")
    states: ClassVar[tuple[State, ...]] = (State("cut"),)
    neutral: ClassVar[dict[str, float]] = {"h_l": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact of a wheel on the bottom of the trench that its lugs cut: the sinkage is measured from
        this bottom.
        """
        return contact._replace(h=ca.fmax(contact.h - x[0], 0.0), trench=contact.trench + x[0])

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance f_t [N] of a wheel that is lifted because its trench becomes shallower."""
        v = contact.v_x
        # Rise per metre of travel, written with v / (v^2 + small^2), so that it stays finite at rest and has the sign
        # of v.
        rise = ca.fmax(-self.rate(contact, load, x)[0], 0.0) * v / (v * v + MIN_TRAVEL_SPEED**2)
        return Load(f_t=-load.f_n * rise)

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the rate [m/s] at which the trench under the wheel becomes deeper."""
        V = contact.travel
        # Speed of the ground past the lugs: the whole travel, with the sign of the travel along the wheel.
        passing = V - ca.fabs(contact.v_x) + contact.v_x
        # Only lugs that move faster than the ground below them carry sand away, and only in contact with it.
        cut = self.h_l * self.filled * ca.fmax(contact.rim - passing, 0.0) * ca.fmin(contact.h / TOUCH, 1.0)
        return ((cut * (1.0 - 2.0 * x[0] / contact.wheel.r) - x[0] * V) / self.length,)
