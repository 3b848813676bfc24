"""How a rover at rest on a plane shares its weight between its wheels."""

import math
from collections.abc import Collection

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError
from rover_pin.effects.effect import joints_called
from rover_pin.rover.constraints import constraint_rows
from rover_pin.rover.forward_dynamics import wheel_jacobians
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_mounts

STEEPEST = math.radians(80.0)
TOUCHING = 1e-6
"""Height [m] of a wheel's lowest point above the ground that is none."""
UNBALANCED = 1e-6
"""Largest share of the weight's moments that may stay unbalanced before a rover counts as unable to stand."""


def wheel_loads(
    rover: Rover, slope: float, side_slope: float = 0.0, gravity: float = 9.81, hanging: Collection[str] = ()
) -> np.ndarray:
    """Return the normal load of each wheel [n] (N) of the rover at rest on a plane, at zero joint angles.

    Balance of forces and moments on the base and of moments on every free pivot, the differential's torque lambda
    among the unknowns:

        S (C(q, 0) - sum_i J_i^T F_i - G^T lambda) = 0,   S: base and suspension; wheels and steering are held.

    Six wheels on two rockers, two bogies and a differential are determinate: 7 equations, 6 loads and lambda. Where
    wheels are too many (four on a rigid body) the loads are the solution of least norm, one of many that balance.
    Springs of the rover's TOML push the joints that they act on: k_s (delta - q_0) at the small angles delta by which
    the wheels, all on the ground, let them give way.

    Parameters
    ----------
    slope : float
        Nose-up inclination [rad], besides what the rover is `rising`.
    side_slope : float
        Inclination to the side [rad], left side up.
    gravity : float
        m/s^2.
    hanging : collection of str
        Wheels that carry nothing, as `hanging_wheels` says.

    Raises
    ------
    ParameterError
        A slope beyond 80 deg, a gravity that is not positive, or a suspension that cannot stand.

    Source: section 4, "considering static balance among forces and moments".
    Differs from the paper: balance does not tell how the wheels share the pull along the slope, which shifts loads
    through the pivots. Here every wheel uses the same f_t / f_n, so that each ground force is vertical. A negative load
    says that the rover tips over that way.
    """
    _check("slope", slope, -STEEPEST, STEEPEST)
    _check("side_slope", side_slope, -STEEPEST, STEEPEST)
    if not 0.0 < gravity < 100.0:
        raise ParameterError(f"gravity = {gravity:g} m/s^2 is not allowed: it must lie in (0, 100) m/s^2.")
    rover = rover.under(gravity)
    q = pin.neutral(rover.model)
    rotation = pin.utils.rotate("y", -slope) @ pin.utils.rotate("x", side_slope)
    q[3:7] = pin.Quaternion(rotation).coeffs()
    lifts = _vertical_pushes(rover, q, rotation[:, 2]) * [wheel.name not in hanging for wheel in rover.wheels]
    weight = pin.computeGeneralizedGravity(rover.model, rover.model.createData(), q)
    free = rover.free_dofs
    supports = np.column_stack([lifts, constraint_rows(rover).T])[free]
    springs, rest_angles = (values[free] for values in _springs(rover))
    unknown, rhs = supports, weight[free] - springs * rest_angles
    if np.any(springs):  # the joints give way by small angles, with all wheels on the ground
        still = np.zeros((supports.shape[1], supports.shape[1]))
        unknown = np.block([[supports, -np.diag(springs)], [still, supports.T]])
        rhs = np.concatenate([rhs, np.zeros(len(still))])
    # Least squares mixes N and N m: lengths and loads are of order one, and a rover that stands leaves no residual.
    solution, *_ = np.linalg.lstsq(unknown, rhs, rcond=1e-10)
    if np.max(np.abs(unknown @ solution - rhs)) > UNBALANCED * rover.mass * gravity:
        raise ParameterError(
            f"Rover '{rover.name}' cannot stand on its wheels: a pivot of its suspension stays out of balance; "
            "give it a differential or a fixed joint there."
        )
    return np.array(solution[: len(rover.wheels)] * (rotation[:, 2] @ rover.up))


def hanging_wheels(rover: Rover) -> dict[str, float]:
    """Return how far [m] above level ground the wheels hang that do not touch it, zero angles given way from.

    The rover sinks until what lies lowest carries it: min w . delta with gap + J delta >= 0 for every wheel's lowest
    point and G delta = 0, a linear programme for small motions of base and suspension; springs are left out.
    """
    from scipy.optimize import linprog  # it brings sparse matrices, which a drive has no use for

    q, up = pin.neutral(rover.model), np.array([0.0, 0.0, 1.0])
    low = wheel_mounts(rover, q)[1][:, 2] - rover.radii
    gaps, free = low - low.min(), [place for place in rover.free_dofs if place not in (0, 1, 5)]
    weight = pin.computeGeneralizedGravity(rover.model, rover.model.createData(), q)[free]
    lifts = _vertical_pushes(rover, q, up).T[:, free]
    rows = constraint_rows(rover)[:, free]
    bounds = [(-1.0, 1.0)] * len(free)
    motion = linprog(weight / np.max(np.abs(weight)), -lifts, gaps, rows, np.zeros(len(rows)), bounds)
    heights = gaps + lifts @ motion.x if motion.success else np.zeros(len(gaps))
    return {wheel.name: float(gap) for wheel, gap in zip(rover.wheels, heights, strict=True) if gap > TOUCHING}


def _springs(rover: Rover) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness [nv] (N m/rad) of the springs that the rover's TOML states, and where they are relaxed."""
    stiffness, torque = np.zeros(rover.model.nv), np.zeros(rover.model.nv)
    dofs = {joint.idx_q: joint.idx_v for joint in list(rover.model.joints)[2:]}
    for spring in rover.springs:
        for name in joints_called(spring.joint, list(rover.angles)):
            dof = dofs[rover.angles[name]]
            stiffness[dof] += float(spring.k_s)
            torque[dof] += float(spring.k_s) * float(spring.q_0)
    return stiffness, np.divide(torque, stiffness, out=torque, where=stiffness > 0.0)


def _vertical_pushes(rover: Rover, q: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the generalised force of one newton against gravity at each wheel's lowest point on the plane [nv, n]."""
    jacobians, up = wheel_jacobians(rover, q), rover.up
    return np.column_stack(
        [
            J[:3].T @ up + J[3:].T @ np.cross(-float(wheel.wheel.r) * normal, up)
            for J, wheel in zip(jacobians, rover.wheels, strict=True)
        ]
    )


def _check(name: str, angle: float, low: float, high: float) -> None:
    if not (math.isfinite(angle) and low <= angle <= high):
        degrees = [math.degrees(value) for value in (angle, low, high)]
        raise ParameterError("{} = {:g} deg is not allowed: it must lie in [{:g}, {:g}] deg.".format(name, *degrees))
