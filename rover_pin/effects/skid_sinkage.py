"""A braked wheel that sinks deeper the more it skids."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.effects.slip_sinkage import MAX_EXPONENT, rut_resistance


@dataclass(frozen=True)
class SkidSinkage(Effect):
    """A braked wheel sinks deeper the more it skids: the sinkage exponent n of Eq (4) grows with the skid -S.

        n <- min(n + n_s max(-S, 0), 3)

    The form is the one of `SlipSinkage`, with a parameter of its own, because a braked wheel pushes soil ahead and does
    not throw it backwards.

    Source: assumed form. Differs from the paper: it holds n constant.
    """

    title: ClassVar[str] = "skid-sinkage"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "a braking wheel sinks deeper the more it skids"
    n_s: Scalar = quantity(0.3, "", "assumed: similar to n_1 of slip-sinkage", 0.0, 2.0, "n_s")
    neutral: ClassVar[dict[str, float]] = {"n_s": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact of a skidding wheel with a larger sinkage exponent, which means softer soil."""
        # A larger exponent makes the soil softer as long as the sinkage is below the wheel's width.
        n = ca.fmin(contact.soil.n + self._exponent_rise(contact), MAX_EXPONENT)
        return contact._replace(soil=contact.soil.replace(n=n))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance f_t [N] that the deeper rut costs."""
        return Load(f_t=-rut_resistance(contact, self._exponent_rise(contact)))

    def _exponent_rise(self, contact: Contact) -> Scalar:
        """Return the increase [-] of the sinkage exponent n by skid (negative slip)."""
        return self.n_s * ca.fmax(-contact.S, 0.0)
