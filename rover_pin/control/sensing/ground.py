"""What posture, its rates and the driving torques say of the ground under each wheel, as one compiled expression."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from rover_pin.rover.constraints import constraint_rows
from rover_pin.rover.driven_loads import SHARES
from rover_pin.rover.forward_dynamics import supporting_dofs
from rover_pin.rover.rover import Rover
from rover_pin.simulation.native.rigid_body import inertia_places, rigid_body, tree_of

BASE = 2
"""Pinocchio's first joint behind universe and base."""
ROUND_OFF = 1e-10
"""Share of the equations' size that holds loads which statics leave open near 0."""
NOTHING = 1e-9


class UnderWheels(NamedTuple):
    """Rows of wheels, as the C of `belief.c` takes them."""

    slope: ca.SX
    "tangent of the ground's inclination along the wheel, nose-up positive [-]"
    level: ca.SX
    "cosine of it: share of the way along the ground that is a way forwards [-]"
    load: ca.SX
    "normal force [N]"
    ahead: ca.SX
    "forward speed of the wheel's centre against the base [m/s]"
    rise: ca.SX
    "its upward speed against the base [m/s]"
    swing: ca.SX
    "rate at which its mount turns about the axle [rad/s]"
    height: ca.SX
    "of the centre against the base [m]"


def ground_law(rover: Rover, places: np.ndarray) -> ca.Function:
    """Return the function (posture, its rates, torques) -> `UnderWheels` in one column.

    Posture is roll, pitch and the suspension angles at `places` in q [rad]; torques [N m] are those at the wheels. The
    rover heads along x from the origin. Slopes are those of `footing`, loads those of `driven_loads`, least squares by
    their normal equations; speeds are rates of the posture times the Jacobians of the wheels' centres.
    """
    posture, rates = ca.SX.sym("posture", 2 + len(places)), ca.SX.sym("rates", 2 + len(places))
    torque = ca.SX.sym("torque", len(rover.wheels))
    under = _Body.of(rover, places, posture).under_wheels(rates, torque)
    return ca.Function("ground", [posture, rates, torque], [ca.densify(ca.vertcat(*under))])


class _Body(NamedTuple):
    """A posture of a rover: where its joints are, in the world."""

    rover: Rover
    turns: ca.SX
    "axes about which roll, pitch and the suspension angles turn (3 x 2 + links)"
    dofs: list[int]
    "of the suspension angles"
    axes: ca.SX
    points: ca.SX
    rotation: ca.SX
    weight: ca.SX

    @classmethod
    def of(cls, rover: Rover, places: np.ndarray, posture: ca.SX) -> _Body:
        """Return the body in a posture, by the expression that the simulator's step is made of."""
        model, tree = rover.model, tree_of(rover.model)
        q = ca.SX(pin.neutral(model))
        q[3:7] = _quaternion(posture[0], posture[1])
        q[list(places)] = posture[2:]
        at_rest = ca.vertcat(q, np.zeros(model.nv), np.array(model.gravity.linear))
        body = rigid_body(tree.joints, model.nq, model.nv)
        column = body(at_rest, ca.SX(0, 1), tree.parameters)
        joints = len(tree.joints) - 1
        ends = np.cumsum([len(inertia_places(tree.joints)), model.nv, 3 * joints, 3 * joints, 9]).tolist()
        _, weight, axes, points, rotation, _ = ca.vertsplit(column, [0, *ends, column.numel()])
        axes = ca.reshape(axes, 3, joints)
        dof_of = {joint.idx_q: joint.idx_v for joint in list(model.joints)[BASE:]}
        dofs = [dof_of[place] for place in places]
        joint_of = {joint.idx_v: i for i, joint in enumerate(list(model.joints)[BASE:])}
        rolling = ca.vertcat(ca.cos(posture[1]), 0, -ca.sin(posture[1]))
        turns = ca.horzcat(rolling, ca.SX([0, 1, 0]), *(axes[:, joint_of[dof]] for dof in dofs))
        return cls(rover, turns, dofs, axes, ca.reshape(points, 3, joints), ca.reshape(rotation, 3, 3), weight)

    def under_wheels(self, rates: ca.SX, torque: ca.SX) -> UnderWheels:
        """Return what is under the wheels."""
        wheels = self.rover.wheels
        centres = [self.points[:, mount.joint - BASE] for mount in wheels]
        left = [self.axes[:, mount.joint - BASE] for mount in wheels]
        forward = self._forward(centres, left)
        moves = [self._rates_of(mount.joint, centre, rates) for mount, centre in zip(wheels, centres, strict=True)]
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

    def _forward(self, centres: list[ca.SX], left: list[ca.SX]) -> list[ca.SX]:
        """Return the way along the ground of each wheel: from the centre behind to the one before, on its side."""
        forward = []
        for i, mount in enumerate(self.rover.wheels):
            side = [j for j, other in enumerate(self.rover.wheels) if other.side == mount.side]
            at = side.index(i)
            along = centres[side[max(at - 1, 0)]] - centres[side[min(at + 1, len(side) - 1)]]
            along -= ca.dot(along, left[i]) * left[i]
            forward.append(along / ca.norm_2(along))
        return forward

    def _rates_of(self, joint: int, centre: ca.SX, rates: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return the speed of a wheel's centre against the base, and how its mount turns."""
        above = supporting_dofs(self.rover.model, joint)
        spin = self.turns[:, :2] @ rates[:2]
        speed = ca.cross(spin, centre)
        for k, dof in enumerate(self.dofs):
            if dof in above:
                axis, point = self.axes[:, self._place(dof)], self.points[:, self._place(dof)]
                spin += axis * rates[2 + k]
                speed += ca.cross(axis, centre - point) * rates[2 + k]
        return speed, spin

    def _place(self, dof: int) -> int:
        return next(i for i, joint in enumerate(list(self.rover.model.joints)[BASE:]) if joint.idx_v == dof)

    def _work(self, joint: int, centre: ca.SX, force: ca.SX, moment: ca.SX) -> ca.SX:
        """Return the generalized force of a force and a moment at a wheel's centre."""
        pushed = ca.SX(self.rover.model.nv, 1)
        pushed[:3] = self.rotation.T @ force
        pushed[3:6] = self.rotation.T @ (moment + ca.cross(centre, force))
        for dof in supporting_dofs(self.rover.model, joint)[6:]:
            axis, point = self.axes[:, self._place(dof)], self.points[:, self._place(dof)]
            pushed[dof] = ca.dot(axis, moment + ca.cross(centre - point, force))
        return pushed

    def _loads(self, forward: list[ca.SX], left: list[ca.SX], torque: ca.SX) -> ca.SX:
        """Return the loads of `driven_loads`."""
        rover, n = self.rover, len(self.rover.wheels)
        free = rover.free_dofs
        normal = [ca.cross(along, axle) for along, axle in zip(forward, left, strict=True)]
        pull, weight, none = ca.SX(3, 1), self.weight, ca.SX(3, 1)
        lifts: list[list[ca.SX]] = [[], [], []]
        for i, mount in enumerate(rover.wheels):
            r, centre = float(mount.wheel.r), self.points[:, mount.joint - BASE]
            thrust = torque[i] / r * forward[i]
            pull += thrust
            weight -= self._work(mount.joint, centre, thrust, -torque[i] * left[i])
            pushes = (normal[i], none), (-forward[i], none), (-left[i], -r * forward[i])
            for lift, push in zip(lifts, pushes, strict=True):
                lift.append(self._work(mount.joint, centre, *push)[free])
        columns = [ca.horzcat(*lift) for lift in lifts]
        held, hold = constraint_rows(rover).T[free], rover.mass * rover.gravity * rover.up - pull
        share: list[ca.SX] = [ca.SX(0), ca.SX(0)]
        for _ in range(SHARES):
            unknown = ca.horzcat(columns[0] + share[0] * columns[1] + share[1] * columns[2], held)
            load = _least_squares(unknown, weight[free])[:n]
            lacking = hold - sum((load[i] * normal[i] for i in range(n)), none)
            total = ca.fmax(ca.sum1(load), NOTHING)
            share = [-ca.dot(lacking, _mean(axes, load)) / total for axes in (forward, left)]
        return load


def _mean(axes: list[ca.SX], load: ca.SX) -> ca.SX:
    mean = sum((ca.fmax(load[i], 0.0) * axis for i, axis in enumerate(axes)), ca.SX(3, 1))
    return mean / ca.fmax(ca.norm_2(mean), NOTHING)


def _least_squares(A: ca.SX, b: ca.SX) -> ca.SX:
    """Return x of least |A x - b|, and of those the least, by Cholesky's factors of A^T A."""
    square, n = A.T @ A, A.shape[1]
    size = ca.trace(square) / n
    L = ca.SX(n, n)
    for j in range(n):
        L[j, j] = ca.sqrt(square[j, j] + ROUND_OFF * size - ca.sumsqr(L[j, :j]))
        for i in range(j + 1, n):
            L[i, j] = (square[i, j] - ca.dot(L[i, :j], L[j, :j])) / L[j, j]
    return ca.solve(L.T, ca.solve(L, A.T @ b))


def _quaternion(roll: ca.SX, pitch: ca.SX) -> ca.SX:
    """Return (x, y, z, w) of first a roll, then a pitch, both about the world's axes."""
    (a, b), (c, d) = ((ca.cos(0.5 * angle), ca.sin(0.5 * angle)) for angle in (roll, pitch))
    return ca.vertcat(b * c, a * d, -b * d, a * c)
