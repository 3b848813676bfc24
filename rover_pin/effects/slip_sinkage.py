"""A driving wheel digs: the pressure of the sand rises later, and the wheel sinks deeper, the more it slips."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar, Soil
from rover_pin.effects.effect import Effect
from rover_pin.soil.compaction import sinking_resistance

LOWEST_EXPONENT, HIGHEST_EXPONENT = 0.05, 3.0
"""The bounds of `Soil.n`."""
FADE = 0.001
"""The v_0 of `contact.fading` with which the resistance of the rut fades [m/s]: that of `DiggingMemory` (assumed)."""


@dataclass(frozen=True)
class SlipSinkage(Effect):
    """n <- min(n + n_1 max(S, 0), 3): the sinkage exponent of Eq (4) grows with driving slip.

    Where h < b, a greater n is a softer soil: at a given load the wheel stands deeper, and pays for the deeper rut by
    `rut_resistance`. It follows the slip of now: a wheel whose slip falls is lifted, by a soil that takes nothing for
    it (`DiggingMemory` keeps its hole). For S < 0 see `SkidSinkage`.
    Source: Ding, Gao, Deng and Tao, J. Cent. South Univ. Technol. 17 (2010) 129, doi 10.1007/s11771-010-0021-7: sinkage
    at S = 0.6 is 3 to 7 times the static one, by an exponent that changes with slip. Differs from the paper: it holds
    n, and says that digging is not modelled.
    """

    title: ClassVar[str] = "slip-sinkage"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "sand gives way as the wheel slips"
    n_1: Scalar = quantity(0.5, "", "assumed: 0 to 0.8 is plausible for rover wheels in sand", 0.0, 2.0, "n_1")
    neutral: ClassVar[dict[str, float]] = {"n_1": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on the soil that slip has loosened."""
        n = ca.fmin(contact.soil.n + self._exponent_rise(contact), HIGHEST_EXPONENT)
        return contact._replace(soil=contact.soil.replace(n=n))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance of the deeper rut."""
        return Load(f_t=-rut_resistance(contact, self._exponent_rise(contact)))

    def _exponent_rise(self, contact: Contact) -> Scalar:
        return self.n_1 * ca.fmax(contact.S, 0.0)


def rut_resistance(contact: Contact, risen: Scalar) -> Scalar:
    """Return the compaction resistance [N] of an exponent that has risen by this, against the travel."""
    return rut_cost(contact, contact.soil.replace(n=ca.fmax(contact.soil.n - risen, LOWEST_EXPONENT)))


def rut_cost(contact: Contact, firm: Soil) -> Scalar:
    """Return the compaction resistance [N] of soil that was `firm` and is now softer, against the travel.

    b int p dz at the sinkage as it is, less that of the shallower rut in soil as it was, under the same load; nothing
    where the traction law feels the sinkage itself (`Contact.uncompacted`).
    """
    soil = contact.soil
    cost = sinking_resistance(ca.fmax(contact.h, 0.0), contact.wheel, soil, firm)
    return contact.uncompacted * cost * contact.sense(FADE)
