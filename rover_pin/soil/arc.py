"""Integrals of the stresses over a stretch of the contact arc, with as few operations as the quadrature allows."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.quadrature import Graded
from rover_pin.soil.stress import mobilised, modulus

Mobilised = Callable[[Scalar, Scalar], Scalar]
"""The share of the shear strength in use, of s = theta_1 - theta and sin theta_1 - sin theta."""


LEAST_DEPTH = 1e-300
"""Of sinkage over radius, below which the stress is level."""


class Arc(NamedTuple):
    """Integrals over theta [Pa rad]; Arcs of neighbouring stretches add."""

    sigma_cos: Scalar
    tau: Scalar
    tau_cos: Scalar
    tau_sin: Scalar

    def plus(self, arc: Arc) -> Arc:
        """Return the integrals over both stretches."""
        return Arc(*(mine + theirs for mine, theirs in zip(self, arc, strict=True)))


def shear_law(ratio: Scalar, wheel: Wheel, soil: Soil) -> Mobilised:
    """Return the share of the strength in use at v / (r omega) = ratio, Eq (2)."""
    stiffness = wheel.r / soil.k
    return lambda s, rise: mobilised(stiffness * (s - ratio * rise))


def full_shear(s: Scalar, rise: Scalar) -> Scalar:
    """Return 1: all of the strength is in use, the limit k -> 0 of Eq (2) at any driving slip."""
    return 1.0


def stress_scale(wheel: Wheel, soil: Soil) -> Scalar:
    """Return (k_1 + k_2 b) (r / b)^n [Pa]: sigma = this times (cos theta - cos theta_1)^n."""
    return modulus(wheel, soil) * (wheel.r / wheel.b) ** soil.n


def strength(wheel: Wheel, soil: Soil) -> tuple[Scalar, Scalar, Scalar]:
    """Return c per unit of `stress_scale`, tan phi and n, as `integrate` takes them."""
    return soil.c / stress_scale(wheel, soil), ca.tan(soil.phi), soil.n


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
        `shear_law(...)` or `full_shear`.
    strength : tuple
        From `strength(wheel, soil)`; the integrals are returned per unit of `stress_scale`.
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
        # the derivative needs no second power, and a stretch of no length at an end of the arc must not take log(0)
        sigma = ca.exp(n * ca.log(ca.fmax(depth, LEAST_DEPTH)))
        tau = weight * (cohesion + friction * sigma) * law(2 * half, rise)
        total = total.plus(Arc(weight * sigma * cos, tau, tau * cos, tau * sin))
    return Arc(*(2 * half_length * part for part in total))
