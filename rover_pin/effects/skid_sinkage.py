"""A braking wheel ploughs in: it sinks deeper the more it skids."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.effects.slip_sinkage import HIGHEST_EXPONENT, rut_resistance


@dataclass(frozen=True)
class SkidSinkage(Effect):
    """n <- min(n + n_s max(-S, 0), 3): the sinkage exponent of Eq (4) grows with skid.

    The same form as `SlipSinkage`, with its own size: a wheel held back pushes soil ahead instead of throwing it
    behind.
    Source: assumed form. Differs from the paper: it holds n.
    """

    title: ClassVar[str] = "skid-sinkage"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "a braking wheel sinks deeper the more it skids"
    n_s: Scalar = quantity(0.3, "", "assumed: of the order of n_1 of slip-sinkage", 0.0, 2.0, "n_s")
    neutral: ClassVar[dict[str, float]] = {"n_s": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on the soil as a skidding wheel meets it."""
        n = ca.fmin(contact.soil.n + self._exponent_rise(contact), HIGHEST_EXPONENT)
        return contact._replace(soil=contact.soil.replace(n=n))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance of the deeper rut."""
        return Load(f_t=-rut_resistance(contact, self._exponent_rise(contact)))

    def _exponent_rise(self, contact: Contact) -> Scalar:
        return self.n_s * ca.fmax(-contact.S, 0.0)
