"""Slip-sinkage laws of the literature, each with one size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.effects.slip_softening import softer


@dataclass(frozen=True)
class DingMetres(Effect):
    """Ding 2010 with h in metres: sigma times h^(n_1 S)."""

    n_1: Scalar = quantity(0.3, "", "study", -1.0, 4.0, "n_1")
    neutral: ClassVar[dict[str, float]] = {"n_1": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with the sinkage exponent that belongs to the slip of the wheel."""
        more = self.n_1 * ca.fabs(contact.S)
        soil = softer(contact, more * ca.log(contact.wheel.b))
        return contact._replace(soil=soil.replace(n=soil.n + more))


@dataclass(frozen=True)
class Exponential(Effect):
    """Stiffness that falls exponentially with slip: k_1 exp(-a |S|)."""

    a: Scalar = quantity(1.0, "", "study", -8.0, 8.0, "a")
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with a soil whose stiffness is reduced for the slip of the wheel."""
        return contact._replace(soil=softer(contact, -self.a * ca.fabs(contact.S)))


@dataclass(frozen=True)
class Squared(Effect):
    """Stiffness that falls with the square of the slip: k_1 exp(-a S^2)."""

    a: Scalar = quantity(1.0, "", "study", -8.0, 8.0, "a")
    neutral: ClassVar[dict[str, float]] = {"a": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with a soil whose stiffness is reduced for the slip of the wheel."""
        return contact._replace(soil=softer(contact, -self.a * contact.S**2))


@dataclass(frozen=True)
class Lyasko(Effect):
    """Lyasko 2010: sinkage times K = (1 + S) / (1 - S / 2), as stiffness K^(-q (n + 1/2)), q = 1 in the original."""

    q: Scalar = quantity(1.0, "", "study", -1.0, 3.0, "q")
    neutral: ClassVar[dict[str, float]] = {"q": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact with a soil whose stiffness is reduced for the slip of the wheel."""
        S = ca.fabs(contact.S)
        grown = ca.log((1 + S) / (1 - S / 2))
        return contact._replace(soil=softer(contact, -self.q * (contact.soil.n + 0.5) * grown))
