"""The rover's rigid body as CasADi expressions, one pass over Pinocchio's loaded model.

Every number of the model (placements, inertias) that is not 0, 1 or -1 stays a parameter, so that rovers of one tree
share one compiled function, whatever they carry. Source: Featherstone, Rigid Body Dynamics Algorithms (2008), tables
5.1 (recursive Newton-Euler) and 6.2 (composite rigid bodies).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

ROUND_OFF = 1e-15
"""Share of a placement's or an inertia's largest number below which the others are nothing."""
SAME = 1e-13
"""Share of a wheel's inertia to which it is one of revolution."""
BASE = 1


@dataclass(frozen=True)
class Joint:
    """A joint whose frame is turned so that its axis is x: what of it decides the generated code."""

    parent: int
    q: int
    v: int
    turns_freely: bool
    "unbounded: its place in q is a cosine and a sine"
    revolves: bool
    "nothing changes as it turns: it bears nothing and is a body of revolution about its axis"
    numbers: tuple[int | None, ...]
    "rotation (9), translation (3), mass, mass times lever (3), inertia about the joint (6): 0, 1, -1, or a parameter"


class Tree(NamedTuple):
    """A rigid body in two parts: what is compiled, and the parameters of it."""

    joints: tuple[Joint, ...]
    parameters: np.ndarray


class Motion(NamedTuple):
    """Pinocchio's quantities of a tree, as expressions of q, v and gravity."""

    inertia: Any
    "upper triangle of the joint-space inertia, without rotors"
    bias: Any
    "nonlinear effects: Coriolis, centrifugal and gravity"
    axes: Any
    "of every joint but the base, in the world (3 x joints)"
    points: Any
    "where these axes are (3 x joints)"
    rotation: Any
    "of the base (3 x 3)"
    potential: Any


def tree_of(model: pin.Model) -> Tree:
    """Return a model with a free base and revolute joints as a tree, bodies' frames turned to their joints' axes."""
    assert model.jointPlacements[BASE].isIdentity(), "the step takes the base's own frame"
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    turns = [np.eye(3)] * 2 + [_turn_to(_axis(model, data, i)) for i in range(2, model.njoints)]
    joints, parameters = [], []
    for i in range(BASE, model.njoints):
        joint, parent = model.joints[i], model.parents[i]
        numbers = _numbers(model, i, turns[parent], turns[i])
        special = [int(number) if number in (0.0, 1.0, -1.0) else None for number in numbers]
        if i == BASE:  # a load changes its inertia, not its code
            special[12:] = [None] * 10
        revolves = i > BASE and i not in list(model.parents) and _revolves(numbers)
        joints.append(Joint(parent, joint.idx_q, joint.idx_v, joint.nq == 2, revolves, tuple(special)))
        parameters += [number for number, kind in zip(numbers, special, strict=True) if kind is None]
    return Tree(tuple(joints), np.array(parameters))


def _axis(model: pin.Model, data: pin.Data, i: int) -> np.ndarray:
    column = pin.getJointJacobian(model, data, i, pin.LOCAL)[:, model.joints[i].idx_v]
    assert not column[:3].any(), "the step knows revolute joints only"
    return np.array(column[3:])


def _turn_to(axis: np.ndarray) -> np.ndarray:
    """Return a rotation that takes x to the axis; of 0, 1 and -1 alone where the axis is."""
    axis = _clean(axis)
    auxiliary = np.roll(np.eye(3)[int(np.argmax(np.abs(axis)))], 1)
    y = auxiliary - (auxiliary @ axis) * axis
    y /= np.linalg.norm(y)
    return np.column_stack([axis, y, np.cross(axis, y)])


def _numbers(model: pin.Model, i: int, parent: np.ndarray, R: np.ndarray) -> np.ndarray:
    placement, inertia = model.jointPlacements[i], model.inertias[i]
    mass, lever = inertia.mass, R.T @ np.array(inertia.lever)
    about_joint = R.T @ np.array(inertia.inertia) @ R + mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    parts = [
        parent.T @ placement.rotation @ R,
        parent.T @ placement.translation,
        np.array([mass]),
        mass * lever,
        about_joint[np.triu_indices(3)],
    ]
    return np.concatenate([_clean(part).ravel() for part in parts])


def _clean(numbers: np.ndarray) -> np.ndarray:
    """Return the numbers without what round-off left of 0, 1 and -1."""
    scale = float(np.max(np.abs(numbers), initial=0.0))
    cleaned = np.where(np.abs(numbers) <= ROUND_OFF * scale, 0.0, numbers)
    rounded = np.rint(cleaned)
    return np.where(np.abs(cleaned - rounded) <= ROUND_OFF, rounded, cleaned)


def _revolves(numbers: np.ndarray) -> bool:
    (_, y, z), (xx, xy, xz, yy, yz, zz) = numbers[13:16], numbers[16:]
    off = np.abs([xy, xz, yz, yy - zz])
    return not (y or z) and bool(np.all(off <= SAME * max(xx, yy)))


def rigid_body(joints: tuple[Joint, ...], nq: int, nv: int) -> ca.Function:
    """Return the function (q, v and gravity (3); none; parameters) -> the parts of `Motion` in one column.

    The inertia comes as the entries of `inertia_places`; all others are zero.
    """
    q, v, gravity = ca.SX.sym("q", nq), ca.SX.sym("v", nv), ca.SX.sym("gravity", 3)
    count = sum(number is None for joint in joints for number in joint.numbers)
    parameters = ca.SX.sym("parameter", count)
    motion = _Pass(joints, q, v, gravity, parameters).motion(nv)
    above = inertia_places(joints)
    parts = [motion.inertia[row, column] for row, column in above]
    parts += [ca.densify(motion.bias), *(ca.vec(ca.densify(part)) for part in motion[2:])]
    return ca.Function(
        "rigid_body", [ca.vertcat(q, v, gravity), ca.SX(0, 1), parameters], [ca.densify(ca.vertcat(*parts))]
    )


def inertia_places(joints: tuple[Joint, ...]) -> list[tuple[int, int]]:
    """Return the (row, column) of the upper triangle's entries that are not always zero: a joint and those above it."""
    places = [(row, column) for column in range(6) for row in range(column + 1)]
    for joint in joints[1:]:
        places += [(row, joint.v) for row in [*range(6), *(joints[i - 1].v for i in _above(joints, joint)), joint.v]]
    return places


def _above(joints: tuple[Joint, ...], joint: Joint) -> list[int]:
    ancestors = []
    while joint.parent != BASE:
        ancestors.append(joint.parent)
        joint = joints[joint.parent - 1]
    return ancestors[::-1]


class _Pass:
    """Outwards for speeds and accelerations, inwards for forces and composite inertias."""

    def __init__(self, joints: tuple[Joint, ...], q: ca.SX, v: ca.SX, gravity: ca.SX, parameters: ca.SX):
        self.joints, self.q, self.v, self.gravity = dict(enumerate(joints, BASE)), q, v, gravity
        symbols = iter(ca.vertsplit(parameters))
        numbers = [[next(symbols) if kind is None else ca.SX(kind) for kind in joint.numbers] for joint in joints]
        self.fixed = {i: _Numbers.of(joint_numbers) for i, joint_numbers in enumerate(numbers, BASE)}
        self.R: dict[int, ca.SX] = {}
        self.p: dict[int, ca.SX] = {}
        self.world: dict[int, ca.SX] = {}
        self.at: dict[int, ca.SX] = {}
        self.speed: dict[int, tuple[ca.SX, ca.SX]] = {}
        self.gain: dict[int, tuple[ca.SX, ca.SX]] = {}

    def motion(self, nv: int) -> Motion:
        """Return all parts of the motion."""
        for i in self.joints:
            self._place(i)
            self._move(i)
        force: dict[int, tuple[ca.SX, ...]] = {i: self._force(i) for i in self.joints}
        composite: dict[int, tuple[ca.SX, ...]] = {i: self.fixed[i][2:] for i in self.joints}
        inertia, bias = ca.SX(nv, nv), ca.SX(nv, 1)
        for i in range(len(self.joints), BASE, -1):
            bias[self.joints[i].v] = force[i][1][0]
            self._inertia_column(inertia, i, composite[i])
            parent = self.joints[i].parent
            force[parent] = _add(force[parent], self._force_on_parent(i, *force[i]))
            composite[parent] = _add(composite[parent], self._composite_below(i, *composite[i]))
        mass, first, second = composite[BASE]
        bias[:3], bias[3:6] = force[BASE]
        inertia[:3, :3], inertia[:3, 3:6], inertia[3:6, 3:6] = mass * ca.SX.eye(3), -_cross(first), second
        moving = list(self.joints)[1:]
        axes, points = ca.horzcat(*(self.world[i][:, 0] for i in moving)), ca.horzcat(*(self.at[i] for i in moving))
        centre = mass * self.at[BASE] + self.world[BASE] @ first
        return Motion(inertia, bias, axes, points, self.world[BASE], -ca.dot(self.gravity, centre))

    def _place(self, i: int) -> None:
        joint, fixed = self.joints[i], self.fixed[i]
        if i == BASE:
            self.R[i], self.p[i] = rotation_of(self.q[3:7]), self.q[:3]
            self.world[i], self.at[i] = self.R[i], self.p[i]
            return
        angle = self.q[joint.q]
        cosine, sine = (angle, self.q[joint.q + 1]) if joint.turns_freely else (ca.cos(angle), ca.sin(angle))
        self.R[i] = fixed.rotation if joint.revolves else fixed.rotation @ _about_x(cosine, sine)
        self.p[i] = fixed.place
        parent = joint.parent
        self.world[i] = self.world[parent] @ self.R[i]
        self.at[i] = self.at[parent] + self.world[parent] @ self.p[i]

    def _move(self, i: int) -> None:
        """Work out speed and acceleration (linear, angular) without joint accelerations, against free fall."""
        joint, R, p = self.joints[i], self.R[i], self.p[i]
        if i == BASE:
            self.speed[i] = (self.v[:3], self.v[3:6])
            self.gain[i] = (R.T @ -self.gravity, ca.SX(3, 1))
            return
        (v, w), (a, b) = self.speed[joint.parent], self.gain[joint.parent]
        w_j = ca.SX(3, 1)
        w_j[0] = self.v[joint.v]
        linear, angular = R.T @ (v + ca.cross(w, p)), R.T @ w + w_j
        self.speed[i] = (linear, angular)
        self.gain[i] = (R.T @ (a + ca.cross(b, p)) + ca.cross(linear, w_j), R.T @ b + ca.cross(angular, w_j))

    def _force(self, i: int) -> tuple[ca.SX, ca.SX]:
        (v, w), (a, b), (mass, first, second) = self.speed[i], self.gain[i], self.fixed[i][2:]
        momentum, spin = mass * v - ca.cross(first, w), second @ w + ca.cross(first, v)
        force = mass * a - ca.cross(first, b) + ca.cross(w, momentum)
        return force, second @ b + ca.cross(first, a) + ca.cross(w, spin) + ca.cross(v, momentum)

    def _force_on_parent(self, i: int, force: Any, moment: Any) -> tuple[ca.SX, ca.SX]:
        """Return a force on body i as one on its parent."""
        below = self.R[i] @ force
        return below, self.R[i] @ moment + ca.cross(self.p[i], below)

    def _composite_below(self, i: int, mass: ca.SX, first: ca.SX, second: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        R, P, turned = self.R[i], _cross(self.p[i]), _cross(self.R[i] @ first)
        return mass, self.R[i] @ first + mass * self.p[i], R @ second @ R.T - P @ turned - turned @ P - mass * P @ P

    def _inertia_column(self, inertia: ca.SX, i: int, composite: tuple[ca.SX, ...]) -> None:
        _, first, second = composite
        column = self.joints[i].v
        force, moment = ca.vertcat(0, -first[2], first[1]), second[:, 0]
        while i != BASE:
            inertia[self.joints[i].v, column] = moment[0]
            force, moment = self._force_on_parent(i, force, moment)
            i = self.joints[i].parent
        inertia[:3, column], inertia[3:6, column] = force, moment


class _Numbers(NamedTuple):
    rotation: ca.SX
    place: ca.SX
    mass: ca.SX
    first: ca.SX
    second: ca.SX

    @staticmethod
    def of(numbers: list[ca.SX]) -> _Numbers:
        """Sort a joint's numbers; zeros are left out of the matrices."""
        column = ca.vertcat(*numbers)
        xx, xy, xz, yy, yz, zz = numbers[16:]
        second = [ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz)]
        return _Numbers(
            ca.sparsify(ca.reshape(column[:9], 3, 3).T),
            ca.sparsify(column[9:12]),
            numbers[12],
            ca.sparsify(column[13:16]),
            ca.sparsify(ca.vertcat(*second)),
        )


def _add(first: tuple[ca.SX, ...], second: tuple[ca.SX, ...]) -> tuple[ca.SX, ...]:
    return tuple(a + b for a, b in zip(first, second, strict=True))


def _cross(a: ca.SX) -> ca.SX:
    matrix = ca.SX(3, 3)
    matrix[0, 1], matrix[0, 2], matrix[1, 2] = -a[2], a[1], -a[0]
    matrix[1, 0], matrix[2, 0], matrix[2, 1] = a[2], -a[1], a[0]
    return ca.sparsify(matrix)


def _about_x(cosine: ca.SX, sine: ca.SX) -> ca.SX:
    matrix = ca.SX(3, 3)
    matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[1, 2], matrix[2, 1] = 1, cosine, cosine, -sine, sine
    return matrix


def rotation_of(quaternion: ca.SX) -> ca.SX:
    """Return the rotation matrix of a unit quaternion (x, y, z, w), as an expression."""
    x, y, z, w = ca.vertsplit(quaternion)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))
