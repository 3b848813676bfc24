"""Wheel loads of a rover at rest on a plane, and the wheels that do not touch the plane."""

import math
from collections.abc import Collection

import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError
from rover_pin.effects.effect import joints_called
from rover_pin.rover.forward_dynamics import constraint_rows, wheel_jacobians
from rover_pin.rover.rover import Rover
from rover_pin.rover.wheel_base import wheel_mounts

MAX_SLOPE = math.radians(80.0)
"""Largest slope of the plane [rad]. A steeper plane is refused: at 90 deg the forces that balance the weight would be
infinite."""
MIN_GAP = 1e-6
"""Smallest height of a hanging wheel's lowest point above the ground [m]. With a smaller height, the wheel counts as
touching the ground, because the linear programme has a round-off of this size."""
BALANCE_TOLERANCE = 1e-6
"""Largest residual of the static balance of a rover in equilibrium, as a fraction of its weight. A smaller residual is
round-off. A larger residual means that a pivot cannot be balanced, and raises an error."""


def wheel_loads(
    rover: Rover, slope: float, side_slope: float = 0.0, gravity: float = 9.81, hanging: Collection[str] = ()
) -> np.ndarray:
    """Return the normal load of each wheel [n] (N) of the rover at rest on a plane, at zero joint angles.

    The loads solve the balance of forces and moments on the base, and of moments on every free pivot. The torque lambda
    of the differential is a further unknown:

        S (C(q, 0) - sum_i J_i^T F_i - G^T lambda) = 0,

    where S selects the rows of base and suspension (wheels and steering are held), C is the gravity term of the
    equation of motion (Eq (8) of the paper), J_i the Jacobian of wheel i, F_i the force on wheel i, and G the
    constraint row of the differential.

    Six wheels on two rockers, two bogies and a differential are statically determinate: there are 7 equations for 6
    loads and lambda. If there are more wheels than equations, for instance four wheels on a rigid body, many solutions
    balance; the result is the solution of least norm. Springs in the rover's TOML add the torque k_s (delta - q_0) to
    their joints, where delta are the small rotations of the joints while all wheels stay on the ground.

    Parameters
    ----------
    rover : Rover
        The rover. If gravity was tilted by `rising`, the slopes are measured from the tilted horizontal.
    slope : float
        Inclination of the plane along the rover [rad], positive nose up.
    side_slope : float
        Inclination across the rover [rad], positive left side up.
    gravity : float
        Gravity [m/s^2].
    hanging : collection of str
        Names of wheels that carry no load, for instance the keys of `hanging_wheels`.

    Returns
    -------
    array [n]
        Loads normal to the plane [N]. A negative load means that the rover tips over.

    Raises
    ------
    ParameterError
        A slope is beyond 80 deg, the gravity is outside (0, 100) m/s^2, or the suspension has no equilibrium.

    Source: section 4 of the paper, "considering static balance among forces and moments". Differs from the paper: the
    balance does not determine how the wheels share the pull along the slope, and this share shifts loads through the
    pivots. Here all wheels have one ratio of traction f_t to normal load f_n, so that each ground force is vertical.

    Examples
    --------
    >>> from rover_pin import load_rover
    >>> loads = wheel_loads(load_rover("nexus6"), 0.0)
    >>> loads.shape, round(float(loads.sum() / 9.81), 3)
    ((6,), 5.8)
    """
    for name, angle in (("slope", slope), ("side_slope", side_slope)):
        if not (math.isfinite(angle) and abs(angle) <= MAX_SLOPE):
            limit = math.degrees(MAX_SLOPE)
            raise ParameterError(
                f"{name} = {math.degrees(angle):g} deg is not allowed: it must lie in [{-limit:g}, {limit:g}] deg."
            )
    if not 0.0 < gravity < 100.0:
        raise ParameterError(f"gravity = {gravity:g} m/s^2 is not allowed: it must lie in (0, 100) m/s^2.")
    # The rover is tilted together with the plane, so the third column of its rotation is the normal of the plane.
    rover = rover.under(gravity)
    q = pin.neutral(rover.model)
    rotation = pin.utils.rotate("y", -slope) @ pin.utils.rotate("x", side_slope)
    q[3:7] = pin.Quaternion(rotation).coeffs()
    lifts = _vertical_pushes(rover, q, rotation[:, 2]) * [wheel.name not in hanging for wheel in rover.wheels]
    weight = pin.computeGeneralizedGravity(rover.model, rover.model.createData(), q)
    free = rover.free_dofs
    supports = np.column_stack([lifts, constraint_rows(rover).T])[free]
    # Stiffness [N m/rad] of the springs at each degree of freedom, and the torque k_s q_0 that they have at zero angle.
    # Stiffnesses of several springs on one joint add; their common relaxed angle is the mean weighted by stiffness.
    stiffness, torque = np.zeros(rover.model.nv), np.zeros(rover.model.nv)
    dofs = {joint.idx_q: joint.idx_v for joint in list(rover.model.joints)[2:]}
    for spring in rover.springs:
        for name in joints_called(spring.joint, list(rover.angles)):
            dof = dofs[rover.angles[name]]
            stiffness[dof] += float(spring.k_s)
            torque[dof] += float(spring.k_s) * float(spring.q_0)
    relaxed = np.divide(torque, stiffness, out=torque, where=stiffness > 0.0)
    springs, rest_angles = stiffness[free], relaxed[free]
    unknown, rhs = supports, weight[free] - springs * rest_angles
    if np.any(springs):
        # With springs, the small angles of the sprung joints are further unknowns. Further equations state that these
        # angles lift no wheel off the ground and violate no constraint: supports.T @ angles = 0.
        still = np.zeros((supports.shape[1], supports.shape[1]))
        unknown = np.block([[supports, -np.diag(springs)], [still, supports.T]])
        rhs = np.concatenate([rhs, np.zeros(len(still))])
    # The residual contains forces [N] and moments [N m]. They may be compared with one tolerance, because lengths are
    # of the order of 1 m, and the residual of a rover in equilibrium is zero.
    solution, *_ = np.linalg.lstsq(unknown, rhs, rcond=1e-10)
    if np.max(np.abs(unknown @ solution - rhs)) > BALANCE_TOLERANCE * rover.mass * gravity:
        raise ParameterError(
            f"Rover '{rover.name}' cannot stand on its wheels: a pivot of its suspension stays out of balance. "
            "Give the rover a differential or a fixed joint there."
        )
    # The unknowns are vertical forces; their component along the normal is the load.
    return np.array(solution[: len(rover.wheels)] * (rotation[:, 2] @ rover.up))


def hanging_wheels(rover: Rover) -> dict[str, float]:
    """Return the wheels that do not touch level ground in equilibrium, as name -> height above the ground [m].

    The rover starts at zero angles and sinks until its lowest wheels carry it. The small motions delta of base and
    suspension solve a linear programme: minimise the potential energy w . delta (w: gravity term of the equation of
    motion), subject to gap + J delta >= 0 (no wheel's lowest point is below the ground) and G delta = 0 (all
    constraints hold). Springs are ignored.
    """
    from scipy.optimize import linprog  # imported here, because it loads sparse matrices, which a drive does not need

    q, up = pin.neutral(rover.model), np.array([0.0, 0.0, 1.0])
    low = wheel_mounts(rover, q)[1][:, 2] - rover.radii
    # Motions of the base along x and y and about z change no height, so these motions are left out.
    gaps, free = low - low.min(), [dof for dof in rover.free_dofs if dof not in (0, 1, 5)]
    weight = pin.computeGeneralizedGravity(rover.model, rover.model.createData(), q)[free]
    lifts = _vertical_pushes(rover, q, up).T[:, free]
    rows = constraint_rows(rover)[:, free]
    # Bounds of 1 m and 1 rad keep the programme finite for a rover that would sink without end.
    bounds = [(-1.0, 1.0)] * len(free)
    motion = linprog(weight / np.max(np.abs(weight)), -lifts, gaps, rows, np.zeros(len(rows)), bounds)
    heights = gaps + lifts @ motion.x if motion.success else np.zeros(len(gaps))
    return {wheel.name: float(gap) for wheel, gap in zip(rover.wheels, heights, strict=True) if gap > MIN_GAP}


def _vertical_pushes(rover: Rover, q: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the generalised force [nv, n] that an upward force of 1 N at the point of contact of each of the n wheels
    causes.

    `q` is the configuration [nq], and `normal` is the unit normal of the plane under the wheels [3].
    """
    jacobians, up = wheel_jacobians(rover, q), rover.up
    return np.column_stack(
        [
            J[:3].T @ up + J[3:].T @ np.cross(-float(wheel.wheel.r) * normal, up)
            for J, wheel in zip(jacobians, rover.wheels, strict=True)
        ]
    )
