"""Shear that depends on the sliding speed of the rim, not only on the sliding distance."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar, right_angle
from rover_pin.effects.effect import Effect
from rover_pin.soil.wheel_forces import pull_of_shear

DECADE = math.log(10.0)
"""Prior SD of the logarithm of the reference speed v_0: a factor of 10. No published reference speed exists for this
law in sand, and the bounds are two such factors away."""


@dataclass(frozen=True)
class RateDependence(Effect):
    """The shear that the soil bears depends on the speed v_j at which the rim slides on it.

        shear <- shear (1 + c_r ln(1 + v_j / v_0)),   v_j^2 = (r omega - v)^2 + v_y^2

    With c_r > 0 the sand is stronger at higher speed. With c_r < 0 it loses grip, as single-wheel tests at speed show.
    The effect acts on the load of the effects before it: on torque, f_y and the shear part of f_t. f_t changes by the
    change of torque divided by r; for a braked wheel, f_t increases only so far that the pull does no more work than
    the torque provides (`paid_for`).

    Source: assumed form, the logarithmic rate law that is common in soil mechanics; loss of drawbar pull with speed:
    Rodriguez-Martinez et al., arXiv 2306.02167. Differs from the paper: its forces depend on the slip ratio only.
    """

    title: ClassVar[str] = "rate-dependent shear"
    family: ClassVar[str] = "rate"
    meaning: ClassVar[str] = "the soil's shear strength depends on how fast the rim slides"
    c_r: Scalar = quantity(0.05, "", "assumed: -0.05 to 0.15 is plausible", -0.15, 0.5, "c_r")
    v_0: Scalar = quantity(0.01, "m/s", "assumed: a fifth of the paper's 0.05 m/s", 1e-4, 1.0, "v_0", log_sd=DECADE)
    neutral: ClassVar[dict[str, float]] = {"c_r": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the change of the shear forces and the torque that the sliding speed of the rim causes."""
        # Sliding speed of the rim on the soil, along and across the wheel together.
        sliding = right_angle(ca.fabs(contact.rim - contact.v_x), contact.v_y)
        more = self.c_r * ca.log1p(sliding / self.v_0)
        # Only forces that shear carries grow; the normal force and resistances stay.
        pull = pull_of_shear(load.torque, contact.wheel, contact.S)
        shear = {name: more * getattr(load, name) for name in ("f_y", "torque", "moment_z")}
        return Load(f_t=more * pull, **shear)
