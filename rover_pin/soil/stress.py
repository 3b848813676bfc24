"""Eqs (2) to (4) at one angle of the contact arc: normal stress, shear strength and the share of it in use."""

from collections.abc import Callable

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel

Mobilised = Callable[[Scalar, Scalar], Scalar]
"""The share of the shear strength in use, of s = theta_1 - theta and sin theta_1 - sin theta."""
LEAST_DEPTH = 1e-300
"""Of sinkage over radius, below which the stress is level."""


def modulus(wheel: Wheel, soil: Soil) -> Scalar:
    """Return k_1 + k_2 b [Pa], the pressure at a sinkage of one wheel width, Eq (4)."""
    return soil.k_1 + soil.k_2 * wheel.b


def stress_scale(wheel: Wheel, soil: Soil) -> Scalar:
    """Return (k_1 + k_2 b) (r / b)^n [Pa]: the normal stress sigma = this times `relative_stress`, Eqs (4) and (5)."""
    return modulus(wheel, soil) * (wheel.r / wheel.b) ** soil.n


def relative_stress(depth: Scalar, n: Scalar) -> Scalar:
    """Return sigma over `stress_scale`, (h / r)^n of a depth h / r = cos theta - cos theta_1, Eqs (4) and (5).

    Its derivative needs no second power, and a stretch of no length at an end of the arc does not take log(0).
    """
    return ca.exp(n * ca.log(ca.fmax(depth, LEAST_DEPTH)))


def strength(wheel: Wheel, soil: Soil) -> tuple[Scalar, Scalar, Scalar]:
    """Return c per unit of `stress_scale`, tan phi and n, as `arc_integrals.integrate` takes them.

    The shear stress is tau = (c + sigma tan phi) times the share of it in use, Eqs (2) and (3).
    """
    return soil.c / stress_scale(wheel, soil), ca.tan(soil.phi), soil.n


def mobilised_share(j_over_k: Scalar) -> Scalar:
    """Return the share of the shear strength in use, in [-1, 1]: sgn(j) (1 - exp(-|j| / k)).

    Source: Eq (2), last factor.
    Differs from the paper: 1 - exp(-j / k) as printed grows without bound where braking makes j < 0; the sign does not.
    """
    return ca.sign(j_over_k) * -ca.expm1(-ca.fabs(j_over_k))


def mobilised_both_ways(j_over_k: Scalar) -> Scalar:
    """Return `mobilised_share` of a displacement that may turn: its slope at j = 0 is 1 too, and nothing overflows."""
    return ca.expm1(ca.fmin(j_over_k, 0.0)) - ca.expm1(-ca.fmax(j_over_k, 0.0))


def shear_law(ratio: Scalar, wheel: Wheel, soil: Soil) -> Mobilised:
    """Return the share of the strength in use at v / (r omega) = ratio, Eq (2)."""
    stiffness = wheel.r / soil.k
    return lambda s, rise: mobilised_share(stiffness * (s - ratio * rise))


def full_shear(s: Scalar, rise: Scalar) -> Scalar:
    """Return 1: all of the strength is in use, the limit k -> 0 of Eq (2) at any driving slip."""
    return 1.0
