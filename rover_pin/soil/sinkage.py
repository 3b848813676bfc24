"""Sinkage from the entry angle, Eq (5), and the entry angle that carries a load, Eq (6) solved for theta_1."""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import casadi as ca

from rover_pin.base.errors import ParameterError
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.arc_integrals import integrate
from rover_pin.soil.quadrature import FAST, entry_graded
from rover_pin.soil.slip import speed_ratio
from rover_pin.soil.stress import Mobilised, full_shear, modulus, shear_law, strength, stress_scale

STEPS = 3
"""Newton steps of `entry_angle`."""

LOAD_FLOOR = 1e-6
"""Load [N] at which the solved load levels off: a lifted wheel has a tiny arc instead of log(0)."""

UNSOLVED = 1e-6
"""Error of ln f_n from which the load counts as not carried."""

DEEPEST = math.log(math.pi / 2)
"""Greatest ln theta_1 that Newton's method tries: the wheel is sunk to its axle."""


def sinkage(theta_1: Scalar, wheel: Wheel) -> Scalar:
    """Return h [m] of the entry angle [rad]: r (1 - cos theta_1), Eq (5), without cancellation at small angles."""
    return 2 * wheel.r * ca.sin(theta_1 / 2) ** 2


ShearState = Callable[[Scalar, Wheel, Soil], Mobilised]
"""How much shear strength is in use at a slip ratio: `slipping` or `fully_sheared`."""


def slipping(S: Scalar, wheel: Wheel, soil: Soil) -> Mobilised:
    """Return the shear law at the slip ratio S, Eq (2)."""
    return shear_law(speed_ratio(S), wheel, soil)


def fully_sheared(S: Scalar, wheel: Wheel, soil: Soil) -> Mobilised:
    """Return the law of full shear, whatever the slip."""
    return full_shear


def entry_angle(
    load: Scalar, S: Scalar, wheel: Wheel, soil: Soil, steps: int = STEPS, state: ShearState = slipping
) -> Scalar:
    """Return theta_1 [rad] at which f_n carries the load, with theta_2 = -exit_ratio theta_1.

    f_n grows with theta_1 and nearly as a power of it, so Newton's method on ln f_n(e^y) = ln W starts from the power
    law and is unrolled: the result is an expression, smooth in the load and in every parameter.

    Parameters
    ----------
    load : Scalar
        W [N]; it levels off smoothly at `LOAD_FLOOR`, so a lifted wheel gives a tiny angle.
    S : Scalar
        Slip ratio [-], in [-1, 1].
    steps : int
        Newton steps; 3 leave less than 1e-9 in ln theta_1 for the soils of `parameters`, 4 for any soil tried. What
        the quadrature leaves besides: 4e-8 for S >= 0; for S < 0 1e-6 for the soils of `parameters`, 1e-4 for k = 1 mm.
    state : ShearState
        `slipping`, or `fully_sheared` for the soil's full strength.

    Raises
    ------
    ParameterError
        Numbers for which no theta_1 below 90 deg carries the load.

    Source: Eq (6), f_n "balanced to the load W". Differs from the paper: it holds theta_1.
    """
    solution = _solve_entry_angle(load, S, wheel, soil, steps, state)
    if not isinstance(solution[0], ca.DM):
        return solution[0]
    theta_1, residual = float(solution[0]), float(solution[1])
    if not abs(residual) < UNSOLVED:  # nor where it is not a number
        raise ParameterError(
            f"no entry angle below 90 deg carries load = {float(load):g} N at S = {float(S):g} on this soil "
            f"(k_1 + k_2 b = {float(modulus(wheel, soil)):g} Pa); lighten the wheel, widen it or choose a firmer soil."
        )
    return theta_1


def fitted_entry_angle(load: Scalar, S: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return `entry_angle`, of expressions NaN where none below 90 deg carries the load: fits step back from there."""
    theta_1, residual = _solve_entry_angle(load, S, wheel, soil, STEPS, slipping)
    return ca.if_else(ca.fabs(residual) < UNSOLVED, theta_1, math.nan)


def _solve_entry_angle(load: Scalar, S: Scalar, wheel: Wheel, soil: Soil, steps: int, state: ShearState) -> Any:
    """Return theta_1 and the error of ln f_n that is left."""
    fields = (wheel.r, wheel.b, soil.c, soil.phi, soil.k, soil.k_1, soil.k_2, soil.n, soil.exit_ratio)
    return _solver(steps, state)(load, S, *fields)


@lru_cache(maxsize=16)
def _solver(steps: int, state: ShearState) -> ca.Function:
    load, S, r, b, c, phi, k, k_1, k_2, n, ratio = unknowns = [ca.SX.sym(f"x_{i}") for i in range(11)]
    wheel, soil = Wheel(r, b), Soil(c=c, phi=phi, k=k, k_1=k_1, k_2=k_2, n=n, exit_ratio=ratio)
    y = ca.SX.sym("y")
    log_force = _log_normal_force(ca.exp(y), S, wheel, soil, state)
    newton = ca.Function("newton", [y, *unknowns], [log_force, ca.jacobian(log_force, y)])
    target = ca.log(ca.sqrt(ca.fmax(load, 0.0) ** 2 + LOAD_FLOOR**2))
    at = power_law_guess(target, wheel, soil)
    for _ in range(steps):
        value, slope = newton(at, *unknowns)
        at = ca.fmin(at - (value - target) / slope, DEEPEST)
    residual = newton(at, *unknowns)[0] - target
    return ca.Function("entry_angle", unknowns, [ca.exp(at), residual])


def _log_normal_force(theta_1: Scalar, S: Scalar, wheel: Wheel, soil: Soil, state: ShearState) -> Scalar:
    length = theta_1 * (1 + soil.exit_ratio)
    arc = integrate(theta_1, 0.0, length, state(S, wheel, soil), strength(wheel, soil), entry_graded(FAST))
    return ca.log(wheel.r * wheel.b * stress_scale(wheel, soil) * (arc.sigma_cos + arc.tau_sin))


def power_law_guess(log_load: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return ln theta_1 of a shallow frictionless wheel: f_n = r b scale theta_1^(2n+1) B / 2^n.

    B = int_{-ratio}^{1} (1 - x^2)^n dx, here within a few percent for ratios to 0.3.
    """
    shape = (1 + soil.n) ** -0.55 + soil.exit_ratio
    force = wheel.r * wheel.b * stress_scale(wheel, soil) * shape / 2**soil.n
    return ca.fmin((log_load - ca.log(force)) / (2 * soil.n + 1), DEEPEST)
