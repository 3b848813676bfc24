"""A driving wheel digs: the pressure of the sand rises later, and the wheel sinks deeper, the more it slips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.contact import Contact, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.quantity import quantity

HIGHEST_EXPONENT = 3.0
"""The bound of `Soil.n`."""


@dataclass(frozen=True)
class SlipSinkage(Effect):
    """n <- min(n + n_1 max(S, 0), 3): the sinkage exponent of Eq (4) grows with driving slip.

    Where h < b, a greater n is a softer soil: at a given load the wheel stands deeper. For S < 0 see `SkidSinkage`.
    Source: Ding, Gao, Deng and Tao, J. Cent. South Univ. Technol. 17 (2010) 129, doi 10.1007/s11771-010-0021-7: sinkage
    at S = 0.6 is 3 to 7 times the static one, by an exponent that changes with slip. Differs from the paper: it holds
    n, and says that digging is not modelled.
    """

    n_1: Scalar = quantity(0.5, "", "assumed: 0 to 0.8 is plausible for rover wheels in sand", 0.0, 2.0, "n_1")
    neutral: ClassVar[dict[str, float]] = {"n_1": 0.0}

    def amend(self, contact: Contact, x: tuple[Scalar, ...]) -> Contact:
        """Return the contact on the soil that slip has loosened."""
        n = ca.fmin(contact.soil.n + self.n_1 * ca.fmax(contact.S, 0.0), HIGHEST_EXPONENT)
        return contact._replace(soil=contact.soil.replace(n=n))
