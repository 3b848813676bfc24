"""The soil beside a sunk wheel: earth pressure on the buried part of its disc when it is pushed sideways."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Contact, Load, Scalar
from rover_pin.effects.effect import Effect
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.combined import sideways_ratio
from rover_pin.soil.passive import passive


@dataclass(frozen=True)
class FlankPressure(Effect):
    """f_y = -sgn(j_y) B (1 - exp(-|j_y| / k_f)) int_-theta_1^theta_1 p(h(theta)) r cos theta dtheta.

    p(h) = D_1 (c h + D_2 gamma h^2 / 2), `soil.passive`, is the passive pressure per width of a wall of depth
    h = r (cos theta - cos theta_1): the buried segment of the disc, in ground that is level beside the rut. Both
    integrals are closed:
    int h cos theta = r (theta_1 - sin theta_1 cos theta_1), int h^2 cos theta = r^2 (2 sin theta_1 - 2/3 sin^3 theta_1
    - 2 theta_1 cos theta_1). The pressure builds up with the way j_y = r (v_y / r omega)(theta_1 - theta_2) that the
    disc goes sideways while it passes. phi_f is the soil's own friction, not the rim's. B is 1 for a plate that is wide
    for its depth; a short one also moves the soil beside it, and the heap that it pushes stands above the ground. It
    opposes v_y, so it only takes energy; its friction against sinking and turning is left out. The segment is even
    before and behind the axle, so that its moment about the vertical is none: a rut that is open behind would move its
    force ahead, pressure that builds up along the way behind, and neither is measured.

    Source: Hegedus (1960) in the form of Ishigami, Miwa, Nagatani and Yoshida, J. Field Robotics 24 (2007) 233, who let
    it act in full; that it builds up: Janosi's law. Differs from the paper: it has no side force.
    """

    title: ClassVar[str] = "flank pressure"
    family: ClassVar[str] = "side wall"
    meaning: ClassVar[str] = "soil beside the sunk wheel resists when it is pushed sideways"
    share: Scalar = quantity(2.9, "", "one measured wheel (studies/wheel_laws.py); wide plate: 1", 0.0, 8.0, "B")
    k_f: Scalar = quantity(0.024, "m", "one measured wheel (studies/wheel_laws.py)", 1e-4, 0.5, "k_f")
    gamma: Scalar = quantity(15700.0, "N/m^3", "assumed: loose dry sand, 1600 kg/m^3, on Earth", 0.0, 1e5, "gamma")
    phi_f: Scalar = quantity(math.radians(30.0), "rad", "assumed: Table 1's sand", 0.0, math.radians(60.0), "phi_f")
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the side force on the disc."""
        wheel, c = contact.wheel, contact.soil.c
        theta_1, theta_2 = SinkageAngles().angles(contact.h, wheel, contact.soil)
        j_y = sideways_ratio(contact.S, contact.S_y) * wheel.r * (theta_1 - theta_2)
        built = ca.if_else(j_y < 0.0, ca.expm1(j_y / self.k_f), -ca.expm1(-j_y / self.k_f))
        return Load(f_y=-self.share * built * self._passive(theta_1, wheel.r, c))

    def _passive(self, theta_1: Scalar, r: Scalar, c: Scalar) -> Scalar:
        """Return the passive force on the buried segment of the disc [N]."""
        cos, sin, wall = ca.cos(theta_1), ca.sin(theta_1), passive(self.phi_f)
        depth = r * r * ca.fmax(theta_1 - sin * cos, 0.0)
        square = r * r * r * ca.fmax(2.0 * sin - 2.0 / 3.0 * sin**3 - 2.0 * theta_1 * cos, 0.0)
        return wall.D_1 * (c * depth + wall.D_2 * self.gamma * square / 2.0)
