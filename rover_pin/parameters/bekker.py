"""Bekker's pressure-sinkage constants as the k_1, k_2 of Eq (4)."""

from __future__ import annotations

from rover_pin.contact import Scalar, Soil


def bekker(k_c: Scalar, k_phi: Scalar, n: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
    """Return k_1 [Pa], k_2 [Pa/m] of Eq (4) for a wheel of width b [m].

    Bekker's p = (k_c / b + k_phi) z^n is Eq (4)'s (k_1 + k_2 b) (z / b)^n with k_1 = k_c b^(n-1), k_2 = k_phi b^(n-1):
    the constants of Eq (4) belong to a width unless n = 1.

    Parameters
    ----------
    k_c : Scalar
        Cohesive modulus [N/m^(n+1)].
    k_phi : Scalar
        Frictional modulus [N/m^(n+2)].

    Source: M. G. Bekker, Introduction to Terrain-Vehicle Systems (1969); Eq (4) in Reece's form.
    """
    return k_c * b ** (n - 1), k_phi * b ** (n - 1)


def at_width(soil: Soil, b: Scalar, made_for: Scalar) -> Soil:
    """Return a soil converted by `bekker` for the width `made_for` [m], for a wheel of width b [m] instead."""
    return soil.replace(k_1=soil.k_1 * (b / made_for) ** (soil.n - 1), k_2=soil.k_2 * (b / made_for) ** (soil.n - 1))
