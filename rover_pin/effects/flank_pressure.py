"""Pressure of the soil next to a sunk wheel on the buried part of its disc, when the wheel is pushed sideways."""

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

PRESSURE_CENTRE = 0.43
"""Height at which the pressure on the wheel's disc acts, above the lowest point of the wheel, as a fraction of the
sinkage: 1 - (2/3) (6/7) for a shallow circular segment."""
ROUNDING = 0.05
"""Fraction of the full pressure below which the absolute value in the rubbing force is rounded, so that the force
changes smoothly at straight travel. The pressure reaches this fraction at a slip angle of about 2 deg."""


@dataclass(frozen=True)
class FlankPressure(Effect):
    """Soil next to a sunk wheel resists when the wheel is pushed sideways: passive earth pressure F on the buried
    segment of its disc.

        f_y = -F,   F = sgn(v_y) B exp(-l S) (1 - exp(-|j_y| / k_f)) int p(h(theta)) r cos theta dtheta
        over theta from -theta_1 to theta_1,
        p(h) = D_1 (c h + gamma cot X (u h + (1 - cot X tan phi_f) h^2 / 2)),   X = 45 deg - phi_f / 2.

    p(h) is the force that a wall of depth h = r (cos theta - cos theta_1) bears for each metre of width, with D_1 of
    `soil.passive`. The wall is the buried segment of the disc, in ground that is level next to the rut. If the wheel
    runs in a trench that its lugs have cut, the segment reaches from the trench bottom up to that ground. Hegedus'
    formula assumes a heap of sand that ends where the sliding wedge ends, at a distance h cot X. Here the heap is u
    high at the disc and falls off at the angle phi_f, and only its part above the wedge loads the wedge. The heap holds
    the sand that the wheel puts aside, u^2 / (2 tan phi_f) = b h / 2 + A |v_y| / V: half of the sand of the rut, and
    the sand that the segment of area A sweeps at the total speed V. Limit: if the heap is shorter than the wedge (u <
    h), as next to a wheel that is narrower than its depth, the formula underestimates the weight of the heap.

    All integrals have closed forms: int h cos theta = r (theta_1 - sin theta_1 cos theta_1) = A / r, and int h^2 cos
    theta = r^2 (2 sin theta_1 - 2/3 sin^3 theta_1 - 2 theta_1 cos theta_1). The pressure builds up with the distance
    j_y = d 2 r sin theta_1 that the disc moves sideways while it travels its buried length, with d = `slip.drift`. A
    spinning rim (S > 0 over the whole travel) carries sand away from its side, by the factor exp(-l S). phi_f is the
    friction angle of the soil itself, not of the rim. B is 1 for a plate that is wide compared with its depth, and
    larger for a short plate, which also moves the soil next to it.

    The sand rubs on the disc: f_t = -tan(phi) |F| w / sqrt(w^2 + v_y^2 + u_0^2), with w = v - q r omega and the small
    speed u_0 of `contact.fading`. The lever arm of the torque is q r, where q = 1 - 0.43 h / r at the centre of the
    pressure. The rubbing holds a rolling or braked wheel back and drives a spinning one; it always dissipates energy.
    The buried segment is symmetric about the axle, so that its moment about the vertical is zero. A rut that is open
    behind the wheel would move the force forwards, and pressure that builds up along the contact would move it
    backwards; neither is measured. The rubbing on the disc of a wheel that runs straight, at the pressure at rest, is
    neglected.

    Source: Hegedus (1960) in the form of Ishigami, Miwa, Nagatani and Yoshida, J. Field Robotics 24 (2007) 233, who let
    the pressure act in full. The build-up is Janosi's law. The heap (conservation of volume), the friction on the disc
    (Coulomb) and the loss with slip, from seven measured sets, are derived here and are new. Differs from the paper: it
    has no side force.
    """

    title: ClassVar[str] = "flank pressure"
    family: ClassVar[str] = "side wall"
    meaning: ClassVar[str] = "soil next to a sunk wheel resists a sideways push of the wheel"
    share: Scalar = quantity(1.4, "", "seven measured sets: 1.2 to 1.5; a wide plate: 1", 0.0, 8.0, "B")
    k_f: Scalar = quantity(0.05, "m", "seven measured sets (studies/wheel_laws.py)", 1e-4, 0.5, "k_f")
    lost: Scalar = quantity(1.3, "", "seven measured sets (studies/wheel_laws.py): 1.2 to 1.3", 0.0, 5.0, "l")
    gamma: Scalar = quantity(15700.0, "N/m^3", "assumed: loose dry sand, 1600 kg/m^3, on Earth", 0.0, 1e5, "gamma")
    phi_f: Scalar = quantity(math.radians(30.0), "rad", "assumed: Table 1's sand", 0.0, math.radians(60.0), "phi_f")
    v_0: Scalar = quantity(0.001, "m/s", "assumed: rest, a fiftieth of the paper's 0.05 m/s", 1e-6, 1.0, "v_0")
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}

    def load(self, contact: Contact, load: Load, x: tuple[Scalar, ...]) -> Load:
        """Return the load of the sand next to the wheel: the side force on the disc, the rubbing force along it, and
        the torque of this rubbing about the axle.
        """
        r, soil, h = contact.wheel.r, contact.soil, contact.h + contact.trench
        theta_1, _ = SinkageAngles().angles(h, contact.wheel, soil)
        # At rest the rubbing fades, so that it never drives the wheel.
        u = fading(contact.rim, self.v_0, 1.0)
        # The fraction of the travel that goes sideways decides how much sand the segment sweeps into the heap.
        aside = ca.fabs(contact.v_y) / ca.sqrt(contact.travel**2 + u * u)
        j_y = drift(contact.S, contact.S_y) * 2.0 * r * ca.sin(theta_1)
        built = mobilised_both_ways(j_y / self.k_f)
        # A spinning rim carries sand away from its side, which weakens the pressure.
        share = self.share * ca.exp(-self.lost * spinning(contact.S, contact.S_y))
        # Passive force of the soil on the buried segment of the disc, with a heap of the displaced sand next to the
        # disc. `depth` and `square` are the integrals of h and h^2 over the segment. The height of the heap follows
        # from its cross-section: half the cross-section of the rut, and the part that the segment sweeps aside.
        cos, sin, wall, slope = ca.cos(theta_1), ca.sin(theta_1), passive(self.phi_f), ca.tan(self.phi_f)
        depth = r * r * ca.fmax(theta_1 - sin * cos, 0.0)
        square = r * r * r * ca.fmax(2.0 * sin - 2.0 / 3.0 * sin**3 - 2.0 * theta_1 * cos, 0.0)
        half_rut = contact.wheel.b * ca.fmax(h, 0.0) / 2.0
        heap = ca.sqrt(2.0 * slope * (half_rut + depth * aside) + SMOOTHING)
        # Weight of the sliding wedge and of the heap on it, whose height falls off along the wedge.
        wedge = heap * depth + (1.0 - wall.cot_X * slope) * square / 2.0
        most = share * (wall.D_1 * (soil.c * depth + self.gamma * wall.cot_X * ca.fmax(wedge, 0.0)))
        # Rounded absolute value of the pressure, so that the rubbing force has no corner at straight travel.
        size = most * (ca.sqrt(built * built + ROUNDING**2) - ROUNDING)
        arm = r - PRESSURE_CENTRE * ca.fmax(h, 0.0)
        # The sand rubs against the relative speed of the disc at the height of the pressure's centre.
        along = contact.v_x - contact.rim * arm / r
        rubbing = ca.tan(soil.phi) * size * along / ca.sqrt(along * along + contact.v_y * contact.v_y + u * u)
        return Load(f_t=-rubbing, f_y=-most * built, torque=-rubbing * arm)
