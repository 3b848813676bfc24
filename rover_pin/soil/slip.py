"""The slip ratio of a wheel, Eq (1), and the speed ratio that the shear displacement needs of it."""

import casadi as ca
import numpy as np

from rover_pin.contact import Scalar

LOCKED = 1e-14
"""Least 1 + S while braking: a locked wheel slides by a finite, very large number of rim lengths."""

TURNED = 0.2
"""kappa of `against_travel`: how far the whole travel brakes a wheel that goes sideways (seven measured sets of one
sand: 0 to 0.35 alike)."""

ROUNDED = 0.01
"""Slip up to which `positive_part` is rounded."""

SLOWED = 0.02
"""Travel over the faster of rim and travel below which `drift` fades: a wheel that spins in place goes nowhere."""

STANDING = 1e-64
"""The eighth power of the least V / r omega of `spinning`, where a slope would be none times infinity."""

STANDS = 1e-3
"""Share of the fastest of rim, travel and what goes along the axle below which a speed stands still."""

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


def slip_ratios(rim: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return Eq (1) of each pair of speeds [m/s] (n,); NaN where one of them is."""
    return np.asarray(slip_ratio(rim, v)).ravel()


def rim_and_travel(S: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return r omega and v over the faster of both (n,), Eq (1) solved for them."""
    return 1.0 + np.minimum(S, 0.0), 1.0 - np.maximum(S, 0.0)


def speed_ratio(S: Scalar) -> Scalar:
    """Return v / (r omega) [-] of a slip ratio: 1 - S driving (S >= 0), 1 / (1 + S) braking (S < 0).

    Source: Eq (1) solved for v / (r omega).
    Differs from the paper: Eq (2) prints 1 - S throughout, which is v / (r omega) for driving only.
    """
    return (1 - ca.fmax(S, 0.0)) / ca.fmax(1 + ca.fmin(S, 0.0), LOCKED)


def against_travel(S: Scalar, S_y: Scalar, share: Scalar = 1.0) -> tuple[Scalar, Scalar]:
    """Return slip ratio and sideways slip over the whole travel, S' and S_y', of those along the heading.

        S' = (r omega - u) / max(r omega, u),   S_y' = v_y / max(r omega, u),
        u = v V / sqrt(v^2 + kappa^2 v_y^2),    V = sqrt(v^2 + v_y^2):

    u is nearly V up to slip angles of 60 deg (kappa = 0.2: 0.94 V there), and falls to v / kappa at 90 deg, where a
    wheel pushed along its axle is braked neither way: u is odd in v, so that the law is the same in a mirror and for a
    wheel that reverses. Straight, u = v = V and S' = S to the last digit; across r omega = u it is as smooth as Eq (1).

    Parameters
    ----------
    S, S_y : Scalar
        Eq (1) along the heading and v_y / max(r omega, v) [-].
    share : Scalar
        0: the heading's v, 1: u, between them in proportion [-].

    Source: derived here, new. Seven measured sets of one sand, braked and driven to 45 deg, ask for it: their pull over
    load is nearly a function of r omega / V, their side force over load sin beta times one. Blended between v and V,
    they choose 1.2 +- 0.1 of V. Differs from the paper: its wheel runs straight.
    """
    rim, v, across = 1 + ca.fmin(S, 0.0), 1 - ca.fmax(S, 0.0), S_y * S_y
    least = LOCKED * LOCKED
    turned = ca.sqrt((v * v + across + least) / (v * v + TURNED**2 * across + least))
    u = v + share * (v * turned - v)
    faster = ca.fmax(ca.fmax(rim, u), LOCKED)
    return (rim - u) / faster, S_y / faster


def pushed_aside(S: Scalar, S_y: Scalar) -> Scalar:
    """Return kappa^2 v_y^2 / (u^2 + kappa^2 v_y^2) of slips `against_travel`: 0.03 at 60 deg, 0.2 at 85, 1 at 90."""
    u, aside = 1 - ca.fmax(S, 0.0), TURNED * TURNED * S_y * S_y
    return aside / (u * u + aside + LOCKED * LOCKED)


def drift(S: Scalar, S_y: Scalar) -> Scalar:
    """Return v_y over the travel [-], about the sine of the slip angle where S and S_y are `against_travel`."""
    travel = 1 - ca.fmax(S, 0.0)
    return S_y / ca.sqrt(travel * travel + SLOWED**2)


def spinning(S: Scalar, S_y: Scalar) -> Scalar:
    """Return max(1 - V / r omega, 0), V the greater of v and |v_y|: S driving, and 0 where a wheel is pushed aside."""
    along, aside = 1 - ca.fmax(S, 0.0), S_y * S_y
    # below rolling V / r omega goes on to grow, so that the rounding has no corner at S = 0
    return positive_part(1 - (along**8 + aside**4 + STANDING) ** 0.125 * (1 - ca.fmin(S, 0.0)))


def positive_part(S: Scalar) -> Scalar:
    """Return max(S, 0), with a parabola from -0.01 to 0.01 in place of the corner: its slope is continuous."""
    rounded = ca.fmin(ca.fmax(S + ROUNDED, 0.0), 2 * ROUNDED)
    return rounded * rounded / (4 * ROUNDED) + ca.fmax(S - ROUNDED, 0.0)
