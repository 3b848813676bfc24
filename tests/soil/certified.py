"""Wheel forces to 1e-10 over a stated box, Eq (4)'s and Wong and Reece's: the arc is cut where the shear needs it."""

from functools import lru_cache
from itertools import pairwise

import casadi as ca

from rover_pin.base.quantity import is_symbolic
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.arc import integrate
from rover_pin.soil.peak_stress import PeakSums, terms
from rover_pin.soil.quadrature import Graded, graded
from rover_pin.soil.slip import speed_ratio
from rover_pin.soil.stress import LEAST_DEPTH, shear_law, strength
from rover_pin.soil.traction import WheelForces, assemble

CERTIFIED = 48
"""Nodes of each stretch of `certified_forces`: 1e-10 over its stated box."""

LAYER = 20.0
"""Shear displacements k after which the strength is in full use."""

NEWTON_STEPS = 12
"""Steps towards a sign change; the approach is monotone, and quadratic but where two of them meet."""


@lru_cache(maxsize=64)
def both_graded(nodes: int) -> Graded:
    """Rule for two singular ends: d psi = 140 u^3 (1 - u)^3 du."""
    return graded(nodes, lambda u: u**4 * (35 + u * (-84 + u * (70 - 20 * u))), lambda u: 140 * (u * (1 - u)) ** 3)


def certified_forces(
    S: Scalar, theta_1: Scalar, theta_2: Scalar, wheel: Wheel, soil: Soil, nodes: int = CERTIFIED
) -> WheelForces:
    """Return the forces of `wheel_forces` with a quadrature error below 1e-10, at three to twelve times the cost.

    Box: n 0.3 to 1.6, theta_1 2 to 70 deg, theta_2 -theta_1 to 0, k 1 to 100 mm at r = 45 mm (r / k 0.45 to 45),
    phi up to 45 deg, c up to 1 kPa, S in [-1, 1]. The error is relative to the force, or to 2 % of
    r b int (|sigma| + |tau|) dtheta where a force is smaller than that because its parts cancel.

    Parameters
    ----------
    S, theta_1, theta_2 : Scalar
        As in `wheel_forces`.
    nodes : int
        Quadrature nodes of each of the four stretches (one stretch for a number S >= 0).

    Raises
    ------
    ParameterError
        `nodes` is not a whole number of 2 or more.

    Source: as `wheel_forces`. Differs from the paper: as `wheel_forces`.
    """
    ratio = speed_ratio(S)
    length = theta_1 - ca.fmax(theta_2, -theta_1)
    cuts = _cuts(ratio, theta_1, length, wheel.r / soil.k) if is_symbolic(S) or S < 0 else ()
    law, strong, rule = shear_law(ratio, wheel, soil), strength(wheel, soil), both_graded(nodes)
    ends = (0.0, *cuts, length)
    first, *later_arcs = (integrate(theta_1, a, b, law, strong, rule) for a, b in pairwise(ends))
    for stretch in later_arcs:
        first = first.plus(stretch)
    return assemble(first, theta_1, length, wheel, soil)


def certified_peak_forces(
    S: Scalar, angles: tuple[Scalar, Scalar, Scalar], wheel: Wheel, soil: Soil, nodes: int = CERTIFIED
) -> WheelForces:
    """Return the forces of `peak_stress_forces` with a quadrature error below 1e-10 in the box of `certified_forces`.

    theta_m lies within the arc, at least a tenth of it from either end; the error is measured as there.

    Parameters
    ----------
    S, angles : Scalar and tuple of Scalar
        As in `peak_stress_forces`.
    nodes : int
        Quadrature nodes of each stretch: one (S >= 0, a number) to four on either side of theta_m.

    Raises
    ------
    ParameterError
        `nodes` is not a whole number of 2 or more.

    Source and differences from the paper: as `peak_stress_forces`.
    """
    theta_1, theta_m, theta_2 = angles
    ratio, front, length = speed_ratio(S), theta_1 - theta_m, theta_1 - theta_2
    cuts = _cuts(ratio, theta_1, length, wheel.r / soil.k) if is_symbolic(S) or S < 0 else ()
    before = pairwise((0.0, *(ca.fmin(cut, front) for cut in cuts), front))
    after = pairwise((front, *(ca.fmax(cut, front) for cut in cuts), length))
    (cohesion, friction, n), law, rule = strength(wheel, soil), shear_law(ratio, wheel, soil), both_graded(nodes)
    sums = PeakSums()
    for start, end in (*before, *after):
        for psi, weight in zip(rule.psi, rule.weights, strict=True):
            s = start + (end - start) * psi
            s_front = ca.fmin(s, (length - s) * front / (length - front))  # where in front the stress is the same
            depth = ca.fmax(2 * ca.sin(theta_1 - s_front / 2) * ca.sin(s_front / 2), LEAST_DEPTH)
            sigma = ca.exp(n * ca.log(depth))
            part = terms(theta_1 - s, theta_1, sigma, cohesion + friction * sigma, law)
            sums = sums.plus(weight * (end - start), part)
    return sums.forces(wheel, soil)


def _cuts(ratio: Scalar, theta_1: Scalar, length: Scalar, stiffness: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Return the cuts of a braking arc: the sign changes of j, and the end of the layer where j / k passes 0 to -20.

    The layer ends where stiffness (slope s + bend s^2 / 2) = 20, j / r to second order behind its first zero.
    """
    s_1, s_2 = _sign_changes(ratio, theta_1, length)
    slope = ca.fmax(ratio * ca.cos(theta_1 - s_1) - 1, 1e-9)
    bend = ca.fmax(ratio * ca.sin(theta_1 - s_1), 0.0)
    depth = LAYER / stiffness
    layer = 2 * depth / (slope + ca.sqrt(slope**2 + 2 * bend * depth))
    return s_1, ca.fmin(s_1 + layer, s_2), s_2


def _sign_changes(ratio: Scalar, theta_1: Scalar, length: Scalar) -> tuple[Scalar, Scalar]:
    """Return where along s = theta_1 - theta the shear displacement s - ratio (sin theta_1 - sin theta) changes sign.

    j / (r s) = 1 - ratio m(s), with m the mean of cos theta over [theta_1 - s, theta_1], which is concave: Newton from
    either end of [0, 2 theta_1] comes to the nearer zero from outside. Any cut is harmless where there is no zero.
    """
    target = ca.fmin(1 / ca.fmax(ratio, 1e-30), 1.0)
    s_1, s_2 = 0.0 * theta_1, 2 * theta_1
    for _ in range(NEWTON_STEPS):
        s_1 = s_1 + ca.fmax(target - _mean_cosine(s_1, theta_1), 0.0) / ca.fmax(_mean_slope(s_1, theta_1), 1e-9)
        s_2 = s_2 + ca.fmax(target - _mean_cosine(s_2, theta_1), 0.0) / ca.fmin(_mean_slope(s_2, theta_1), -1e-9)
        s_1, s_2 = ca.fmin(s_1, 2 * theta_1), ca.fmax(s_2, 0.0)
    s_1 = ca.fmin(s_1, length)
    return s_1, ca.fmax(s_1, ca.fmin(s_2, length))


def _mean_cosine(s: Scalar, theta_1: Scalar) -> Scalar:
    """Return the mean of cos theta over [theta_1 - s, theta_1]."""
    half = s / 2
    return ca.cos(theta_1 - half) * _sinc(half)


def _mean_slope(s: Scalar, theta_1: Scalar) -> Scalar:
    """Return d/ds of `_mean_cosine`: (cos(theta_1 - s) - mean) / s, by its series where s is small."""
    half = ca.fmax(s / 2, 1e-4)
    return (ca.cos(theta_1 - 2 * half) - _mean_cosine(2 * half, theta_1)) / (2 * half)


def _sinc(x: Scalar) -> Scalar:
    tiny = ca.fmax(x, 1e-9)
    return ca.sin(tiny) / tiny
