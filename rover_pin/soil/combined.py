"""Forces on a wheel whose rim shears the soil both along and across the wheel: the shear stress opposes the
displacement of each point of the rim.
"""

from typing import NamedTuple

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.arc_integrals import integrate
from rover_pin.soil.quadrature import FAST, entry_graded
from rover_pin.soil.slip import MIN_RIM_RATIO, speed_ratio
from rover_pin.soil.stress import strength, stress_scale
from rover_pin.soil.wheel_forces import WheelForces, assemble

MIN_SHIFT = 1e-12
"""Minimum shear displacement, divided by the shear displacement modulus k of the soil [-]. Below this value, the shear
stress fades to zero. Without this limit, the direction of a displacement of zero would be 0 / 0."""


class ShearedSideways(NamedTuple):
    """Forces of the soil on a wheel that moves along its heading and sideways, along its axle."""

    along: WheelForces
    "forces in the plane of the wheel, and the torque about its axle"
    f_y: Scalar
    """side force on the rim [N], positive to the left; it opposes the sideways motion, and is negative if the sideways
    slip S_y is positive"""
    moment: Scalar
    """moment of the side force about the vertical through the wheel's centre [N m]; a positive moment turns the wheel
    to the left"""


def sideways_ratio(S: Scalar, S_y: Scalar) -> Scalar:
    """Return v_y / (r omega) [-], the ratio of sideways speed to rim speed, from the slip S and the sideways slip S_y.

    With S_y = v_y / max(r omega, v), the ratio is S_y for a driven wheel, and S_y / (1 + S) for a braked wheel.
    """
    return S_y / ca.fmax(1 + ca.fmin(S, 0.0), MIN_RIM_RATIO)


def combined_forces(
    S: Scalar, sideways: Scalar, angles: tuple[Scalar, Scalar], wheel: Wheel, soil: Soil, nodes: int = FAST
) -> ShearedSideways:
    """Return the forces on a wheel whose rim shears the soil both along the wheel and across it.

    The rim of radius r turns at omega, and the wheel travels at v along its heading and at v_y along its axle. While a
    point of the rim turns from the entry angle theta_1 to theta, it is displaced relative to the soil by j_x along the
    wheel and by j_y across it:

        j_x = r {theta_1 - theta - (v / r omega)(sin theta_1 - sin theta)},   j_y = r (v_y / r omega)(theta_1 - theta),
        tau = (c + sigma tan phi) (1 - exp(-|j| / k)) along (j_x, -j_y) / |j|,   |j| = sqrt(j_x^2 + j_y^2).

    The magnitude of the shear stress tau obeys Eqs (2) and (3) of the paper at every point of the rim, and j_y = 0
    gives `wheel_forces`. The sideways stress tau_y at the angle theta acts at x = r sin theta in front of the axle:

        f_y = -r b int tau_y dtheta,   M_z = int x df_y = -r^2 b int tau_y sin theta dtheta,

    where b is the width of the wheel and M_z the moment about the vertical through the wheel's centre, with x forward,
    y left and z up. Most of the contact lies in front of the axle. M_z therefore has the sign of f_y and turns the
    wheel further away from its direction of travel, whereas a tyre on a road is turned back. Simplifications: the
    thrust is uniform over the width and has no lever arm, and the turning of the wheel about the vertical causes no
    moment.

    Parameters
    ----------
    S, sideways : Scalar
        Slip ratio [-], and ratio of sideways speed to rim speed v_y / (r omega) [-], which `sideways_ratio` returns.
    angles : tuple of Scalar
        Entry angle theta_1 and exit angle theta_2 [rad], as in `wheel_forces`.
    wheel, soil : Wheel, Soil
        Dimensions of the wheel and constants of the soil.
    nodes : int
        Number of quadrature nodes over the contact arc.

    Source: Eqs (2)-(7) of the paper; M_z follows from statics. The shear stress acts along the displacement as in Wong
    and Chiang, Proc. IMechE D 215 (2001) 343, for a track, and in Jia, Smith and Peng, Robotica 30 (2012) 491, for a
    steered wheel. (Yoshida and Ishigami, IROS 2004, use both shear stresses in full, so that their resultant exceeds
    the strength of Eq (3).) Differs from the paper: the paper's wheel runs straight.
    """
    theta_1, theta_2 = angles
    # The arc ends where the rim leaves the soil's surface, at -theta_1 or earlier.
    length = theta_1 - ca.fmax(theta_2, -theta_1)
    ratio, stiffness = speed_ratio(S), wheel.r / soil.k

    # Both laws are functions of s = theta_1 - theta and of sin theta_1 - sin theta, called `rise`.
    # `stiffness` turns the displacements, which are in units of r, into displacements in units of k.
    def shifts(s: Scalar, rise: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """Return the displacements j_x / k and j_y / k of a point of the rim, and the factor (1 - exp(-|j| / k)) k /
        |j|. This factor times j_x / k is the mobilised fraction of the shear strength along the wheel, and times j_y /
        k across it.
        """
        x, y = stiffness * (s - ratio * rise), stiffness * sideways * s
        size = ca.sqrt(x * x + y * y + MIN_SHIFT**2)
        return x, y, -ca.expm1(-size) / size

    def along(s: Scalar, rise: Scalar) -> Scalar:
        x, _, fraction = shifts(s, rise)
        return x * fraction

    def across(s: Scalar, rise: Scalar) -> Scalar:
        _, y, fraction = shifts(s, rise)
        return y * fraction

    # One quadrature rule serves both directions: the normal stress is the same, only the mobilised fractions differ.
    strong, rule = strength(wheel, soil), entry_graded(nodes)
    arc = integrate(theta_1, 0.0, length, along, strong, rule)
    side = integrate(theta_1, 0.0, length, across, strong, rule)
    # The sideways stress opposes the sideways displacement, hence the signs.
    area = wheel.r * wheel.b * stress_scale(wheel, soil)
    return ShearedSideways(
        assemble(arc, theta_1, length, wheel, soil), -area * side.tau, -area * wheel.r * side.tau_sin
    )
