"""Equations of motion by spatial vectors in world axes about the base's origin. The last axis is the run.

The speeds are u = (dp/dt, omega, angle rates). A motion is a pair (angular velocity, velocity at the origin), a force
is a pair (moment about the origin, force).
"""

from typing import NamedTuple

import numpy as np


def cross(a, b):
    return np.stack((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def times(R, a):
    """Return R a for R [3, 3, ...] and a [3, ...]."""
    return R[:, 0] * a[0] + R[:, 1] * a[1] + R[:, 2] * a[2]


def product(A, C):
    return A[:, 0, None] * C[None, 0] + A[:, 1, None] * C[None, 1] + A[:, 2, None] * C[None, 2]


def rotation_of(quaternion):
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class Frames(NamedTuple):
    """Rotations of the links in the world, and positions relative to the base's origin."""

    rotation: np.ndarray
    "[3, 3, links, runs]"
    place: np.ndarray
    "[3, links, runs]"
    axis: np.ndarray
    "[3, joints, runs]"
    moment: np.ndarray
    "velocity at the base's origin that a unit rate of the joint gives [3, joints, runs]"


class Bodies:
    def __init__(self, tree, mass=None, com=None):
        """Mass [links, runs] and centre of mass [3, links, runs] may differ between the runs."""
        self.tree = tree
        self.mass = tree.mass[:, None] if mass is None else mass
        self.com = tree.com[:, :, None] if com is None else com
        x, y, z = tree.axis
        o = np.zeros_like(x)
        K = np.array([[o, -z, y], [z, o, -x], [-y, x, o]])
        self.skew, self.skew_2 = K[..., None], product(K, K)[..., None]
        self.turned, self.joint_place = tree.turned[..., None], tree.place[..., None]
        self.size = 6 + len(tree.names)
        self.above = tree.above
        self.below = np.ascontiguousarray(tree.above.T)
        self.up = np.ascontiguousarray(tree.above[1:].T)
        "1 where joint i is above joint j or the same"
        self.collect = tree.collect

    def frames(self, R, angles):
        tree, runs = self.tree, angles.shape[1]
        q = self.collect @ angles
        joint_rotation = np.eye(3)[:, :, None, None] + np.sin(q) * self.skew + (1.0 - np.cos(q)) * self.skew_2
        joint_rotation = product(self.turned, joint_rotation)
        rotation = np.empty((3, 3, len(tree.links), runs))
        place = np.empty((3, len(tree.links), runs))
        rotation[:, :, 0], place[:, 0] = R, 0.0
        for level in tree.levels:
            at, up = slice(level.start + 1, level.stop + 1), tree.parent[level]
            above = rotation[:, :, up]
            rotation[:, :, at] = product(above, joint_rotation[:, :, level])
            place[:, at] = place[:, up] + times(above, self.joint_place[:, level])
        axis = times(rotation[:, :, 1:], tree.axis[..., None])
        return Frames(rotation, place, axis, cross(place[:, 1:], axis))

    def speeds(self, frames, u, rows):
        """Return angular velocity and velocity at the base's origin of the links with these rows of `above`."""
        rate = self.collect @ u[6:]
        spin = u[3:6, None] + np.matmul(rows, frames.axis * rate)
        return spin, u[:3, None] + np.matmul(rows, frames.moment * rate)

    def dynamics(self, frames, u, gravity):
        """Return the mass matrix [speeds, speeds, runs] and the bias with the weight. Gravity is a vector [3, runs]."""
        runs = u.shape[1]
        m = self.mass
        centre = frames.place + times(frames.rotation, self.com)
        R = frames.rotation
        turned = product(R, self.tree.inertia[..., None])
        I = turned[:, 0, None] * R[None, :, 0] + turned[:, 1, None] * R[None, :, 1] + turned[:, 2, None] * R[None, :, 2]  # noqa: E741
        first = m * centre
        square = dot(first, centre)
        I = I - first[:, None] * centre[None]  # noqa: E741
        for i in range(3):
            I[i, i] += square
        mass = np.broadcast_to(m, square.shape)

        spin, velocity = self.speeds(frames, u, self.above)
        rate = self.collect @ u[6:]
        above_spin, above_velocity = spin[:, self.tree.parent], velocity[:, self.tree.parent]
        swing = cross(above_spin, frames.axis) * rate
        shift = (cross(above_spin, frames.moment) + cross(above_velocity, frames.axis)) * rate
        base = -cross(u[3:6], u[:3]) - gravity
        a_spin = np.matmul(self.above, swing)
        a_velocity = base[:, None] + np.matmul(self.above, shift)

        n = times(I, spin) + cross(first, velocity)
        f = mass * velocity - cross(first, spin)
        moment = times(I, a_spin) + cross(first, a_velocity) + cross(spin, n) + cross(velocity, f)
        force = mass * a_velocity - cross(first, a_spin) + cross(spin, f)
        bias = np.empty((self.size, runs))
        bias[:3], bias[3:6] = force.sum(axis=1), moment.sum(axis=1)
        carried = dot(frames.axis, np.matmul(self.below, moment)) + dot(frames.moment, np.matmul(self.below, force))
        bias[6:] = self.collect.T @ carried

        M = np.zeros((self.size, self.size, runs))
        all_first = first.sum(axis=1)
        for i in range(3):
            M[i, i] = mass.sum(axis=0)
        M[3:6, 3:6] = I.sum(axis=2)
        x, y, z = all_first
        M[3, 1], M[3, 2], M[4, 0], M[4, 2], M[5, 0], M[5, 1] = -z, y, z, -x, -y, x
        m_c = np.matmul(self.below, mass)
        first_c = np.matmul(self.below, first)
        I_c = np.matmul(self.below, I)
        n_j = times(I_c, frames.axis) + cross(first_c, frames.moment)
        f_j = m_c * frames.moment - cross(first_c, frames.axis)
        H = np.einsum("aib,ajb->ijb", frames.axis, n_j) + np.einsum("aib,ajb->ijb", frames.moment, f_j)
        H *= self.up[:, :, None]
        H = H + np.swapaxes(H, 0, 1)
        H[np.arange(len(H)), np.arange(len(H))] *= 0.5
        C = self.collect
        M[:3, 6:] = np.matmul(C.T, f_j)
        M[3:6, 6:] = np.matmul(C.T, n_j)
        M[6:, 6:] = np.matmul(C.T, np.tensordot(C, H, (0, 0)))
        M[:3, 3:6] = np.swapaxes(M[3:6, :3], 0, 1)
        M[6:, :6] = np.swapaxes(M[:6, 6:], 0, 1)
        return M, bias
