"""Stresses under the wheel, Eqs (2)-(4), at one angle of the contact arc.

The local sinkage is h(theta) = r (cos theta - cos theta_1), Eq (5) read at every angle: zero where the arc begins.
`theta_1` must be greater than `theta`, and `theta` at least -theta_1, where the arc would come out of the soil again.
"""

from __future__ import annotations

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.slip import speed_ratio


def modulus(wheel: Wheel, soil: Soil) -> Scalar:
    """Return k_1 + k_2 b [Pa], the pressure at a sinkage of one wheel width, Eq (4)."""
    return soil.k_1 + soil.k_2 * wheel.b


def normal_stress(theta: Scalar, theta_1: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return sigma [Pa] at theta [rad]: (k_1 + k_2 b) (h / b)^n with h = r (cos theta - cos theta_1).

    Source: Eqs (4) and (5). Differs from the paper: nothing, but Eq (5) prints h at theta = 0 only; read literally the
    stress would not vary over the arc.
    """
    depth = 2 * ca.sin((theta_1 + theta) / 2) * ca.sin((theta_1 - theta) / 2)
    return modulus(wheel, soil) * (wheel.r / wheel.b * depth) ** soil.n


def tau_max(sigma: Scalar, soil: Soil) -> Scalar:
    """Return the greatest shear stress [Pa] that the soil bears under sigma [Pa]: c + sigma tan phi, Eq (3)."""
    return soil.c + sigma * ca.tan(soil.phi)


def shear_displacement(theta: Scalar, theta_1: Scalar, S: Scalar, wheel: Wheel) -> Scalar:
    """Return j [m], how far the soil at theta [rad] has been sheared since the rim met it.

    j = r {theta_1 - theta - (v / r omega) (sin theta_1 - sin theta)}, with v / r omega from `speed_ratio`.
    Source: Eq (2), the exponent. Differs from the paper: 1 / (1 + S) instead of 1 - S for braking.
    """
    rise = 2 * ca.cos((theta_1 + theta) / 2) * ca.sin((theta_1 - theta) / 2)
    return wheel.r * (theta_1 - theta - speed_ratio(S) * rise)


def mobilised(j_over_k: Scalar) -> Scalar:
    """Return the share of the shear strength in use, in [-1, 1]: sgn(j) (1 - exp(-|j| / k)).

    Source: Eq (2), last factor.
    Differs from the paper: 1 - exp(-j / k) as printed grows without bound where braking makes j < 0; the sign does not.
    """
    return ca.sign(j_over_k) * -ca.expm1(-ca.fabs(j_over_k))


def mobilised_both_ways(j_over_k: Scalar) -> Scalar:
    """Return `mobilised` of a displacement that may turn: its slope at j = 0 is 1 too, and nothing overflows."""
    return ca.expm1(ca.fmin(j_over_k, 0.0)) - ca.expm1(-ca.fmax(j_over_k, 0.0))


def shear_stress(theta: Scalar, theta_1: Scalar, S: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return tau [Pa] at theta [rad], positive where the soil drives the rover forwards, Eq (2)."""
    sigma = normal_stress(theta, theta_1, wheel, soil)
    return tau_max(sigma, soil) * mobilised(shear_displacement(theta, theta_1, S, wheel) / soil.k)
