"""T_sat and T_lim of one wheel as a CasADi function of the load and of every wheel and soil constant.

The load fixes theta_1 by ln f_n(e^y) = ln W. Newton's steps from the power law use few quadrature nodes; only the last
point uses all of them, and the torque is carried on from there to the load by its Taylor series in ln W. That is a
third of the work of equal steps, and lets six wheels and their derivatives fit a control loop.
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
from rover_pin.soil.stress import Mobilised, full_shear, strength, stress_scale
from rover_pin.soil.wheel_forces import forces

INPUTS = ("load", "slip_limit", *quantities(Wheel), *quantities(Soil))
"""What the bounds depend on, in the order of the law's input."""

OUTPUTS = ("saturation", "limit", "d_saturation", "d_limit", "refused")
"""T_sat, T_lim [N m], their derivatives by the load [m], and 1 where there is no bound, else 0."""

COARSE, FINE = (6, 12), 24
"""Quadrature nodes of the Newton steps and of the last point.

Both bounds are then right to 1e-10 for loads from 0.3 N (below, the lifted wheel's floor shows), theta_1 up to 70 deg,
n 0.3 to 1.6, r / k up to 45, exit ratios up to 0.9; to 1e-8 for theta_1 up to 85 deg. The derivatives by the load are
right to 1e-6 there, to 1e-10 in the usual case.
"""

CARRIED = 1e-4
"""Largest |ln f_n - ln W| at the last point for which the series is trusted."""

MIN_STEP_SQUARED = 1e-18
"""Square of the step in ln f_n below which the curvature of the torque is dropped: it would be 0 / 0."""


class Carried(NamedTuple):
    """The torque at the theta_1 that carries a load."""

    torque: Scalar
    "[N m]"
    slope: Scalar
    "d torque / d ln W [N m]"
    residual: Scalar
    "ln W - ln f_n at the last point [-]"


@lru_cache(maxsize=8)
def bound_law(angles: FixedAngles | SinkageAngles) -> ca.Function:
    """Return the function of INPUTS (a column) that gives OUTPUTS (a column)."""
    x = ca.SX.sym("x", len(INPUTS))
    load, slip_limit, wheel, soil = unpack_inputs(x)
    log_load = ca.log(ca.sqrt(ca.fmax(load, 0.0) ** 2 + LOAD_FLOOR**2))
    solve = _at_fixed_angles if isinstance(angles, FixedAngles) else _at_sinkage
    solutions = [solve(law, log_load, wheel, soil, x) for law in (full_shear, driving_shear(slip_limit, wheel, soil))]
    share = contact_share(load)
    d_share, d_log = ca.jacobian(share, load), ca.jacobian(log_load, load)
    torques = [share * solution.torque for solution in solutions]
    derivatives = [d_share * solution.torque + share * solution.slope * d_log for solution in solutions]
    # a comparison with NaN is false, so NaN is refused too
    carried = [ca.fabs(solution.residual) < CARRIED for solution in solutions]
    refused = 1 - ca.logic_and(load >= 0, ca.logic_and(*carried))
    out = ca.vertcat(*torques, *derivatives, refused)
    return ca.Function("torque_bounds", [x], [ca.cse(out)], ["inputs"], ["outputs"])


def unpack_inputs(x: ca.SX) -> tuple[Scalar, Scalar, Wheel, Soil]:
    """Return load, slip limit, wheel and soil whose quantities are the entries of a column ordered as INPUTS."""
    load, slip_limit, *constants = ca.vertsplit(x)
    n_wheel = len(quantities(Wheel))
    wheel = Wheel(**dict(zip(quantities(Wheel), constants[:n_wheel], strict=True)))
    soil = Soil(**dict(zip(quantities(Soil), constants[n_wheel:], strict=True)))
    return load, slip_limit, wheel, soil


def driving_shear(S: Scalar, wheel: Wheel, soil: Soil) -> Mobilised:
    """Return the share of the strength in use, Eq (2), for S in [0, 1], where j has one sign."""
    stiffness = wheel.r / soil.k
    return lambda s, rise: -ca.expm1(-stiffness * (s - (1 - S) * rise))


def _at_fixed_angles(law: Mobilised, log_load: Scalar, wheel: Wheel, soil: Soil, x: ca.SX) -> Carried:
    """At the soil's own angles torque and f_n keep their ratio: torque = W T / f_n, as F(S) f_n in section 3.3."""
    at = forces(soil.theta_1, soil.theta_2, law, wheel, soil, entry_graded(FINE))
    torque = ca.exp(log_load) * at.torque / at.f_n
    return Carried(torque, torque, 0.0 * log_load)


def _at_sinkage(law: Mobilised, log_load: Scalar, wheel: Wheel, soil: Soil, x: ca.SX) -> Carried:
    """theta_1 carries the load. Series about the last point; its curvature comes from the point before."""
    y = power_law_guess(log_load, wheel, soil)
    force = slope = ca.SX(0)
    for nodes in COARSE:
        force, _, d_force, d_torque = _point(law, nodes, wheel, soil, x)(y, x)
        slope = d_torque / d_force
        y = ca.fmin(y - (force - log_load) / d_force, DEEPEST)
    last, torque, d_force, d_torque = _point(law, FINE, wheel, soil, x)(y, x)
    last_slope, step, residual = d_torque / d_force, last - force, log_load - last
    curvature = (last_slope - slope) * step / (step**2 + MIN_STEP_SQUARED)
    return Carried(
        torque + residual * (last_slope + residual * curvature / 2), last_slope + residual * curvature, residual
    )


def _point(law: Mobilised, nodes: int, wheel: Wheel, soil: Soil, x: ca.SX) -> ca.Function:
    """Return the function (y = ln theta_1, x) -> ln f_n, torque and their derivatives by y."""
    y = ca.SX.sym("y")
    theta_1 = ca.exp(y)
    arc = integrate(theta_1, 0.0, theta_1 * (1 + soil.exit_ratio), law, strength(wheel, soil), entry_graded(nodes))
    patch = wheel.r * wheel.b * stress_scale(wheel, soil)
    force, torque = ca.log(patch * (arc.sigma_cos + arc.tau_sin)), patch * wheel.r * arc.tau
    return ca.Function("point", [y, x], [force, torque, ca.jacobian(force, y), ca.jacobian(torque, y)])


def contact_share(load: Scalar) -> Scalar:
    """Return 0 for a lifted wheel, 1 - 1.5 (floor / load)^2 for a loaded one, C2 between."""
    pressed = ca.fmax(load / LOAD_FLOOR, 0.0)
    return (pressed / ca.sqrt(1 + pressed**2)) ** 3
