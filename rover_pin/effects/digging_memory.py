"""A hole that a slipping wheel digs, and that stays until the wheel has rolled out of it."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect, State

TOUCH = 1e-4
"""Minimum sinkage [m] of a spinning rim that digs at its full rate. Below this sinkage, the rate falls linearly, to 0
without contact."""


@dataclass(frozen=True)
class DiggingMemory(Effect):
    """A slipping wheel digs a hole of depth D under itself, keeps the hole while it stands, and has to climb out of it.

        dD/dt = c_d max(r omega - v, 0) (1 - D / (d r)) - D v s / L,
        h <- max(h - D, 0),   f_t = -f_n s D / L.

    The ground under the wheel is lower by D. c_d is the fraction of the rim's slip speed r omega - v that deepens the
    hole. D cannot exceed d r, the depth at which the walls fall in as fast as the rim throws sand out. At constant slip
    D = d r q / (d r + q) with q = c_d L S / (1 - S). The wheel climbs out of the hole over the travel L. s = v /
    sqrt(v^2 + u^2) is the sense of travel, with the small speed u of `contact.fading`: a wheel that spins in its hole
    and cannot climb does not move and does not creep out.

    The resistance has the power f_n D v s / L, which is exactly the power of lifting the load out of the hole, in every
    traction form and at every speed. No compaction is counted twice. In contrast to `SlipSinkage`, the hole depends on
    the history of the slip and stays during a stop. L has a lower bound, because a hole that the wheel leaves within
    less than about r / 2 would be a drag without depth.

    Source: assumed form; conservation of energy. Differs from the paper: it states that digging is not modelled.
    """

    title: ClassVar[str] = "digging"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "a slipping wheel digs a hole and has to climb out of it"
    c_d: Scalar = quantity(0.05, "", "assumed: a twentieth of the thrown sand deepens the hole", 0.0, 1.0, "c_d")
    length: Scalar = quantity(0.04, "m", "assumed: a contact length of travel leaves the hole", 0.02, 1.0, "L")
    deepest: Scalar = quantity(0.5, "", "assumed: half a radius, where a wheel counts as buried", 0.01, 1.0, "d")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    states: ClassVar[tuple[State, ...]] = (State("dug"),)
    neutral: ClassVar[dict[str, float]] = {"c_d": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact of a wheel on the bottom of its hole: the sinkage is measured from this bottom."""
        return contact._replace(h=ca.fmax(contact.h - x[0], 0.0))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance f_t [N] of a wheel that climbs out of its hole."""
        return Load(f_t=-load.f_n * x[0] / self.length * contact.sense(self.v_0))

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the rate [m/s] at which the hole under the wheel becomes deeper."""
        # Only a rim that is faster than the travel throws sand out, and only if it touches the ground.
        thrown = ca.fmax(contact.rim - contact.v_x, 0.0) * ca.fmin(contact.h / TOUCH, 1.0)
        # The hole is left behind in proportion to the travel, in either direction, because sense has the sign of v.
        decay = x[0] * contact.v_x * contact.sense(self.v_0) / self.length
        return (self.c_d * thrown * (1.0 - x[0] / (self.deepest * contact.wheel.r)) - decay,)
