"""A driven wheel that digs: it sinks deeper the more it slips."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar, Soil
from rover_pin.effects.effect import Effect
from rover_pin.soil.compaction import sinking_resistance

MIN_EXPONENT, MAX_EXPONENT = 0.05, 3.0
"Bounds of the sinkage exponent n, equal to the bounds of `Soil.n`."
FADING_SPEED = 0.001
"""Minimum travel speed [m/s] for the full resistance of the rut. Below this speed, the resistance is reduced, so that
it vanishes at rest (see `contact.fading`). It is the value of `DiggingMemory` (assumed)."""


@dataclass(frozen=True)
class SlipSinkage(Effect):
    """A driven wheel sinks deeper the more it slips: the sinkage exponent n of Eq (4) grows with the slip.

        n <- min(n + n_1 max(S, 0), 3)

    For a sinkage below the wheel's width a larger n means a softer soil: under a given load the wheel sinks deeper, and
    pays for the deeper rut by `rut_resistance`. The exponent follows the present slip. A wheel whose slip falls is
    therefore lifted by a soil that takes no energy for the lift (`DiggingMemory` keeps its hole). For S < 0 see
    `SkidSinkage`.

    Source: Ding, Gao, Deng and Tao, J. Cent. South Univ. Technol. 17 (2010) 129, doi 10.1007/s11771-010-0021-7: the
    sinkage at S = 0.6 is 3 to 7 times the static one, by an exponent that changes with slip. Differs from the paper: it
    holds n constant, and states that digging is not modelled.
    """

    title: ClassVar[str] = "slip-sinkage"
    family: ClassVar[str] = "sinkage with slip"
    meaning: ClassVar[str] = "a wheel sinks deeper into sand the more it slips"
    n_1: Scalar = quantity(0.5, "", "assumed: 0 to 0.8 is plausible for rover wheels in sand", 0.0, 2.0, "n_1")
    neutral: ClassVar[dict[str, float]] = {"n_1": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact of a slipping wheel with a larger sinkage exponent, which means softer soil."""
        # A larger exponent makes the soil softer as long as the sinkage is below the wheel's width.
        n = ca.fmin(contact.soil.n + self._exponent_rise(contact), MAX_EXPONENT)
        return contact._replace(soil=contact.soil.replace(n=n))

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the resistance f_t [N] that the deeper rut costs."""
        return Load(f_t=-rut_resistance(contact, self._exponent_rise(contact)))

    def _exponent_rise(self, contact: Contact) -> Scalar:
        """Return the increase [-] of the sinkage exponent n by slip."""
        return self.n_1 * ca.fmax(contact.S, 0.0)


def rut_resistance(contact: Contact, risen: Scalar) -> Scalar:
    """Return the additional compaction resistance [N] against the travel, if an effect has increased the sinkage
    exponent by `risen`.

    This is the work per metre of the deeper rut, minus the work of the rut in soil with the exponent before the
    increase.
    """
    return rut_cost(contact, contact.soil.replace(n=ca.fmax(contact.soil.n - risen, MIN_EXPONENT)))


def rut_cost(contact: Contact, firm: Soil) -> Scalar:
    """Return the additional compaction resistance [N] against the travel, if an effect has softened the soil `firm` to
    the soil of the contact.

    This is the work b int p dz per metre of travel at the present sinkage (wheel width b, pressure p at the depth z),
    minus the work of the shallower rut in the firm soil under an equal load. The result is zero if the traction law
    already contains this resistance (`Contact.uncompacted` is 0).
    """
    # The resistance fades at rest, so that it never pushes the wheel.
    soil = contact.soil
    cost = sinking_resistance(ca.fmax(contact.h, 0.0), contact.wheel, soil, firm)
    return contact.uncompacted * cost * contact.sense(FADING_SPEED)
