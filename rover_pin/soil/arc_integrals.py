"""Integrals of the stresses over a stretch of the contact arc, with as few operations as the quadrature allows."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from rover_pin.contact import Scalar
from rover_pin.soil.quadrature import Graded
from rover_pin.soil.stress import Mobilised, relative_stress


class Arc(NamedTuple):
    """Integrals over theta [Pa rad]; Arcs of neighbouring stretches add."""

    sigma_cos: Scalar
    tau: Scalar
    tau_cos: Scalar
    tau_sin: Scalar

    def plus(self, arc: Arc) -> Arc:
        """Return the integrals over both stretches."""
        return Arc(*(mine + theirs for mine, theirs in zip(self, arc, strict=True)))


def integrate(
    theta_1: Scalar, start: Scalar, end: Scalar, law: Mobilised, strength: tuple[Scalar, Scalar, Scalar], rule: Graded
) -> Arc:
    """Return the integrals over s = theta_1 - theta from `start` to `end` [rad].

    sigma = (k_1 + k_2 b) (h / b)^n, h = r (cos theta - cos theta_1), Eqs (4) and (5), which the paper prints at
    theta = 0 only; tau = (c + sigma tan phi) times the law, Eq (3). Nothing cancels at small angles:
    cos theta - cos theta_1 = 2 sin(theta_1 - s/2) sin(s/2), and likewise for the sine.

    Parameters
    ----------
    law : Mobilised
        `stress.shear_law(...)` or `stress.full_shear`.
    strength : tuple
        From `stress.strength(wheel, soil)`; the integrals are returned per unit of `stress_scale`.
    """
    cohesion, friction, n = strength
    cos_1, sin_1 = ca.cos(theta_1), ca.sin(theta_1)
    half_start, half_length = start / 2, (end - start) / 2
    total = Arc(0.0, 0.0, 0.0, 0.0)
    for psi, weight in zip(rule.psi, rule.weights, strict=True):
        half = half_start + half_length * psi
        chord = 2 * ca.sin(half)
        depth, rise = ca.sin(theta_1 - half) * chord, ca.cos(theta_1 - half) * chord
        cos, sin = cos_1 + depth, sin_1 - rise
        sigma = relative_stress(depth, n)
        tau = weight * (cohesion + friction * sigma) * law(2 * half, rise)
        total = total.plus(Arc(weight * sigma * cos, tau, tau * cos, tau * sin))
    return Arc(*(2 * half_length * part for part in total))
