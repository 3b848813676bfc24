"""Damping of the normal force: soil that is being compressed gives back less than was pressed into it."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect


@dataclass(frozen=True)
class NormalDamping(Effect):
    """The soil damps the normal force: it pushes harder while the wheel sinks in, and less while the wheel rises.

        load <- load max(0, 1 + d dh/dt)

    dh/dt is the rate of the sinkage. All parts of the load are scaled alike, so that f_t / f_n is unchanged. The force
    is the static one at rest and never a tension.

    Source: Hunt and Crossley, J. Applied Mechanics 42 (1975) 440. Differs from the paper: it has no damping, and a
    rover that is dropped by 12 mm then bounces for seconds. Travel times do not depend on d between 3 and 30 s/m.
    """

    title: ClassVar[str] = "damping of the soil"
    family: ClassVar[str] = "rate"
    meaning: ClassVar[str] = "the soil gives back less energy than was pressed into it"
    d: Scalar = quantity(10.0, "s/m", "assumed: a 12 mm drop settles at once", 0.0, 1e3, "d")
    neutral: ClassVar[dict[str, float]] = {"d": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the change of the wheel's load by damping: an increase while the wheel sinks in, a decrease while it
        rises.
        """
        # The factor cannot fall below 0, because soil does not pull a rising wheel back. v_n is positive while the
        # wheel sinks.
        extra = ca.fmax(0.0, 1.0 + self.d * contact.v_n) - 1.0
        return Load(*(extra * part for part in load))
