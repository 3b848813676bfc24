"""A hole that a slipping wheel digs, and that it keeps until it has rolled out."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect, State

TOUCH = 1e-4
"""Sinkage [m] from which a spinning rim digs at full rate: none in the air."""


@dataclass(frozen=True)
class DiggingMemory(Effect):
    """dD/dt = c_d max(r omega - v, 0) (1 - D / (d r)) - D v s / L; h <- max(h - D, 0); f_t = -f_n s D / L.

    D is the depth of the hole: the ground under the wheel is lower by D, at most by d r, from where its walls fall in
    as fast as the rim throws them out; at constant slip D = d r q / (d r + q), q = c_d L S / (1 - S). The wheel climbs
    the hole's rim over a travel L; s = v / sqrt(v^2 + u^2) is the sense of travel, u = `contact.fading`: a wheel that
    spins in its hole and cannot climb stands, and does not creep out. The work of the resistance, f_n D v s / L, is the
    lift that leaving the hole gives the load, in every form and at every speed: climbing costs what it raises, and no
    compaction is counted twice. Unlike `SlipSinkage` it follows the slip that was, not that of now, and stays through a
    pause. A hole left over less than about r / 2 would be a drag without depth, hence the least L.
    Source: assumed form; energy. Differs from the paper: it says that digging is not modelled.
    """

    title: ClassVar[str] = "digging"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "a slipping wheel digs a hole and has to climb out of it"
    c_d: Scalar = quantity(0.05, "", "assumed: a twentieth of what the rim throws deepens the hole", 0.0, 1.0, "c_d")
    length: Scalar = quantity(0.04, "m", "assumed: a contact length of travel leaves the hole", 0.02, 1.0, "L")
    deepest: Scalar = quantity(0.5, "", "assumed: half a radius, where a wheel counts as buried", 0.01, 1.0, "d")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    states: ClassVar[tuple[State, ...]] = (State("dug"),)
    neutral: ClassVar[dict[str, float]] = {"c_d": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on the bottom of the hole."""
        return contact._replace(h=ca.fmax(contact.h - x[0], 0.0))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance of the hole's rim."""
        return Load(f_t=-load.f_n * x[0] / self.length * contact.sense(self.v_0))

    def rate(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return dD/dt."""
        thrown = ca.fmax(contact.rim - contact.v_x, 0.0) * ca.fmin(contact.h / TOUCH, 1.0)
        decay = x[0] * contact.v_x * contact.sense(self.v_0) / self.length
        return (self.c_d * thrown * (1.0 - x[0] / (self.deepest * contact.wheel.r)) - decay,)
