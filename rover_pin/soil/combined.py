"""Shear along and across the wheel at once: the stress points against the displacement of each point of the rim."""

from typing import NamedTuple

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.arc_integrals import integrate
from rover_pin.soil.quadrature import FAST, entry_graded
from rover_pin.soil.slip import LOCKED, speed_ratio
from rover_pin.soil.stress import Mobilised, strength, stress_scale
from rover_pin.soil.wheel_forces import WheelForces, assemble

LEAST_SHIFT = 1e-12
"""Shear displacement over k at which the direction of the stress is still sought; below, there is no shear."""


class ShearedSideways(NamedTuple):
    """What the soil does to a wheel that also moves along its axle."""

    along: WheelForces
    f_y: Scalar
    "side force of the rim [N], negative for S_y > 0"
    moment: Scalar
    "of the side force about the vertical through the wheel's centre [N m], positive turning it to its left"


def sideways_ratio(S: Scalar, S_y: Scalar) -> Scalar:
    """Return v_y / (r omega) [-] of S_y = v_y / max(r omega, v): S_y driving, S_y / (1 + S) braking."""
    return S_y / ca.fmax(1 + ca.fmin(S, 0.0), LOCKED)


def combined_forces(
    S: Scalar, sideways: Scalar, angles: tuple[Scalar, Scalar], wheel: Wheel, soil: Soil, nodes: int = FAST
) -> ShearedSideways:
    """Return the forces on a wheel whose rim is sheared along and across.

    While a point of the rim turns from theta_1 to theta the wheel moves v_y (theta_1 - theta) / omega along its axle:

        j_x = r {theta_1 - theta - (v / r omega)(sin theta_1 - sin theta)},   j_y = r (v_y / r omega)(theta_1 - theta),
        tau = (c + sigma tan phi) (1 - exp(-|j| / k)) along (j_x, -j_y) / |j|,   |j| = sqrt(j_x^2 + j_y^2),

    so that the resultant keeps to Eqs (2) and (3) at every point, and j_y = 0 is `wheel_forces`. The side shear at
    theta acts x = r sin theta ahead of the axle:

        f_y = -r b int tau_y dtheta,   M_z = int x df_y = -r^2 b int tau_y sin theta dtheta,

    M_z about the vertical through the wheel's centre with x forward, y left, z up. The contact lies mostly ahead of the
    axle, so M_z has the sign of f_y and turns the wheel further askew, where a tyre on a road comes back. Limits: the
    thrust is even over the width, so that it has no arm; a wheel that does not turn about the vertical has no torsion.

    Parameters
    ----------
    S, sideways : Scalar
        Slip ratio [-]; v_y / (r omega) [-], see `sideways_ratio`.
    angles : tuple of Scalar
        theta_1, theta_2 [rad] as in `wheel_forces`.

    Source: Eqs (2)-(7), M_z by statics; the stress along the displacement as Wong and Chiang, Proc. IMechE D 215 (2001)
    343, take it under a track, and Jia, Smith and Peng, Robotica 30 (2012) 491, under a steered wheel (Yoshida and
    Ishigami, IROS 2004, take both shears in full, beyond Eq 3). Differs from the paper: its wheel runs straight.
    """
    theta_1, theta_2 = angles
    length = theta_1 - ca.fmax(theta_2, -theta_1)
    along, across = _laws(speed_ratio(S), sideways, wheel.r / soil.k)
    strong, rule = strength(wheel, soil), entry_graded(nodes)
    arc = integrate(theta_1, 0.0, length, along, strong, rule)
    side = integrate(theta_1, 0.0, length, across, strong, rule)
    area = wheel.r * wheel.b * stress_scale(wheel, soil)
    return ShearedSideways(
        assemble(arc, theta_1, length, wheel, soil), -area * side.tau, -area * wheel.r * side.tau_sin
    )


def _laws(ratio: Scalar, sideways: Scalar, stiffness: Scalar) -> tuple[Mobilised, Mobilised]:
    """Return the shares of the strength along and across, of s = theta_1 - theta and sin theta_1 - sin theta."""

    def shifts(s: Scalar, rise: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        x, y = stiffness * (s - ratio * rise), stiffness * sideways * s
        size = ca.sqrt(x * x + y * y + LEAST_SHIFT**2)
        return x, y, -ca.expm1(-size) / size

    def along(s: Scalar, rise: Scalar) -> Scalar:
        x, _, share = shifts(s, rise)
        return x * share

    def across(s: Scalar, rise: Scalar) -> Scalar:
        _, y, share = shifts(s, rise)
        return y * share

    return along, across
