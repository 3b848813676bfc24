"""Slope and load under each wheel as one CasADi function of the rover's posture (roll, pitch and suspension angles),
the rates of the posture, and the torques of the wheels.

The on-board slip estimate evaluates the function in C in every control period (`belief.c`).
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from rover_pin.rover.driven_loads import SHARE_ROUNDS
from rover_pin.rover.forward_dynamics import constraint_rows, supporting_dofs
from rover_pin.rover.rover import Rover
from rover_pin.simulation.native.rigid_body import inertia_places, rigid_body, tree_of

FIRST_JOINT = 2
"""Index of a rover's first joint in Pinocchio, after the universe (0) and the free base (1)."""
REGULARISATION = 1e-10
"""Regularisation of the normal equations for the wheel loads, relative to their mean diagonal entry. Where the static
balance does not determine a load, the equations would be singular without it; with it, this load is near 0."""
MIN_DIVISOR = 1e-9
"""Minimum of a load [N] or of the length of a vector [-] as a divisor. A smaller divisor is replaced by this value,
which avoids 0 / 0."""


class UnderWheels(NamedTuple):
    """The ground under all wheels and the motion of their centres in one posture of the rover. Each field has one value
    for each wheel.

    The fields are in the order of the rows in the array `under` of `belief.c`.
    """

    slope: ca.SX
    "tangent of the ground's slope along the wheel, positive with the nose up [-]"
    level: ca.SX
    "cosine of the slope: forward distance divided by distance along the ground [-]"
    load: ca.SX
    "normal force [N]"
    ahead: ca.SX
    "forward speed of the wheel's centre relative to the base [m/s]"
    rise: ca.SX
    "upward speed of the wheel's centre relative to the base [m/s]"
    swing: ca.SX
    "rate at which the mount of the wheel turns about the axle [rad/s]"
    height: ca.SX
    "height of the wheel's centre relative to the base [m]"


def ground_law(rover: Rover, places: np.ndarray) -> ca.Function:
    """Return the CasADi function that computes the slope, the load and the motion of all wheels of a rover.

    Its inputs are the posture, i.e. roll, pitch and the suspension angles [rad], the rates of the posture [rad/s], and
    the torques of the motors at the wheels [N m]. Its output is one column with the fields of `UnderWheels`. `places`
    are the indices of the suspension angles in the configuration vector q. The rover is at the origin and heads along
    x.

    The slopes equal the results of `footing`, and the loads equal the results of `driven_loads`; both are NumPy
    functions. Here the loads follow from normal equations, because CasADi can compile these. The speeds are the rates
    of the posture times the Jacobians of the wheels' centres.
    """
    posture, rates = ca.SX.sym("posture", 2 + len(places)), ca.SX.sym("rates", 2 + len(places))
    torque = ca.SX.sym("torque", len(rover.wheels))
    under = _Body.of(rover, places, posture).under_wheels(rates, torque)
    return ca.Function("ground", [posture, rates, torque], [ca.densify(ca.vertcat(*under))])


class _Body(NamedTuple):
    """A rover in one posture (roll, pitch and suspension angles), as CasADi expressions: its joints in world
    coordinates, and its weight.
    """

    rover: Rover
    turns: ca.SX
    """(3, 2 + links) axes in world coordinates about which roll, pitch and the suspension angles turn"""
    dofs: list[int]
    """indices of the suspension angles' rates in the velocity vector v"""
    axes: ca.SX
    """(3, joints) axis of each joint, a unit vector in world coordinates"""
    points: ca.SX
    """(3, joints) a point on the axis of each joint, in world coordinates [m]"""
    rotation: ca.SX
    """(3, 3) rotation matrix from the base to the world"""
    weight: ca.SX
    "(nv) generalised forces that hold the rover against gravity [N, N m]"

    @classmethod
    def of(cls, rover: Rover, places: np.ndarray, posture: ca.SX) -> _Body:
        """Return the body of a rover in a posture, by the expression that the step of the simulation also uses.

        `posture` is roll, pitch and the suspension angles [rad], and `places` are the indices of these suspension
        angles in the configuration vector q.
        """
        model, tree = rover.model, tree_of(rover.model)
        q = ca.SX(pin.neutral(model))
        q[3:7] = _quaternion(posture[0], posture[1])
        q[list(places)] = posture[2:]
        # At rest, the bias force of the equations of motion is the weight alone.
        at_rest = ca.vertcat(q, np.zeros(model.nv), np.array(model.gravity.linear))
        body = rigid_body(tree.joints, model.nq, model.nv)
        column = body(at_rest, ca.SX(0, 1), tree.parameters)
        joints = len(tree.joints) - 1
        ends = np.cumsum([len(inertia_places(tree.joints)), model.nv, 3 * joints, 3 * joints, 9]).tolist()
        _, weight, axes, points, rotation, _ = ca.vertsplit(column, [0, *ends, column.numel()])
        axes = ca.reshape(axes, 3, joints)
        # The suspension angles are given by their places in q, the joints by their degrees of freedom in v.
        dof_of = {joint.idx_q: joint.idx_v for joint in list(model.joints)[FIRST_JOINT:]}
        dofs = [dof_of[place] for place in places]
        joint_of = {joint.idx_v: i for i, joint in enumerate(list(model.joints)[FIRST_JOINT:])}
        # Pitch turns about the y axis of the world, and roll about the body's x axis, which the pitch has turned.
        rolling = ca.vertcat(ca.cos(posture[1]), 0, -ca.sin(posture[1]))
        turns = ca.horzcat(rolling, ca.SX([0, 1, 0]), *(axes[:, joint_of[dof]] for dof in dofs))
        return cls(rover, turns, dofs, axes, ca.reshape(points, 3, joints), ca.reshape(rotation, 3, 3), weight)

    def under_wheels(self, rates: ca.SX, torque: ca.SX) -> UnderWheels:
        """Return the slopes, loads and speeds of all wheels in this posture.

        `rates` are the rates of roll, pitch and suspension angles [rad/s], and `torque` the torques of the motors at
        the wheels [N m].
        """
        wheels = self.rover.wheels
        centres = [self.points[:, mount.joint - FIRST_JOINT] for mount in wheels]
        left = [self.axes[:, mount.joint - FIRST_JOINT] for mount in wheels]
        # The direction of the ground at a wheel runs from the centre of the wheel behind it to the centre of the wheel
        # ahead of it, on the same side of the rover. At the ends of a side, the wheel itself takes the place of the
        # missing neighbour. The direction lies in the plane of the wheel.
        forward = []
        for i, mount in enumerate(wheels):
            side = [j for j, other in enumerate(wheels) if other.side == mount.side]
            place = side.index(i)
            along = centres[side[max(place - 1, 0)]] - centres[side[min(place + 1, len(side) - 1)]]
            along -= ca.dot(along, left[i]) * left[i]
            forward.append(along / ca.norm_2(along))
        # A wheel's centre moves relative to the base because the suspension turns. `speed` is the velocity of the
        # centre relative to the base [m/s], and `spin` the angular velocity of the wheel's mount [rad/s].
        moves = []
        for mount, centre in zip(wheels, centres, strict=True):
            above = supporting_dofs(self.rover.model, mount.joint)
            spin = self.turns[:, :2] @ rates[:2]
            speed = ca.cross(spin, centre)
            for k, dof in enumerate(self.dofs):
                if dof in above:
                    axis, point = self.axes[:, self._joint_index(dof)], self.points[:, self._joint_index(dof)]
                    spin += axis * rates[2 + k]
                    speed += ca.cross(axis, centre - point) * rates[2 + k]
            moves.append((speed, spin))
        level = [ca.norm_2(along[:2]) for along in forward]
        return UnderWheels(
            ca.vertcat(*(along[2] / share for along, share in zip(forward, level, strict=True))),
            ca.vertcat(*level),
            self._loads(forward, left, torque),
            ca.vertcat(*(speed[0] for speed, _ in moves)),
            ca.vertcat(*(speed[2] for speed, _ in moves)),
            ca.vertcat(*(ca.dot(spin, axle) for (_, spin), axle in zip(moves, left, strict=True))),
            ca.vertcat(*(centre[2] for centre in centres)),
        )

    def _joint_index(self, dof: int) -> int:
        """Return the column of `axes` and `points` for the joint whose rate has the index `dof` in the velocity vector
        v.
        """
        return next(i for i, joint in enumerate(list(self.rover.model.joints)[FIRST_JOINT:]) if joint.idx_v == dof)

    def _generalised_force(self, joint: int, centre: ca.SX, force: ca.SX, moment: ca.SX) -> ca.SX:
        """Return the generalised force (nv,) that a force [N] and a moment [N m] at the centre of a wheel exert on the
        rover.

        By the principle of virtual work, its entry for a joint is the moment of the force about the joint's axis.
        """
        pushed = ca.SX(self.rover.model.nv, 1)
        pushed[:3] = self.rotation.T @ force
        pushed[3:6] = self.rotation.T @ (moment + ca.cross(centre, force))
        for dof in supporting_dofs(self.rover.model, joint)[6:]:
            axis, point = self.axes[:, self._joint_index(dof)], self.points[:, self._joint_index(dof)]
            pushed[dof] = ca.dot(axis, moment + ca.cross(centre - point, force))
        return pushed

    def _loads(self, forward: list[ca.SX], left: list[ca.SX], torque: ca.SX) -> ca.SX:
        """Return the loads of the wheels [N] by the static balance of the rover, as `driven_loads` computes them.

        `forward` and `left` are unit vectors along the ground and along the axle of each wheel; `torque` are the
        torques of the motors at the wheels [N m].
        """
        # Only joints that no motor holds are in balance; a motor takes any moment at the other joints.
        rover, n = self.rover, len(self.rover.wheels)
        free = rover.free_dofs
        normal = [ca.cross(along, axle) for along, axle in zip(forward, left, strict=True)]
        pull, weight, none = ca.SX(3, 1), self.weight, ca.SX(3, 1)
        lifts: list[list[ca.SX]] = [[], [], []]
        # Each wheel is driven by its thrust T / r along the ground, and carries unknown forces: its load, and in
        # proportion to the load a motion resistance and a side force. `lifts` are the generalised forces of these
        # three.
        for i, mount in enumerate(rover.wheels):
            r, centre = float(mount.wheel.r), self.points[:, mount.joint - FIRST_JOINT]
            thrust = torque[i] / r * forward[i]
            pull += thrust
            weight -= self._generalised_force(mount.joint, centre, thrust, -torque[i] * left[i])
            pushes = (normal[i], none), (-forward[i], none), (-left[i], -r * forward[i])
            for lift, push in zip(lifts, pushes, strict=True):
                lift.append(self._generalised_force(mount.joint, centre, *push)[free])
        columns = [ca.horzcat(*lift) for lift in lifts]
        # `hold` is the force that the rover needs from the ground in addition to the thrusts of its wheels.
        held, hold = constraint_rows(rover).T[free], rover.mass * rover.gravity * rover.up - pull
        share: list[ca.SX] = [ca.SX(0), ca.SX(0)]
        # The wheels share the remaining force in proportion to their loads, so both are found in turn a few times.
        for _ in range(SHARE_ROUNDS):
            unknown = ca.horzcat(columns[0] + share[0] * columns[1] + share[1] * columns[2], held)
            load = _least_squares(unknown, weight[free])[:n]
            lacking = hold - sum((load[i] * normal[i] for i in range(n)), none)
            total = ca.fmax(ca.sum1(load), MIN_DIVISOR)
            share = [-ca.dot(lacking, _mean(axes, load)) / total for axes in (forward, left)]
        return load


def _mean(axes: list[ca.SX], load: ca.SX) -> ca.SX:
    """Return the mean of the wheels' direction vectors `axes`, weighted by the loads of the wheels, as a unit
    vector.
    """
    mean = sum((ca.fmax(load[i], 0.0) * axis for i, axis in enumerate(axes)), ca.SX(3, 1))
    return mean / ca.fmax(ca.norm_2(mean), MIN_DIVISOR)


def _least_squares(A: ca.SX, b: ca.SX) -> ca.SX:
    """Return the vector x that minimises |A x - b|, by the Cholesky factor of A^T A with a small regularisation."""
    # Cholesky's algorithm with loops over the columns: CasADi then generates straight-line code for this size.
    square, n = A.T @ A, A.shape[1]
    size = ca.trace(square) / n
    L = ca.SX(n, n)
    for j in range(n):
        L[j, j] = ca.sqrt(square[j, j] + REGULARISATION * size - ca.sumsqr(L[j, :j]))
        for i in range(j + 1, n):
            L[i, j] = (square[i, j] - ca.dot(L[i, :j], L[j, :j])) / L[j, j]
    return ca.solve(L.T, ca.solve(L, A.T @ b))


def _quaternion(roll: ca.SX, pitch: ca.SX) -> ca.SX:
    """Return the quaternion (x, y, z, w) of a rotation by `roll` about x, followed by a rotation by `pitch` about y of
    the world [rad].
    """
    (a, b), (c, d) = ((ca.cos(0.5 * angle), ca.sin(0.5 * angle)) for angle in (roll, pitch))
    return ca.vertcat(b * c, a * d, -b * d, a * c)
