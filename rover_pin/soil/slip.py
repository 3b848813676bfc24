"""The slip ratio of a wheel, Eq (1), sideways slip, and the ratio of travel speed to rim speed."""

import casadi as ca
import numpy as np

from rover_pin.contact import Scalar

MIN_RIM_RATIO = 1e-14
"""Minimum of 1 + S = r omega / v, the ratio of rim speed to travel speed of a braked wheel. With this minimum, v / (r
omega) stays finite for a locked wheel, although it is very large."""

ACROSS_SHARE = 0.2
"""The constant kappa of `against_travel` [-]: the fraction of the sideways speed that brakes a wheel. Seven measured
data sets on one sand allow values from 0 to 0.35."""

ROUNDING = 0.01
"""Largest slip ratio of the parabola in `positive_part`. The parabola replaces the corner of max(S, 0), so that the
slope is continuous."""

FADING_TRAVEL = 0.02
"""Minimum ratio of the travel speed to the larger of rim speed and travel speed. Below this value, `drift` fades to
zero, because a wheel that spins in place has no direction of travel."""

MIN_RATIO_POWER = 1e-64
"""Minimum that `spinning` adds to the eighth power of the ratio of the wheel's speed to its rim speed. At a ratio of
zero, a derivative would otherwise be 0 times infinity."""

STANDS = 1e-3
"""If one of rim speed, travel speed and sideways speed of a wheel is below this fraction of the largest of them, it
counts as zero."""

MIN_SPEED = 1e-300
"Minimum denominator of Eq (1) [m/s]: a wheel at rest has slip 0, not 0 / 0."


def slip_ratio(rim: Scalar, v: Scalar, eps: Scalar = 0.0) -> Scalar:
    """Return the slip ratio S of a wheel by Eq (1): the rim speed minus the travel speed, divided by the larger of the
    two.

    S = (r omega - v) / max(|r omega|, |v|, eps) contains both branches of Eq (1), because the larger speed is the
    divisor. A driven wheel has S in (0, 1], and a braked wheel has S in [-1, 0). If the rim turns against the direction
    of travel, |S| reaches up to 2.

    Parameters
    ----------
    rim : Scalar
        Rim speed r omega [m/s], positive in the direction of travel.
    v : Scalar
        Travel speed of the wheel's centre [m/s].
    eps : Scalar
        Regularising speed [m/s]. If both speeds are below eps, the slip fades to 0 with the speeds instead of jumping
        between -1 and 1.

    Source: Eq (1). Differs from the paper: eps may be positive (Eq (1) has eps = 0 and is singular at rest), and S is 0
    for a wheel at rest.
    """
    # The innermost minimum only avoids 0 / 0 for a wheel at rest.
    return (rim - v) / ca.fmax(ca.fmax(ca.fabs(rim), ca.fabs(v)), ca.fmax(eps, MIN_SPEED))


def slip_ratios(rim: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the slip ratios (n,) of a wheel by Eq (1) from arrays of its rim speed `rim` and its travel speed `v`
    [m/s], both (n,).

    The slip ratio is NaN where one of the speeds is NaN.
    """
    return np.asarray(slip_ratio(rim, v)).ravel()


def rim_and_travel(S: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rim speed r omega and the travel speed v of a wheel for its slip ratios S (n,), by Eq (1) solved for
    both speeds.

    Both results (n,) are divided by the larger of the two speeds, so that the larger speed is 1.
    """
    return 1.0 + np.minimum(S, 0.0), 1.0 - np.maximum(S, 0.0)


def speed_ratio(S: Scalar) -> Scalar:
    """Return the ratio of travel speed to rim speed, v / (r omega) [-], for a slip ratio S.

    The ratio is 1 - S for a driven wheel (S >= 0) and 1 / (1 + S) for a braked wheel (S < 0).

    Source: Eq (1) solved for v / (r omega). Differs from the paper: Eq (2) prints 1 - S for every slip, which equals v
    / (r omega) for a driven wheel only.
    """
    return (1 - ca.fmax(S, 0.0)) / ca.fmax(1 + ca.fmin(S, 0.0), MIN_RIM_RATIO)


def against_travel(S: Scalar, S_y: Scalar, share: Scalar = 1.0) -> tuple[Scalar, Scalar]:
    """Return the slip ratio S' and the sideways slip S_y' of a wheel relative to its whole travel, sideways motion
    included.

    The arguments S and S_y are the slips relative to the travel along the heading only.

        S' = (r omega - u) / max(r omega, u),   S_y' = v_y / max(r omega, u),
        u = v V / sqrt(v^2 + kappa^2 v_y^2),    V = sqrt(v^2 + v_y^2).

    Here v and v_y are the travel speeds along the heading and sideways, r omega is the rim speed, and kappa is
    ACROSS_SHARE. u is nearly V up to slip angles of 60 deg (0.94 V at 60 deg for kappa = 0.2). It falls to v / kappa at
    90 deg, because a wheel that is pushed along its axle is braked neither forwards nor backwards. u is odd in v, so
    that the law also holds in a mirror and for a wheel that reverses. For straight travel u = v = V, and S' equals S to
    the last digit. At r omega = u the law is as smooth as Eq (1).

    Parameters
    ----------
    S, S_y : Scalar
        Slip ratio along the heading, Eq (1), and sideways slip v_y / max(r omega, v) [-].
    share : Scalar
        0: the travel is v along the heading; 1: the travel is u; values between 0 and 1 interpolate linearly [-].

    Source: derived here, new, from seven measured data sets on one sand, with braked and driven wheels at slip angles
    beta up to 45 deg. Their ratio of pull to load is nearly a function of r omega / V, and their ratio of side force to
    load is nearly sin beta times a function of r omega / V. Differs from the paper: the paper's wheel runs straight.
    """
    # All speeds are ratios to the larger of r omega and v, which Eq (1) gives without a unit.
    rim, v, across = 1 + ca.fmin(S, 0.0), 1 - ca.fmax(S, 0.0), S_y * S_y
    least = MIN_RIM_RATIO * MIN_RIM_RATIO
    # The factor `turned` is u / v of the docstring; `least` avoids 0 / 0 for a wheel that spins in place.
    turned = ca.sqrt((v * v + across + least) / (v * v + ACROSS_SHARE**2 * across + least))
    u = v + share * (v * turned - v)
    faster = ca.fmax(ca.fmax(rim, u), MIN_RIM_RATIO)
    return (rim - u) / faster, S_y / faster


def pushed_aside(S: Scalar, S_y: Scalar) -> Scalar:
    """Return the degree of the push along a wheel's axle, as a fraction from 0 (travel along the heading) to 1 (travel
    along the axle) [-].

        kappa^2 v_y^2 / (u^2 + kappa^2 v_y^2)

    The arguments S and S_y are the slips that `against_travel` returns, which also defines kappa, u and the sideways
    speed v_y. The fraction is 0.03 at a slip angle of 60 deg, 0.2 at 85 deg, and 1 at 90 deg.
    """
    # Speeds are ratios to the larger of rim speed and travel speed u; the last term avoids 0 / 0 for a spinning wheel.
    u, aside = 1 - ca.fmax(S, 0.0), ACROSS_SHARE * ACROSS_SHARE * S_y * S_y
    return aside / (u * u + aside + MIN_RIM_RATIO * MIN_RIM_RATIO)


def drift(S: Scalar, S_y: Scalar) -> Scalar:
    """Return the ratio of a wheel's sideways speed to its travel speed [-]; the ratio fades to 0 for a wheel that spins
    in place.

    If S and S_y are the slips that `against_travel` returns, this ratio is about the sine of the slip angle.
    """
    # The travel speed as a ratio to the larger of rim speed and travel speed, by Eq (1).
    travel = 1 - ca.fmax(S, 0.0)
    return S_y / ca.sqrt(travel * travel + FADING_TRAVEL**2)


def spinning(S: Scalar, S_y: Scalar) -> Scalar:
    """Return the excess of a wheel's rim speed r omega above its speed V, divided by the rim speed: max(1 - V / (r
    omega), 0) [-].

    V is the larger of the travel speed v and the absolute sideways speed |v_y|. The result is S for a driven wheel that
    runs straight, and 0 for a wheel that is pushed sideways.
    """
    along, aside = 1 - ca.fmax(S, 0.0), S_y * S_y
    # For S < 0 the ratio V / (r omega) goes on growing above 1, so that `positive_part` has no corner at S = 0. The
    # eighth power makes the larger of v and |v_y| smooth.
    return positive_part(1 - (along**8 + aside**4 + MIN_RATIO_POWER) ** 0.125 * (1 - ca.fmin(S, 0.0)))


def positive_part(S: Scalar) -> Scalar:
    """Return max(S, 0), with the corner at 0 replaced by a parabola from -0.01 to 0.01, so that the slope is
    continuous.
    """
    rounded = ca.fmin(ca.fmax(S + ROUNDING, 0.0), 2 * ROUNDING)
    return rounded * rounded / (4 * ROUNDING) + ca.fmax(S - ROUNDING, 0.0)
