"""Parts of Eqs (2) and (4) at one angle of the contact arc; `arc.integrate` puts them together."""

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel


def modulus(wheel: Wheel, soil: Soil) -> Scalar:
    """Return k_1 + k_2 b [Pa], the pressure at a sinkage of one wheel width, Eq (4)."""
    return soil.k_1 + soil.k_2 * wheel.b


def mobilised(j_over_k: Scalar) -> Scalar:
    """Return the share of the shear strength in use, in [-1, 1]: sgn(j) (1 - exp(-|j| / k)).

    Source: Eq (2), last factor.
    Differs from the paper: 1 - exp(-j / k) as printed grows without bound where braking makes j < 0; the sign does not.
    """
    return ca.sign(j_over_k) * -ca.expm1(-ca.fabs(j_over_k))


def mobilised_both_ways(j_over_k: Scalar) -> Scalar:
    """Return `mobilised` of a displacement that may turn: its slope at j = 0 is 1 too, and nothing overflows."""
    return ca.expm1(ca.fmin(j_over_k, 0.0)) - ca.expm1(-ca.fmax(j_over_k, 0.0))
