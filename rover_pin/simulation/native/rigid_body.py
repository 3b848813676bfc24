"""The rigid-body dynamics of a rover as CasADi expressions: inertia, bias force, joint axes and potential energy, from
one pass over the kinematic tree of Pinocchio's model.

Pinocchio builds this model from the URDF. The recursion below only reads its tree, placements and inertias; it calls no
algorithm of Pinocchio for the dynamics. CasADi generates C code from the expressions, which the compiled step calls.
Tests compare the code with Pinocchio's own algorithms.

Every number of the model (placements, inertias) that is not 0, 1 or -1 is a parameter of the expressions. Rovers with
equal kinematic trees therefore share one compiled function, whatever they carry. The frame of each joint is turned so
that the joint's axis is x, which makes rotation matrices sparse.

Source: Featherstone, Rigid Body Dynamics Algorithms (2008), tables 5.1 (recursive Newton-Euler) and 6.2 (composite
rigid bodies).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from rover_pin.base.errors import ParameterError

ROUND_OFF = 1e-15
"""Limit of round-off. A number of a placement or of an inertia counts as zero if it is smaller than this fraction of
the largest number in its vector or matrix."""
REVOLUTION_TOLERANCE = 1e-13
"""A wheel counts as a body of revolution if the asymmetry of its inertia does not exceed this fraction of its largest
moment of inertia. Its rotation angle then has no influence on the dynamics, which simplifies the code."""
BASE = 1
"""Index in Pinocchio's model of the joint that represents the free base."""


@dataclass(frozen=True)
class Joint:
    """The properties of a joint that decide the generated code of the rigid-body dynamics. The joint's frame is turned
    so that the joint's axis is x.
    """

    parent: int
    """index of the joint that carries this joint"""
    q: int
    "index of the joint's first entry in the configuration q"
    v: int
    "index of the joint's first entry in the velocity v"
    turns_freely: bool
    "whether the joint turns without limits: q then holds the cosine and the sine of its angle"
    revolves: bool
    """whether the joint carries no other joint, and its body is a body of revolution about the joint's axis, such as a
    wheel: its rotation angle then has no influence on the dynamics"""
    numbers: tuple[int | None, ...]
    """numbers of the joint: rotation matrix (9), translation (3), mass, mass times position of the centre of mass (3),
    inertia about the joint (6). Each entry is 0, 1 or -1 if the number has this value, or None if the number is a
    parameter"""


class Tree(NamedTuple):
    """A kinematic tree in two parts: the joints, which decide the generated code, and the values of the parameters
    (masses, lengths), which are arguments of the code.
    """

    joints: tuple[Joint, ...]
    parameters: np.ndarray


class Motion(NamedTuple):
    """Dynamic quantities of a rover as CasADi expressions of configuration q, velocity v and gravity, in Pinocchio's
    conventions.
    """

    inertia: Any
    """upper triangle of the joint-space inertia (nv, nv), without the inertia of the motors' rotors"""
    bias: Any
    "bias force (nv,): Coriolis, centrifugal and gravity terms"
    axes: Any
    "unit vectors along the axes of all joints except the base, in the world (3, joints)"
    points: Any
    """a point on the axis of each joint except the base, in the world (3, joints)"""
    rotation: Any
    """rotation matrix (3, 3) of the base, from the base's axes to the world's"""
    potential: Any
    "potential energy [J]"


def tree_of(model: pin.Model) -> Tree:
    """Return the kinematic tree of a Pinocchio model that has a free base and revolute joints.

    Raises ParameterError: the model has another base, or a joint of another type.
    """
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    # The recursion knows a base that moves freely from the world's origin, and revolute joints.
    remedy = (
        "The engines of Pinocchio drive such a rover from a DriveState: simulate(model, controller, duration, state, "
        'engine="pinocchio-crba") or engine="pinocchio-aba".'
    )
    base = model.joints[BASE]
    if (base.nq, base.nv) != (7, 6) or not model.jointPlacements[BASE].isIdentity():
        raise ParameterError(
            f"The base '{model.names[BASE]}' is a {base.shortname()}, but the engine \"compiled\" only knows a base "
            f"that moves freely from the world's origin. {remedy}"
        )
    for i in range(BASE + 1, model.njoints):
        joint = model.joints[i]
        # A revolute joint has one degree of freedom, and its unit velocity moves no point of its axis.
        if joint.nv != 1 or pin.getJointJacobian(model, data, i, pin.LOCAL)[:3, joint.idx_v].any():
            raise ParameterError(
                f"Joint '{model.names[i]}' is a {joint.shortname()}, but the engine \"compiled\" only knows revolute "
                f"joints. {remedy}"
            )
    # For each joint, a rotation matrix (3, 3) that turns the x axis to the joint's axis. If the numbers of the axis are
    # 0, 1 and -1 only, so are those of the matrix, which keeps the generated code short.
    turns = [np.eye(3)] * 2
    for i in range(2, model.njoints):
        # Complete the axis to a right-handed frame, beginning with a unit vector that is not parallel to it.
        axis = _clean(_axis(model, data, i))
        auxiliary = np.roll(np.eye(3)[int(np.argmax(np.abs(axis)))], 1)
        aside = auxiliary - (auxiliary @ axis) * axis
        aside /= np.linalg.norm(aside)
        turns.append(np.column_stack([axis, aside, np.cross(axis, aside)]))
    joints, parameters = [], []
    # Numbers 0, 1 and -1 become part of the code, all others become parameters.
    for i in range(BASE, model.njoints):
        joint, parent = model.joints[i], model.parents[i]
        numbers = _numbers(model, i, turns[parent], turns[i])
        special = [int(number) if number in (0.0, 1.0, -1.0) else None for number in numbers]
        if i == BASE:  # a load may change any number of its inertia, and must not change the code
            special[12:] = [None] * 10
        # A body of revolution is centred on its axis x, and of its inertia only Iyy = Izz and Ixx are not zero.
        (_, y, z), (xx, xy, xz, yy, yz, zz) = numbers[13:16], numbers[16:]
        asymmetry = np.abs([xy, xz, yz, yy - zz])
        symmetric = not (y or z) and bool(np.all(asymmetry <= REVOLUTION_TOLERANCE * max(xx, yy)))
        revolves = i > BASE and i not in list(model.parents) and symmetric
        joints.append(Joint(parent, joint.idx_q, joint.idx_v, joint.nq == 2, revolves, tuple(special)))
        parameters += [number for number, kind in zip(numbers, special, strict=True) if kind is None]
    return Tree(tuple(joints), np.array(parameters))


def _axis(model: pin.Model, data: pin.Data, i: int) -> np.ndarray:
    """Return the unit vector of the axis of joint i in its own frame. The joint must be a revolute joint."""
    return np.array(pin.getJointJacobian(model, data, i, pin.LOCAL)[3:, model.joints[i].idx_v])


def _numbers(model: pin.Model, i: int, parent: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return the numbers of joint i as one array, in the order of `Joint.numbers`: rotation, translation, mass,
    position of the centre of mass and inertia.

    `parent` and `R` are the rotations (3, 3) of the frame of the parent joint and of the frame of joint i, which make x
    the axis of each joint.
    """
    placement, inertia = model.jointPlacements[i], model.inertias[i]
    mass, lever = inertia.mass, R.T @ np.array(inertia.lever)
    # Parallel axes: the inertia about the joint instead of the centre of mass.
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
    """Return the numbers without round-off: a number that differs from 0, 1 or -1 only by round-off is replaced by 0, 1
    or -1.
    """
    scale = float(np.max(np.abs(numbers), initial=0.0))
    cleaned = np.where(np.abs(numbers) <= ROUND_OFF * scale, 0.0, numbers)
    rounded = np.rint(cleaned)
    return np.where(np.abs(cleaned - rounded) <= ROUND_OFF, rounded, cleaned)


def rigid_body(joints: tuple[Joint, ...], nq: int, nv: int) -> ca.Function:
    """Return a CasADi function that computes the dynamic quantities in `Motion`, as one column, for a tree of joints
    with nq coordinates and nv degrees of freedom.

    The inputs of the function are a column of configuration q, velocity v and gravity; an empty column; and the
    parameters of the joints. The output contains only the entries of the inertia that `inertia_places` lists, because
    all others are zero.
    """
    q, v, gravity = ca.SX.sym("q", nq), ca.SX.sym("v", nv), ca.SX.sym("gravity", 3)
    count = sum(number is None for joint in joints for number in joint.numbers)
    parameters = ca.SX.sym("parameter", count)
    # One column with the inertia's entries that are not always zero, then the other quantities.
    motion = _RecursivePass(joints, q, v, gravity, parameters).motion(nv)
    above = inertia_places(joints)
    parts = [motion.inertia[row, column] for row, column in above]
    parts += [ca.densify(motion.bias), *(ca.vec(ca.densify(part)) for part in motion[2:])]
    return ca.Function(
        "rigid_body", [ca.vertcat(q, v, gravity), ca.SX(0, 1), parameters], [ca.densify(ca.vertcat(*parts))]
    )


def inertia_places(joints: tuple[Joint, ...]) -> list[tuple[int, int]]:
    """Return row and column of those entries in the upper triangle of the joint-space inertia that are not always zero.

    An entry is not always zero if it belongs to a joint and itself, or to a joint and a joint that carries it.
    """
    places = [(row, column) for column in range(6) for row in range(column + 1)]
    for joint in joints[1:]:
        places += [(row, joint.v) for row in [*range(6), *(joints[i - 1].v for i in _above(joints, joint)), joint.v]]
    return places


def _above(joints: tuple[Joint, ...], joint: Joint) -> list[int]:
    """Return the indices of the joints on the path from the base to a joint, from the base outwards. The base and the
    joint itself are not included.
    """
    ancestors = []
    while joint.parent != BASE:
        ancestors.append(joint.parent)
        joint = joints[joint.parent - 1]
    return ancestors[::-1]


class _RecursivePass:
    """The recursive Newton-Euler algorithm on a tree of joints: from the base outwards for speeds and accelerations,
    then inwards for forces and for composite inertias (the inertia of a body with all bodies that it carries).

    All vectors of body i are in its own frame; the rotation R[i] and the translation p[i] place this frame in the frame
    of the parent body.
    """

    def __init__(self, joints: tuple[Joint, ...], q: ca.SX, v: ca.SX, gravity: ca.SX, parameters: ca.SX):
        self.joints, self.q, self.v, self.gravity = dict(enumerate(joints, BASE)), q, v, gravity
        # Numbers 0, 1 and -1 enter as constants, so that CasADi simplifies the expressions with them.
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
        """Compute the dynamic quantities of the tree, and return them as a `Motion`. The tree has nv degrees of
        freedom.
        """
        # Outwards: place, speed and acceleration of each body.
        for i in self.joints:
            self._place(i)
            self._move(i)
        # Inwards: each body passes its force and its composite inertia (itself and all it carries) to its parent.
        # The force, and the moment about its joint, give a body its bias acceleration (Newton-Euler equations).
        force: dict[int, tuple[ca.SX, ...]] = {}
        for i in self.joints:
            (v, w), (a, b), (mass, first, second) = self.speed[i], self.gain[i], self.fixed[i][2:]
            momentum, spin = mass * v - ca.cross(first, w), second @ w + ca.cross(first, v)
            linear = mass * a - ca.cross(first, b) + ca.cross(w, momentum)
            force[i] = (linear, second @ b + ca.cross(first, a) + ca.cross(w, spin) + ca.cross(v, momentum))
        composite: dict[int, tuple[ca.SX, ...]] = {i: self.fixed[i][2:] for i in self.joints}
        inertia, bias = ca.SX(nv, nv), ca.SX(nv, 1)
        for i in range(len(self.joints), BASE, -1):
            bias[self.joints[i].v] = force[i][1][0]
            # Column of joint i in the joint-space inertia: the forces on joint i and on all joints that carry it, for a
            # unit acceleration of joint i about its axis x. They begin as the momentum of the composite body for a unit
            # rate; the linear part is x cross `first`.
            mass, first, second = composite[i]
            column, carrier = self.joints[i].v, i
            push, moment = ca.vertcat(0, -first[2], first[1]), second[:, 0]
            while carrier != BASE:
                inertia[self.joints[carrier].v, column] = moment[0]
                push, moment = self._force_on_parent(carrier, push, moment)
                carrier = self.joints[carrier].parent
            inertia[:3, column], inertia[3:6, column] = push, moment
            parent = self.joints[i].parent
            force[parent] = _add(force[parent], self._force_on_parent(i, *force[i]))
            # The composite inertia in the parent's frame, by the theorem of parallel axes.
            R, P, turned = self.R[i], _cross(self.p[i]), _cross(self.R[i] @ first)
            below = (mass, R @ first + mass * self.p[i], R @ second @ R.T - P @ turned - turned @ P - mass * P @ P)
            composite[parent] = _add(composite[parent], below)
        # The base's composite inertia is that of the whole rover: mass, mass times lever, inertia about the base.
        mass, first, second = composite[BASE]
        bias[:3], bias[3:6] = force[BASE]
        inertia[:3, :3], inertia[:3, 3:6], inertia[3:6, 3:6] = mass * ca.SX.eye(3), -_cross(first), second
        moving = list(self.joints)[1:]
        axes, points = ca.horzcat(*(self.world[i][:, 0] for i in moving)), ca.horzcat(*(self.at[i] for i in moving))
        centre = mass * self.at[BASE] + self.world[BASE] @ first
        return Motion(inertia, bias, axes, points, self.world[BASE], -ca.dot(self.gravity, centre))

    def _place(self, i: int) -> None:
        """Compute and store the placement of body i in its parent's frame and in the world."""
        joint, fixed = self.joints[i], self.fixed[i]
        if i == BASE:
            self.R[i], self.p[i] = rotation_of(self.q[3:7]), self.q[:3]
            self.world[i], self.at[i] = self.R[i], self.p[i]
            return
        # A joint turns about its x axis; for a body of revolution that carries nothing, the turn changes no quantity.
        angle = self.q[joint.q]
        cosine, sine = (angle, self.q[joint.q + 1]) if joint.turns_freely else (ca.cos(angle), ca.sin(angle))
        turn = ca.SX(3, 3)
        turn[0, 0], turn[1, 1], turn[2, 2], turn[1, 2], turn[2, 1] = 1, cosine, cosine, -sine, sine
        self.R[i] = fixed.rotation if joint.revolves else fixed.rotation @ turn
        self.p[i] = fixed.place
        parent = joint.parent
        self.world[i] = self.world[parent] @ self.R[i]
        self.at[i] = self.at[parent] + self.world[parent] @ self.p[i]

    def _move(self, i: int) -> None:
        """Compute and store the speed and the bias acceleration of body i, both as a linear and an angular vector.

        The bias acceleration is the acceleration of the body if no joint accelerates, minus gravity. Subtracting
        gravity changes the forces like gravity itself.
        """
        joint, R, p = self.joints[i], self.R[i], self.p[i]
        if i == BASE:
            self.speed[i] = (self.v[:3], self.v[3:6])
            self.gain[i] = (R.T @ -self.gravity, ca.SX(3, 1))
            return
        (v, w), (a, b) = self.speed[joint.parent], self.gain[joint.parent]
        # Speed and acceleration of the parent at the joint, plus the joint's own turn about x.
        w_j = ca.SX(3, 1)
        w_j[0] = self.v[joint.v]
        linear, angular = R.T @ (v + ca.cross(w, p)), R.T @ w + w_j
        self.speed[i] = (linear, angular)
        self.gain[i] = (R.T @ (a + ca.cross(b, p)) + ca.cross(linear, w_j), R.T @ b + ca.cross(angular, w_j))

    def _force_on_parent(self, i: int, force: Any, moment: Any) -> tuple[ca.SX, ca.SX]:
        """Convert a force and a moment about the joint of body i to the parent's frame and joint, and return them."""
        below = self.R[i] @ force
        return below, self.R[i] @ moment + ca.cross(self.p[i], below)


class _Numbers(NamedTuple):
    """The numbers of one joint as CasADi expressions, ordered into matrices and vectors."""

    rotation: ca.SX
    """rotation matrix (3, 3) of the joint's frame in its parent's frame, at the joint angle 0"""
    place: ca.SX
    "origin of the joint's frame in its parent's frame (3,)"
    mass: ca.SX
    first: ca.SX
    """mass times position of the centre of mass relative to the joint (3,)"""
    second: ca.SX
    """inertia about the joint's origin (3, 3)"""

    @staticmethod
    def of(numbers: list[ca.SX]) -> _Numbers:
        """Return the numbers of a joint, a list in the order of `Joint.numbers`, as sparse matrices. Entries that are
        zero are not stored, so that CasADi leaves out the operations with them.
        """
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
    """Return the matrix (3, 3) of the cross product with `a`: the product of the matrix with a vector b is a x b."""
    matrix = ca.SX(3, 3)
    matrix[0, 1], matrix[0, 2], matrix[1, 2] = -a[2], a[1], -a[0]
    matrix[1, 0], matrix[2, 0], matrix[2, 1] = a[2], -a[1], a[0]
    return ca.sparsify(matrix)


def rotation_of(quaternion: ca.SX) -> ca.SX:
    """Return the rotation matrix (3, 3) of a unit quaternion (x, y, z, w) as a CasADi expression."""
    x, y, z, w = ca.vertsplit(quaternion)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))
