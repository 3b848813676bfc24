"""Loads of the axles in the reduced model: the fraction of the weight that each axle carries, and the change of the
loads by the pulls of the axles.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.rover.forward_dynamics import constraint_rows, mass_matrix, wheel_jacobians
from rover_pin.rover.rover import Rover


class AxleLoads(NamedTuple):
    """The linear law for the loads W of a rover's axles on a slope: W = at_rest cos a + shift X.

    W are the loads across a rover that climbs by the angle a, and X are the forward forces of the axles along the rover
    [N]. All suspension angles are 0. The weight and the inertia force of a body both act at its centre of mass. A
    forward force that accelerates the rover therefore changes the loads like an equal forward force that balances the
    weight on a slope.
    """

    at_rest: np.ndarray
    "loads of the axles at rest on level ground (axles,) [N]"
    shift: np.ndarray
    "change of the load of axle i for a forward force of 1 N on axle j (axles, axles) [-]"
    place: np.ndarray
    "x of the axles relative to the base (axles,) [m]"
    half_track: float
    """mean lateral distance of the wheels from the middle of the rover [m]"""


def axle_loads(rover: Rover, gravity: float) -> AxleLoads:
    """Return the loads of a rover's axles by the balance of forces and moments on the base and on every free joint.

    A forward force accelerates the rover, and the inertia is part of the balance (d'Alembert's principle):

        S (g(q) + M e_x sum(H) / m - sum_i J_i^T (W_i e_z + H_i e_x) - G^T lambda) = 0.

    S selects the degrees of freedom that no motor holds. g(q) are the generalised forces of gravity, M is the mass
    matrix, m the mass, J_i the Jacobian of the lowest point of wheel i, and W_i and H_i are its load and its forward
    force. G lambda are the forces of the rocker differential and of couplings.

    Parameters
    ----------
    rover : Rover
        The rover.
    gravity : float
        Gravity [m/s^2].

    Source: section 4 of the paper, "static balance among forces and moments". Differs from the paper: the forward
    forces of the wheels are included.
    """
    rover = rover.under(gravity)
    # Only the vertical part of gravity counts. A part along the path accelerates the rover, and its inertia balances
    # it.
    rover.model.gravity.linear = rover.model.gravity.linear * np.array([0.0, 0.0, 1.0])
    q = pin.neutral(rover.model)
    # Generalised forces (nv, wheels) of 1 N upwards and of 1 N forwards at the lowest point of each wheel.
    arms = [np.array([0.0, 0.0, -float(wheel.wheel.r)]) for wheel in rover.wheels]
    jacobians = wheel_jacobians(rover, q)
    lifts, pushes = (
        np.column_stack(
            [J[:3].T @ axis + J[3:].T @ np.cross(arm, axis) for J, arm in zip(jacobians, arms, strict=True)]
        )
        for axis in np.eye(3)[[2, 0]]
    )
    # The forces of the wheels are summed by axle, because the reduced model has one load for each axle.
    axles = np.array([wheel.axle for wheel in rover.wheels])
    member = (axles[:, None] == np.unique(axles)).astype(float)
    # Right-hand sides: the weight, and for each axle a force of 1 N that its wheels share, with the inertia.
    weight = pin.computeGeneralizedGravity(rover.model, rover.model.createData(), q)
    inertia = mass_matrix(rover, q)[:, :1] / rover.mass
    rhs = np.column_stack([weight, inertia - pushes @ (member / member.sum(axis=0))])
    # If the balance does not determine the loads uniquely, as with three axles on a rigid body, the solution with the
    # smallest sum of squares is taken.
    free = rover.free_dofs
    solution, *_ = np.linalg.lstsq(np.column_stack([lifts, constraint_rows(rover).T])[free], rhs[free], rcond=1e-10)
    loads = member.T @ solution[: len(rover.wheels)]
    # The positions of the axles along the rover, with all suspension angles at 0.
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, q)
    centres = np.array([data.oMi[wheel.joint].translation for wheel in rover.wheels])
    places = member.T @ centres[:, 0] / member.sum(axis=0)
    return AxleLoads(loads[:, 0], loads[:, 1:], places, float(np.mean(np.abs(centres[:, 1]))))
