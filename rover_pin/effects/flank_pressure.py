"""The soil beside a sunk wheel: earth pressure on the buried part of its disc when it is pushed sideways."""

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import SMOOTHING, Contact, Load, Scalar, fading
from rover_pin.effects.effect import Effect
from rover_pin.soil.angles import SinkageAngles
from rover_pin.soil.passive import passive
from rover_pin.soil.slip import drift, spinning
from rover_pin.soil.stress import mobilised_both_ways

CENTRE = 0.43
"""Height of the pressure's centre over the wheel's lowest point, of the depth: 1 - 2/3 of 6/7, a shallow segment's."""
ROUNDED = 0.05
"""Share of the full pressure, built up at some 2 deg, below which the size of what rubs is rounded."""


@dataclass(frozen=True)
class FlankPressure(Effect):
    """f_y = -F, F = sgn(v_y) B e^(-l S) (1 - exp(-|j_y| / k_f)) int_-theta_1^theta_1 p(h(theta)) r cos theta dtheta.

    p(h) = D_1 (c h + gamma cot X (u h + (1 - cot X tan phi_f) h^2 / 2)), X = 45 deg - phi_f / 2, is what a wall of
    depth h = r (cos theta - cos theta_1) bears per width: the buried segment of the disc, in ground that is level
    beside the rut; where the wheel runs in a trench of its lugs, from its bottom up to that ground. D_1 is that of
    `soil.passive`, there with a heap that ends where the sliding wedge does, h cot X away; here the heap stands u high
    at the disc, falls off at phi_f, and what of it lies on the wedge weighs on it. It is the sand that the wheel puts
    aside, u^2 / (2 tan phi_f) = b h / 2 + A |v_y| / V: half of the rut's, and what the segment A sweeps. Limit: a heap
    that is shorter than the wedge, u < h, as beside a wheel narrower than its depth, counts for less than it weighs.
    All integrals are closed: int h cos theta = r (theta_1 - sin theta_1 cos theta_1) = A / r, int h^2 cos theta =
    r^2 (2 sin theta_1 - 2/3 sin^3 theta_1 - 2 theta_1 cos theta_1). The pressure builds up with the way j_y =
    d 2 r sin theta_1 that the disc goes sideways while it travels its buried length, d = `slip.drift`; a rim that
    spins, S > 0 over the whole travel, carries sand away from beside it. phi_f is the soil's own friction, not the
    rim's. B is 1 for a plate that is wide for its depth; a short one also moves the soil beside it.

    The sand rubs on the disc: f_t = -tan(phi) |F| w / sqrt(w^2 + v_y^2 + u^2), w = v - q r omega, and q r of it is
    torque, q = 1 - 0.43 h / r at the pressure's centre. A rolling or braked wheel is held back, a spinning one driven.
    Both only take energy. The segment is even before and behind the axle, so that its moment about the vertical is
    none: a rut that is open behind would move its force ahead, pressure that builds up along the way behind, and
    neither is measured. The rubbing of a disc that runs straight, at rest pressure, is left out.

    Source: Hegedus (1960) in the form of Ishigami, Miwa, Nagatani and Yoshida, J. Field Robotics 24 (2007) 233, who let
    it act in full; that it builds up: Janosi's law; the heap (conservation of volume), friction on the disc (Coulomb)
    and, from seven measured sets, the loss with slip: derived here, new. Differs from the paper: it has no side force.
    """

    title: ClassVar[str] = "flank pressure"
    family: ClassVar[str] = "side wall"
    meaning: ClassVar[str] = "soil beside the sunk wheel resists when it is pushed sideways"
    share: Scalar = quantity(1.4, "", "seven measured sets: 1.2 to 1.5; a wide plate: 1", 0.0, 8.0, "B")
    k_f: Scalar = quantity(0.05, "m", "seven measured sets (studies/wheel_laws.py)", 1e-4, 0.5, "k_f")
    lost: Scalar = quantity(1.3, "", "seven measured sets (studies/wheel_laws.py): 1.2 to 1.3", 0.0, 5.0, "l")
    gamma: Scalar = quantity(15700.0, "N/m^3", "assumed: loose dry sand, 1600 kg/m^3, on Earth", 0.0, 1e5, "gamma")
    phi_f: Scalar = quantity(math.radians(30.0), "rad", "assumed: Table 1's sand", 0.0, math.radians(60.0), "phi_f")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the side force on the disc, and what rubs along it."""
        r, soil, h = contact.wheel.r, contact.soil, contact.h + contact.trench
        theta_1, _ = SinkageAngles().angles(h, contact.wheel, soil)
        u = fading(contact.rim, self.v_0, 1.0)
        aside = ca.fabs(contact.v_y) / ca.sqrt(contact.travel**2 + u * u)
        j_y = drift(contact.S, contact.S_y) * 2.0 * r * ca.sin(theta_1)
        built = mobilised_both_ways(j_y / self.k_f)
        share = self.share * ca.exp(-self.lost * spinning(contact.S, contact.S_y))
        most = share * self._passive(theta_1, r, soil.c, contact.wheel.b * ca.fmax(h, 0.0) / 2.0, aside)
        size = most * (ca.sqrt(built * built + ROUNDED**2) - ROUNDED)
        arm = r - CENTRE * ca.fmax(h, 0.0)
        along = contact.v_x - contact.rim * arm / r
        rubbing = ca.tan(soil.phi) * size * along / ca.sqrt(along * along + contact.v_y * contact.v_y + u * u)
        return Load(f_t=-rubbing, f_y=-most * built, torque=-rubbing * arm)

    def _passive(self, theta_1: Scalar, r: Scalar, c: Scalar, half_rut: Scalar, aside: Scalar) -> Scalar:
        """Return the passive force on the buried segment of the disc [N], beside a heap of all that is put aside."""
        cos, sin, wall, slope = ca.cos(theta_1), ca.sin(theta_1), passive(self.phi_f), ca.tan(self.phi_f)
        depth = r * r * ca.fmax(theta_1 - sin * cos, 0.0)
        square = r * r * r * ca.fmax(2.0 * sin - 2.0 / 3.0 * sin**3 - 2.0 * theta_1 * cos, 0.0)
        heap = ca.sqrt(2.0 * slope * (half_rut + depth * aside) + SMOOTHING)
        wedge = heap * depth + (1.0 - wall.cot_X * slope) * square / 2.0
        return wall.D_1 * (c * depth + self.gamma * wall.cot_X * ca.fmax(wedge, 0.0))
