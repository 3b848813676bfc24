"""How the axles share the weight, and how their pulls shift it from one to another."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rover_pin.rover.constraints import constraint_rows
from rover_pin.rover.forward_dynamics import mass_matrix, wheel_jacobians
from rover_pin.rover.rover import Rover


class AxleLoads(NamedTuple):
    """Loads W = rest cos a + shift X across a rover that climbs by a, of axles that push along by X, at zero angles.

    Weight and inertia act at the same places: whatever the pushes do not overcome of the one they give to the other.
    """

    at_rest: np.ndarray
    "loads of the axles at rest on level ground (axles) [N]"
    shift: np.ndarray
    "change of the load of axle i by a forward push of axle j (axles, axles) [-]"
    place: np.ndarray
    "x of the axles from the base (axles) [m]"
    half_track: float
    "how far the wheels run from the middle [m]"


def axle_loads(rover: Rover, gravity: float) -> AxleLoads:
    """Return the axles' loads by balance of forces and moments on the base and on every free pivot.

    A push that nothing holds back accelerates the rover, and its inertia is part of the balance (d'Alembert):

        S (g(q) + M e_x sum(H) / m - sum_i J_i^T (W_i e_z + H_i e_x) - G^T lambda) = 0.

    Parameters
    ----------
    gravity : float
        m/s^2.

    Source: section 4, "static balance among forces and moments"; here with the pulls at the height of the pivots.
    """
    rover = rover.under(gravity)
    # where gravity leans along the path the rover accelerates, and its inertia takes that share up again
    rover.model.gravity.linear = rover.model.gravity.linear * np.array([0.0, 0.0, 1.0])
    q = pin.neutral(rover.model)
    lifts, pushes = (_unit_forces(rover, q, axis) for axis in np.eye(3)[[2, 0]])
    axles = np.array([wheel.axle for wheel in rover.wheels])
    member = (axles[:, None] == np.unique(axles)).astype(float)
    weight = pin.computeGeneralizedGravity(rover.model, rover.model.createData(), q)
    inertia = mass_matrix(rover, q)[:, :1] / rover.mass
    rhs = np.column_stack([weight, inertia - pushes @ (member / member.sum(axis=0))])
    free = _free_dofs(rover)
    solution, *_ = np.linalg.lstsq(np.column_stack([lifts, constraint_rows(rover).T])[free], rhs[free], rcond=1e-10)
    loads = member.T @ solution[: len(rover.wheels)]
    data = rover.model.createData()
    pin.forwardKinematics(rover.model, data, q)
    centres = np.array([data.oMi[wheel.joint].translation for wheel in rover.wheels])
    places = member.T @ centres[:, 0] / member.sum(axis=0)
    return AxleLoads(loads[:, 0], loads[:, 1:], places, float(np.mean(np.abs(centres[:, 1]))))


def _unit_forces(rover: Rover, q: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the generalised force of a newton at each wheel's lowest point [nv, n]."""
    arms = [np.cross([0.0, 0.0, -float(wheel.wheel.r)], direction) for wheel in rover.wheels]
    return np.column_stack(
        [J[:3].T @ direction + J[3:].T @ arm for J, arm in zip(wheel_jacobians(rover, q), arms, strict=True)]
    )


def _free_dofs(rover: Rover) -> list[int]:
    motor_dofs = {wheel.dof for wheel in rover.wheels} | {wheel.steer_dof for wheel in rover.wheels}
    return [place for place in range(rover.model.nv) if place not in motor_dofs]
