"""Greater and lesser of two, exact or rounded: for derivatives that shall not jump."""

import casadi as ca

from rover_pin.contact import Scalar


def greater(a: Scalar, b: Scalar, eps: float) -> Scalar:
    """Return (a + b + sqrt((a - b)^2 + eps^2)) / 2, at most eps / 2 above the greater; exactly that for eps = 0."""
    return ca.fmax(a, b) if eps == 0.0 else 0.5 * (a + b + ca.sqrt((a - b) ** 2 + eps**2))


def lesser(a: Scalar, b: Scalar, eps: float) -> Scalar:
    """Return the rounded lesser of the two."""
    return -greater(-a, -b, eps)
