"""Shear that depends on how fast the rim slides, not only on how far."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar, right_angle
from rover_pin.effects.effect import Effect
from rover_pin.soil.wheel_forces import pull_of_shear

DECADE = math.log(10.0)
"""Doubt of v_0: a reference speed by which nobody has scaled this law for sand; its bounds are two of them away."""


@dataclass(frozen=True)
class RateDependence(Effect):
    """Shear <- shear (1 + c_r ln(1 + v_j / v_0)), v_j^2 = (r omega - v)^2 + v_y^2; f_t changes by what
    torque changes, over r (braking: by what that pays for, `paid_for`).

    c_r > 0 is sand that strengthens with rate, c_r < 0 one that loses grip, as single-wheel tests at speed show. Acts
    on the load of the effects before it: torque and f_y, and f_t by its shear.
    Source: assumed form, the logarithmic rate law that is common in soil mechanics; loss of drawbar pull with speed:
    Rodriguez-Martinez et al., arXiv 2306.02167. Differs from the paper: it knows the slip ratio only.
    """

    title: ClassVar[str] = "rate-dependent shear"
    family: ClassVar[str] = "rate"
    meaning: ClassVar[str] = "the soil's shear strength depends on how fast the rim slides"
    c_r: Scalar = quantity(0.05, "", "assumed: -0.05 to 0.15 is plausible", -0.15, 0.5, "c_r")
    v_0: Scalar = quantity(0.01, "m/s", "assumed: a fifth of the paper's 0.05 m/s", 1e-4, 1.0, "v_0", log_sd=DECADE)
    neutral: ClassVar[dict[str, float]] = {"c_r": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return what the rate adds to the shear."""
        sliding = right_angle(ca.fabs(contact.rim - contact.v_x), contact.v_y)
        more = self.c_r * ca.log1p(sliding / self.v_0)
        pull = pull_of_shear(load.torque, contact.wheel, contact.S)
        shear = {name: more * getattr(load, name) for name in ("f_y", "torque", "moment_z")}
        return Load(f_t=more * pull, **shear)
