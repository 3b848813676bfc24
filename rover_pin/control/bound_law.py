"""The torque bounds T_sat and T_lim of one wheel, as a CasADi function of the load and of all wheel and soil constants.

T_sat is the torque at which the shear stress equals the soil's strength along the whole contact arc, and T_lim is the
torque at a slip limit. `torque_bounds.py` calls the function. Both bounds need the entry angle theta_1 at which the
soil carries the load W, the root of ln f_n(theta_1) = ln W, where f_n is the normal force of the soil. Newton's method
finds this root in y = ln theta_1. It starts from the closed solution for a power law of the pressure, and uses few
quadrature nodes. Only the last evaluation uses all nodes. From this evaluation, a Taylor series in ln W extrapolates
the torque to the given load. This costs a third of the effort of Newton steps with all nodes, so that the bounds of six
wheels and their derivatives can be computed in every period of a control loop.
"""

from functools import lru_cache
from typing import NamedTuple

import casadi as ca

from rover_pin.base.quantity import quantities
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.arc_integrals import integrate
from rover_pin.soil.quadrature import entry_graded
from rover_pin.soil.sinkage import DEEPEST, LOAD_FLOOR, power_law_guess
from rover_pin.soil.stress import ShearLaw, full_shear, strength, stress_scale
from rover_pin.soil.wheel_forces import forces

INPUTS = ("load", "slip_limit", *quantities(Wheel), *quantities(Soil))
"""Names of the inputs of `bound_law`, in their order: load [N], slip limit [-], and the constants of wheel and soil."""

OUTPUTS = ("saturation", "limit", "d_saturation", "d_limit", "refused")
"""Names of the outputs of `bound_law`, in their order: the torque bounds T_sat and T_lim [N m], their derivatives with
respect to the load [m], and `refused`, which is 1 if no entry angle carries the load, and 0 otherwise."""

NEWTON_NODES, FINAL_NODES = (6, 12), 24
"""Numbers of quadrature nodes along the contact arc: in the two Newton steps for the entry angle theta_1, and in the
last evaluation.

With these numbers, both torque bounds are accurate to 1e-10 for loads above 0.3 N, theta_1 up to 70 deg, sinkage
exponents n from 0.3 to 1.6, ratios r / k of wheel radius to shear displacement modulus up to 45, and exit ratios up to
0.9. They are accurate to 1e-8 for theta_1 up to 85 deg. The derivatives with respect to the load are accurate to 1e-6
in this range. Below 0.3 N, `contact_share` reduces the torque, because the wheel lifts.
"""

MAX_RESIDUAL = 1e-4
"""Maximum of |ln f_n - ln W| at the last evaluation of Newton's method, where f_n is the soil's normal force and W the
load. Beyond this limit, the Taylor series that follows is not accurate, and the load is refused."""

MIN_STEP_SQUARED = 1e-18
"""If the square of the last Newton step in ln f_n (the logarithm of the normal force) is below this value, the
curvature of the torque counts as 0. The difference quotient for the curvature would be 0 / 0 at a step of 0."""


class WheelLoads(NamedTuple):
    """The torque of a wheel whose entry angle is such that the soil carries the wheel's load W, and the derivative of
    the torque with respect to ln W.
    """

    torque: Scalar
    "torque T [N m] at the load W"
    slope: Scalar
    """derivative of the torque with respect to the logarithm of the load, dT / d ln W [N m]"""
    residual: Scalar
    """remaining error ln W - ln f_n at the last evaluation [-], where f_n is the normal force of the soil"""


@lru_cache(maxsize=8)
def bound_law(angles: FixedAngles | SinkageAngles) -> ca.Function:
    """Return the CasADi function that computes the torque bounds of one wheel.

    The function's input is a column of the quantities `INPUTS`, and its output is a column of the quantities `OUTPUTS`.
    `angles` states whether the entry angle depends on the load (`SinkageAngles`) or is a constant of the soil
    (`FixedAngles`).
    """
    x = ca.SX.sym("x", len(INPUTS))
    load, slip_limit, wheel, soil = unpack_inputs(x)
    # The logarithm of the load stays finite for a lifted wheel; `contact_share` takes its torque to 0.
    log_load = ca.log(ca.sqrt(ca.fmax(load, 0.0) ** 2 + LOAD_FLOOR**2))
    # Both bounds are torques of one wheel under one load; only the mobilised fraction of the soil's strength differs.
    solve = _torque_at_fixed_angles if isinstance(angles, FixedAngles) else _torque_at_sinkage
    solutions = [solve(law, log_load, wheel, soil, x) for law in (full_shear, driving_shear(slip_limit, wheel, soil))]
    # Product rule for share(W) T(ln W), so that the derivatives by the load are exact.
    share = contact_share(load)
    d_share, d_log = ca.jacobian(share, load), ca.jacobian(log_load, load)
    torques = [share * solution.torque for solution in solutions]
    derivatives = [d_share * solution.torque + share * solution.slope * d_log for solution in solutions]
    # A comparison with NaN is false, so that a load with the result NaN is refused as well.
    converged = [ca.fabs(solution.residual) < MAX_RESIDUAL for solution in solutions]
    refused = 1 - ca.logic_and(load >= 0, ca.logic_and(*converged))
    out = ca.vertcat(*torques, *derivatives, refused)
    return ca.Function("torque_bounds", [x], [ca.cse(out)], ["inputs"], ["outputs"])


def unpack_inputs(x: ca.SX) -> tuple[Scalar, Scalar, Wheel, Soil]:
    """Return the load [N], the slip limit, the wheel and the soil whose numbers are the entries of a column in the
    order of `INPUTS`.
    """
    load, slip_limit, *constants = ca.vertsplit(x)
    n_wheel = len(quantities(Wheel))
    wheel = Wheel(**dict(zip(quantities(Wheel), constants[:n_wheel], strict=True)))
    soil = Soil(**dict(zip(quantities(Soil), constants[n_wheel:], strict=True)))
    return load, slip_limit, wheel, soil


def driving_shear(S: Scalar, wheel: Wheel, soil: Soil) -> ShearLaw:
    """Return the shear law of a driven wheel at the slip S in [0, 1], Eq (2) of the paper: the function that gives the
    mobilised fraction of the shear strength along the contact arc.

    At these slips, the shear displacement of a driven wheel keeps its sign along the arc, so that Eq (2) needs no case
    distinction. The arguments of the returned function are theta_1 - theta [rad] and sin theta_1 - sin theta, for a
    point at the angle theta and the entry angle theta_1.
    """
    stiffness = wheel.r / soil.k
    return lambda s, rise: -ca.expm1(-stiffness * (s - (1 - S) * rise))


def _torque_at_fixed_angles(law: ShearLaw, log_load: Scalar, wheel: Wheel, soil: Soil, x: ca.SX) -> WheelLoads:
    """Return the torque of a wheel under the load W = exp(`log_load`) [N] if its contact angles are constants of the
    soil.

    At fixed angles, the ratio T / f_n of torque to normal force does not depend on the load. The torque is therefore W
    T / f_n, with T and f_n from one integration along the contact arc.

    Source: section 3.3 of the paper.
    """
    # The torque is proportional to the load, so that its derivative with respect to ln W is the torque itself.
    soil_forces = forces(soil.theta_1, soil.theta_2, law, wheel, soil, entry_graded(FINAL_NODES))
    torque = ca.exp(log_load) * soil_forces.torque / soil_forces.f_n
    return WheelLoads(torque, torque, 0.0 * log_load)


def _torque_at_sinkage(law: ShearLaw, log_load: Scalar, wheel: Wheel, soil: Soil, x: ca.SX) -> WheelLoads:
    """Return the torque of a wheel at the entry angle where the soil carries the load exp(`log_load`) [N], by Newton's
    method.

    A Taylor series of second order extrapolates the torque from the last Newton iterate to the given load.
    """
    # Newton's method for ln f_n(y) = ln W, at first with few quadrature nodes. The entry angle stays below 90 deg.
    y = power_law_guess(log_load, wheel, soil)
    force = slope = ca.SX(0)
    for nodes in NEWTON_NODES:
        force, _, d_force, d_torque = _evaluate_arc(law, nodes, wheel, soil, x)(y, x)
        slope = d_torque / d_force
        y = ca.fmin(y - (force - log_load) / d_force, DEEPEST)
    # The last evaluation has all nodes. Its force misses the load by `residual`, over which the torque is extrapolated.
    last, torque, d_force, d_torque = _evaluate_arc(law, FINAL_NODES, wheel, soil, x)(y, x)
    last_slope, step, residual = d_torque / d_force, last - force, log_load - last
    # The curvature follows from the slopes dT / d ln f_n at the last two iterates.
    curvature = (last_slope - slope) * step / (step**2 + MIN_STEP_SQUARED)
    return WheelLoads(
        torque + residual * (last_slope + residual * curvature / 2), last_slope + residual * curvature, residual
    )


def _evaluate_arc(law: ShearLaw, nodes: int, wheel: Wheel, soil: Soil, x: ca.SX) -> ca.Function:
    """Return the CasADi function that evaluates one wheel at a given entry angle: (y, x) -> (ln f_n, T, d ln f_n / dy,
    dT / dy).

    y is the logarithm of the entry angle theta_1 [rad], f_n is the normal force [N] and T the torque [N m]. x is the
    column of `INPUTS` on which `wheel` and `soil` depend; `nodes` is the number of quadrature nodes.
    """
    y = ca.SX.sym("y")
    # The derivatives are those of the quadrature itself, so that Newton's method converges with any number of nodes.
    theta_1 = ca.exp(y)
    arc = integrate(theta_1, 0.0, theta_1 * (1 + soil.exit_ratio), law, strength(wheel, soil), entry_graded(nodes))
    patch = wheel.r * wheel.b * stress_scale(wheel, soil)
    force, torque = ca.log(patch * (arc.sigma_cos + arc.tau_sin)), patch * wheel.r * arc.tau
    return ca.Function("point", [y, x], [force, torque, ca.jacobian(force, y), ca.jacobian(torque, y)])


def contact_share(load: Scalar) -> Scalar:
    """Return the factor of the torque bounds of a wheel: 0 for a lifted wheel, nearly 1 for a wheel under a load [N].

    In between, the factor is twice differentiable in the load, so that a controller may differentiate the torque bounds
    where a wheel lifts. For a load well above `LOAD_FLOOR`, it is about 1 - 1.5 (LOAD_FLOOR / load)^2.
    """
    pressed = ca.fmax(load / LOAD_FLOOR, 0.0)
    return (pressed / ca.sqrt(1 + pressed**2)) ** 3
