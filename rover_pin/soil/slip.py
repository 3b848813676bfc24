"""The slip ratio of a wheel, Eq (1), and the speed ratio that the shear displacement needs of it."""

from __future__ import annotations

import casadi as ca

from rover_pin.contact import Scalar

LOCKED = 1e-14
"""Least 1 + S while braking: a locked wheel slides by a finite, very large number of rim lengths."""

STILL = 1e-300
"""Least denominator of Eq (1): a wheel at rest has slip 0, not 0 / 0."""


def slip_ratio(rim: Scalar, v: Scalar, eps: Scalar = 0.0) -> Scalar:
    """Return the slip ratio S, Eq (1).

    S = (r omega - v) / max(|r omega|, |v|, eps): the two branches of Eq (1) in one, since the greater speed divides.
    Driving gives S in (0, 1], braking S in [-1, 0); a rim that turns against the travel gives up to +-2.

    Parameters
    ----------
    rim : Scalar
        Rim speed r omega [m/s], positive in the direction of travel.
    v : Scalar
        Travel speed of the wheel centre [m/s].
    eps : Scalar
        Regularising speed [m/s]: below it the slip fades to 0 with the speeds, instead of jumping between -1 and 1.

    Source: Eq (1). Differs from the paper: eps > 0 (the paper's Eq 1 is eps = 0, singular at rest); S(0, 0) = 0.
    """
    return (rim - v) / ca.fmax(ca.fmax(ca.fabs(rim), ca.fabs(v)), ca.fmax(eps, STILL))


def speed_ratio(S: Scalar) -> Scalar:
    """Return v / (r omega) [-] of a slip ratio: 1 - S driving (S >= 0), 1 / (1 + S) braking (S < 0).

    Source: Eq (1) solved for v / (r omega).
    Differs from the paper: Eq (2) prints 1 - S throughout, which is v / (r omega) for driving only.
    """
    return (1 - ca.fmax(S, 0.0)) / ca.fmax(1 + ca.fmin(S, 0.0), LOCKED)
