"""Sinkage from the entry angle, Eq (5), and the entry angle at which the soil carries a load: Eq (6), the normal force,
solved for theta_1.
"""

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
from rover_pin.soil.stress import ShearLaw, full_shear, modulus, shear_law, strength, stress_scale

NEWTON_STEPS = 3
"""Default number of Newton steps of `entry_angle`."""

LOAD_FLOOR = 1e-6
"""Minimum load [N] in `entry_angle`. Smaller loads are smoothly replaced by about this load, so that a lifted wheel has
a tiny contact arc and the logarithm of its load is finite."""

MAX_LOAD_ERROR = 1e-6
"""Maximum remaining error of ln f_n, the logarithm of the normal force, after Newton's method. If the error is larger,
the method has failed, because no entry angle below 90 deg carries the load."""

DEEPEST = math.log(math.pi / 2)
"""Largest ln theta_1 that Newton's method tries. The entry angle theta_1 is then 90 deg: the wheel has sunk to its
axle."""


def sinkage(theta_1: Scalar, wheel: Wheel) -> Scalar:
    """Return the sinkage h [m] of a wheel with the entry angle theta_1 [rad] by Eq (5), h = r (1 - cos theta_1), with
    the wheel radius r.

    The formula is rewritten with sin(theta_1 / 2), which loses no digits at small angles.
    """
    return 2 * wheel.r * ca.sin(theta_1 / 2) ** 2


ShearState = Callable[[Scalar, Wheel, Soil], ShearLaw]
"""A function that returns the shear law of a wheel from its slip ratio: `slipping` or `fully_sheared`."""


def slipping(S: Scalar, wheel: Wheel, soil: Soil) -> ShearLaw:
    """Return the shear law of a wheel at the slip ratio S, Eq (2): the function that gives the mobilised fraction of
    the soil's shear strength along the contact arc.
    """
    return shear_law(speed_ratio(S), wheel, soil)


def fully_sheared(S: Scalar, wheel: Wheel, soil: Soil) -> ShearLaw:
    """Return the shear law of a wheel on soil whose shear strength is fully mobilised, at every slip ratio S."""
    return full_shear


def entry_angle(
    load: Scalar, S: Scalar, wheel: Wheel, soil: Soil, steps: int = NEWTON_STEPS, state: ShearState = slipping
) -> Scalar:
    """Return the entry angle theta_1 [rad] at which the normal force f_n of the soil on a wheel equals the load W.

    The exit angle is theta_2 = -exit_ratio theta_1 with the soil's exit_ratio. f_n grows with theta_1, nearly as a
    power of theta_1. Newton's method therefore solves ln f_n = ln W for y = ln theta_1, and starts from the solution
    for a power law (`power_law_guess`). The number of Newton steps is fixed, so that the result is an expression that
    is smooth in W and in every parameter.

    Parameters
    ----------
    load : Scalar
        Load W [N]. Loads below `LOAD_FLOOR` are smoothly replaced by about this value, so that a lifted wheel has a
        tiny angle.
    S : Scalar
        Slip ratio [-], in [-1, 1].
    wheel, soil : Wheel, Soil
        Dimensions of the wheel and constants of the soil.
    steps : int
        Number of Newton steps. Three steps leave an error below 1e-9 in ln theta_1 for the soils of `parameters`, and
        four steps for every soil that was tried. The quadrature adds an error of 4e-8 for S >= 0. For S < 0, it adds
        1e-6 for the soils of `parameters`, and 1e-4 for a shear displacement modulus k = 1 mm.
    state : ShearState
        `slipping` for the shear strength that the slip S mobilises, or `fully_sheared` for the soil's full strength.

    Raises
    ------
    ParameterError
        No entry angle below 90 deg carries the load. This is checked only if the arguments are numbers.

    Source: Eq (6), the normal force f_n, which is "balanced to the load W". Differs from the paper: the paper holds
    theta_1 constant.

    Examples
    --------
    >>> from rover_pin import SOILS
    >>> from rover_pin.rover.rover import load_rover
    >>> wheel = load_rover("nexus6").wheels[0].wheel
    >>> [round(math.degrees(entry_angle(load, 0.2, wheel, SOILS["table-1"])), 1) for load in (10.0, 20.0)]
    [35.6, 45.4]
    """
    # A result that is an expression cannot be checked here; `fitted_entry_angle` has a check for expressions.
    solution = _solve_entry_angle(load, S, wheel, soil, steps, state)
    if not isinstance(solution[0], ca.DM):
        return solution[0]
    theta_1, residual = float(solution[0]), float(solution[1])
    if not abs(residual) < MAX_LOAD_ERROR:  # negated, so that a residual that is not a number is refused too
        raise ParameterError(
            f"The soil is too soft: no entry angle below 90 deg carries the wheel's load = {float(load):g} N at the "
            f"slip S = {float(S):g} (k_1 + k_2 b = {float(modulus(wheel, soil)):g} Pa). Lighten the wheel, widen it or "
            "choose a firmer soil."
        )
    return theta_1


def fitted_entry_angle(load: Scalar, S: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return the entry angle [rad] at which the soil carries the load [N], as `entry_angle` does, for models that are
    fitted.

    The result is NaN if no angle below 90 deg carries the load, so that a least-squares fit reduces its step.
    """
    theta_1, residual = _solve_entry_angle(load, S, wheel, soil, NEWTON_STEPS, slipping)
    return ca.if_else(ca.fabs(residual) < MAX_LOAD_ERROR, theta_1, math.nan)


def _solve_entry_angle(load: Scalar, S: Scalar, wheel: Wheel, soil: Soil, steps: int, state: ShearState) -> Any:
    """Return the entry angle theta_1 [rad] that Newton's method finds for a load [N], and the remaining error of ln
    f_n, the logarithm of the normal force.
    """
    fields = (wheel.r, wheel.b, soil.c, soil.phi, soil.k, soil.k_1, soil.k_2, soil.n, soil.exit_ratio)
    return _solver(steps, state)(load, S, *fields)


@lru_cache(maxsize=16)
def _solver(steps: int, state: ShearState) -> ca.Function:
    """Return Newton's method for `entry_angle` as a CasADi function.

    Its inputs are the load, the slip ratio and all constants of wheel and soil; its outputs are the entry angle and the
    remaining error of the logarithm of the normal force. The function is stored for later calls.
    """
    # All constants are symbols, so that one function serves every wheel and soil.
    load, S, r, b, c, phi, k, k_1, k_2, n, ratio = unknowns = [ca.SX.sym(f"x_{i}") for i in range(11)]
    wheel, soil = Wheel(r, b), Soil(c=c, phi=phi, k=k, k_1=k_1, k_2=k_2, n=n, exit_ratio=ratio)
    y = ca.SX.sym("y")
    # ln f_n at the entry angle e^y, with the exit angle in its fixed ratio to it.
    theta_1 = ca.exp(y)
    length, law = theta_1 * (1 + soil.exit_ratio), state(S, wheel, soil)
    arc = integrate(theta_1, 0.0, length, law, strength(wheel, soil), entry_graded(FAST))
    log_force = ca.log(wheel.r * wheel.b * stress_scale(wheel, soil) * (arc.sigma_cos + arc.tau_sin))
    newton = ca.Function("newton", [y, *unknowns], [log_force, ca.jacobian(log_force, y)])
    # Loads below LOAD_FLOOR are smoothly replaced by about this value, because Newton's target is the load's logarithm.
    target = ca.log(ca.sqrt(ca.fmax(load, 0.0) ** 2 + LOAD_FLOOR**2))
    at = power_law_guess(target, wheel, soil)
    for _ in range(steps):
        value, slope = newton(at, *unknowns)
        # A step beyond the axle would leave the range of Eq (5).
        at = ca.fmin(at - (value - target) / slope, DEEPEST)
    # The remaining error after the last step shows whether the method has converged.
    residual = newton(at, *unknowns)[0] - target
    return ca.Function("entry_angle", unknowns, [ca.exp(at), residual])


def power_law_guess(log_load: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return the initial guess for Newton's method in `entry_angle`: the logarithm of the entry angle at which a wheel
    without shear stress carries the load exp(`log_load`) [N].

    At small angles, the normal force of this wheel is

        f_n = r b scale theta_1^(2n+1) B / 2^n,   B = int_{-ratio}^{1} (1 - x^2)^n dx

    where r is the wheel radius, b the width, scale the `stress_scale`, ratio the soil's exit_ratio, and n the sinkage
    exponent. B is approximated to a few percent for exit ratios up to 0.3.
    """
    # `shape` approximates B, and the limit keeps the guess at or above the axle.
    shape = (1 + soil.n) ** -0.55 + soil.exit_ratio
    force = wheel.r * wheel.b * stress_scale(wheel, soil) * shape / 2**soil.n
    return ca.fmin((log_load - ca.log(force)) / (2 * soil.n + 1), DEEPEST)
