"""Eqs (2) to (4) of the paper at one angle of the contact arc: normal stress, shear strength, and the fraction of the
strength that the slip mobilises.
"""

from collections.abc import Callable

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel

ShearLaw = Callable[[Scalar, Scalar], Scalar]
"""A function that returns the mobilised fraction of the shear strength at an angle theta of the contact arc. Its two
arguments are s = theta_1 - theta [rad] and sin theta_1 - sin theta, where theta_1 is the entry angle."""
MIN_DEPTH = 1e-300
"""Minimum ratio of depth to wheel radius in the normal stress. A smaller ratio is replaced by this value, because
log(0) is not finite."""


def modulus(wheel: Wheel, soil: Soil) -> Scalar:
    """Return the pressure modulus k_1 + k_2 b [Pa] of Eq (4): the pressure at a sinkage of one wheel width."""
    return soil.k_1 + soil.k_2 * wheel.b


def stress_scale(wheel: Wheel, soil: Soil) -> Scalar:
    """Return the unit [Pa] of the stresses in integrals over the contact arc: (k_1 + k_2 b) (r / b)^n for a wheel of
    radius r and width b.

    This is the normal stress of Eq (4) at a depth of one wheel radius. The normal stress at another depth is this unit
    times `relative_stress`.
    """
    return modulus(wheel, soil) * (wheel.r / wheel.b) ** soil.n


def relative_stress(depth: Scalar, n: Scalar) -> Scalar:
    """Return the normal stress divided by `stress_scale` [-]: depth^n for a `depth` h / r = cos theta - cos theta_1,
    the depth below the surface divided by the wheel radius.

    The power is computed as exp(n ln(h / r)), so that its derivative needs no second power. Depths below MIN_DEPTH are
    replaced by MIN_DEPTH.
    """
    return ca.exp(n * ca.log(ca.fmax(depth, MIN_DEPTH)))


def strength(wheel: Wheel, soil: Soil) -> tuple[Scalar, Scalar, Scalar]:
    """Return the constants of the soil's shear strength for `arc_integrals.integrate`: the cohesion c divided by
    `stress_scale`, tan phi of the friction angle phi, and the sinkage exponent n.

    The shear stress is tau = (c + sigma tan phi) times its mobilised fraction, Eqs (2) and (3), with the normal stress
    sigma.
    """
    return soil.c / stress_scale(wheel, soil), ca.tan(soil.phi), soil.n


def mobilised_share(j_over_k: Scalar) -> Scalar:
    """Return the mobilised fraction of the shear strength, in [-1, 1]: sgn(j) (1 - exp(-|j| / k)).

    The argument is j / k, the shear displacement j divided by the soil's shear displacement modulus k.

    Source: Eq (2), last factor. Differs from the paper: the printed 1 - exp(-j / k) grows without bound if braking
    makes j negative; this formula does not.
    """
    return ca.sign(j_over_k) * -ca.expm1(-ca.fabs(j_over_k))


def mobilised_both_ways(j_over_k: Scalar) -> Scalar:
    """Return the mobilised fraction of the shear strength as `mobilised_share` does, by a formula for shear
    displacements that may change their sign within the contact arc.

    The derivative of this formula by j / k is 1 at j = 0, and the formula does not overflow.
    """
    return ca.expm1(ca.fmin(j_over_k, 0.0)) - ca.expm1(-ca.fmax(j_over_k, 0.0))


def shear_law(ratio: Scalar, wheel: Wheel, soil: Soil) -> ShearLaw:
    """Return the shear law of Eq (2): the function that gives the mobilised fraction of the shear strength along the
    contact arc. `ratio` is the ratio of travel speed to rim speed, v / (r omega).
    """
    # j / k = (r / k) {s - (v / r omega) (sin theta_1 - sin theta)}, with s = theta_1 - theta.
    stiffness = wheel.r / soil.k
    return lambda s, rise: mobilised_share(stiffness * (s - ratio * rise))


def full_shear(s: Scalar, rise: Scalar) -> Scalar:
    """Return 1, the mobilised fraction of a fully mobilised shear strength. This is the limit of Eq (2) for a shear
    displacement modulus k of zero, at every slip of a driven wheel.
    """
    return 1.0
