"""Integrals of the normal stress and the shear stress along a part of a wheel's contact arc, computed with as few
operations as possible.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from rover_pin.contact import Scalar
from rover_pin.soil.quadrature import QuadratureRule
from rover_pin.soil.stress import ShearLaw, relative_stress


class Arc(NamedTuple):
    """Integrals of the normal stress sigma and the shear stress tau over the angle theta [rad] along a part of a
    wheel's contact arc.

    The stresses are divided by `stress_scale`, so that an integral is in [rad]. The integrals of a longer arc are the
    sums of the integrals of its parts.
    """

    sigma_cos: Scalar
    """int sigma cos theta dtheta: proportional to the part of the normal force that the normal stress carries"""
    tau: Scalar
    """int tau dtheta: proportional to the torque about the axle"""
    tau_cos: Scalar
    """int tau cos theta dtheta: proportional to the thrust"""
    tau_sin: Scalar
    """int tau sin theta dtheta: proportional to the part of the normal force that the shear stress carries"""

    def plus(self, arc: Arc) -> Arc:
        """Return the integrals over two parts of the contact arc together: the sum of these integrals and the integrals
        of `arc`.
        """
        return Arc(*(mine + theirs for mine, theirs in zip(self, arc, strict=True)))


def integrate(
    theta_1: Scalar,
    start: Scalar,
    end: Scalar,
    law: ShearLaw,
    strength: tuple[Scalar, Scalar, Scalar],
    rule: QuadratureRule,
) -> Arc:
    """Return the integrals of the normal stress and the shear stress over a part of a wheel's contact arc.

    The normal stress at the angle theta is sigma = (k_1 + k_2 b) (h / b)^n with the depth h = r (cos theta - cos
    theta_1), Eqs (4) and (5) of the paper, for a wheel of radius r and width b. (The paper prints this depth for theta
    = 0 only.) The shear stress is tau = (c + sigma tan phi) times the mobilised fraction of the shear strength, Eq (3),
    which the argument `law` gives.

    Parameters
    ----------
    theta_1 : Scalar
        Entry angle [rad], at which the rim enters the soil.
    start, end : Scalar
        Ends of the part of the arc, as angles s = theta_1 - theta from the entry [rad].
    law : ShearLaw
        Function that returns the mobilised fraction of the shear strength: `stress.shear_law(...)` or
        `stress.full_shear`.
    strength : tuple
        The cohesion c divided by `stress_scale`, tan phi, and the sinkage exponent n, as `stress.strength(wheel, soil)`
        returns them. The integrals are in units of `stress_scale` too.
    rule : QuadratureRule
        Nodes and weights of the quadrature on [0, 1].
    """
    cohesion, friction, n = strength
    # The angle s is measured from the entry angle, where the stress begins, so that small arcs lose no digits.
    cos_1, sin_1 = ca.cos(theta_1), ca.sin(theta_1)
    half_start, half_length = start / 2, (end - start) / 2
    total = Arc(0.0, 0.0, 0.0, 0.0)
    for psi, weight in zip(rule.psi, rule.weights, strict=True):
        half = half_start + half_length * psi
        # The differences of cosines and sines to those of the entry, as products that lose no digits at small angles:
        # cos theta - cos theta_1 = 2 sin(theta_1 - s/2) sin(s/2).
        chord = 2 * ca.sin(half)
        depth, rise = ca.sin(theta_1 - half) * chord, ca.cos(theta_1 - half) * chord
        cos, sin = cos_1 + depth, sin_1 - rise
        # Stress and strength at this node, in units of `stress_scale`.
        sigma = relative_stress(depth, n)
        tau = weight * (cohesion + friction * sigma) * law(2 * half, rise)
        total = total.plus(Arc(weight * sigma * cos, tau, tau * cos, tau * sin))
    # The nodes are on [0, 1]; the length of the part turns the sums into integrals over the angle.
    return Arc(*(2 * half_length * part for part in total))
