"""Rigid-body dynamics in world axes: M is the sum of J^T I J over the links, and the bias follows from the derivative
of J.

Coordinates: position of the base p, rotation R, independent joint angles. Speeds: u = (dp/dt, omega of the base, both
in world axes, angle rates). Only the positions of the links are computed recursively, along the tree.
"""

from typing import NamedTuple

import numpy as np


def cross(a, b):
    ax, ay, az, bx, by, bz = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    first = ay * bz - az * by
    out = np.empty((*first.shape, 3))
    out[..., 0], out[..., 1], out[..., 2] = first, az * bx - ax * bz, ax * by - ay * bx
    return out


class Motion(NamedTuple):
    """Positions, velocities and Jacobians of the links in the world at one time."""

    rotation: np.ndarray
    place: np.ndarray
    "of the link frames [links, 3]"
    axis: np.ndarray
    "of the joints [joints, 3]"
    by_point: np.ndarray
    "velocity Jacobians of centres of mass, then of frames [2 links, 3, speeds]"
    by_spin: np.ndarray
    "angular velocity Jacobians [links, 3, speeds]"
    mass_matrix: np.ndarray
    bias: np.ndarray
    "M du/dt + bias = forces; weight included"


class Bodies:
    def __init__(self, tree, gravity, armature):
        self.tree, self.gravity = tree, gravity
        links = len(tree.links)
        self.size = 6 + len(tree.names)
        self.above = np.zeros((links, links - 1), dtype=bool)
        for link in range(1, links):
            at = link
            while at > 0:
                self.above[link, at - 1] = True
                at = tree.parent[at]
        self.depth = self.above.sum(axis=1)
        self.collect = np.zeros((links - 1, len(tree.names)))
        self.collect[np.arange(links - 1), tree.coordinate] = tree.factor
        self.skew_axis = cross(tree.axis[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)
        self.skew_squared = self.skew_axis @ self.skew_axis
        self.levels = [np.flatnonzero(self.depth == d) for d in range(1, self.depth.max() + 1)]
        self.armature = armature

    def frames(self, p, R, angles):
        """Return rotations and positions of the links."""
        tree = self.tree
        turn = self.collect @ angles
        local = np.eye(3) + np.sin(turn)[:, None, None] * self.skew_axis
        local = tree.turned @ (local + (1.0 - np.cos(turn))[:, None, None] * self.skew_squared)
        rotation, place = np.empty((len(tree.links), 3, 3)), np.empty((len(tree.links), 3))
        rotation[0], place[0] = R, p
        for level in self.levels:
            up = tree.parent[level]
            rotation[level] = rotation[up] @ local[level - 1]
            place[level] = place[up] + (rotation[up] @ tree.place[level - 1][:, :, None])[:, :, 0]
        return rotation, place

    def motion(self, p, R, angles, u):
        tree, links = self.tree, len(self.tree.links)
        rotation, place = self.frames(p, R, angles)
        centre = place + (rotation @ tree.com[:, :, None])[:, :, 0]
        points = np.concatenate([centre, place])
        axis = (rotation[1:] @ tree.axis[:, :, None])[:, :, 0]
        rates = self.collect @ u[6:]
        moves, twice = self.above.astype(float), np.concatenate([self.above, self.above]).astype(float)

        by_spin = np.zeros((links, 3, self.size))
        by_spin[:, :, 3:6] = np.eye(3)
        turning = moves[:, :, None] * axis[None]
        by_spin[:, :, 6:] = turning.transpose(0, 2, 1) @ self.collect
        arm = points[:, None, :] - place[None, 1:, :]
        column = twice[:, :, None] * cross(axis[None], arm)
        by_point = np.zeros((2 * links, 3, self.size))
        by_point[:, :, :3] = np.eye(3)
        by_point[:, :, 3:6] = -skew(points - p)
        by_point[:, :, 6:] = column.transpose(0, 2, 1) @ self.collect

        spin, velocity = by_spin @ u, by_point @ u
        axis_rate = cross(spin[tree.parent[1:]], axis)
        spin_change = moves @ (axis_rate * rates[:, None])
        arm_rate = velocity[:links, None, :] - velocity[None, links + 1 :, :]
        swing = cross(axis_rate[None], arm[:links])
        swing += cross(axis[None], arm_rate)
        change = np.sum(moves[:, :, None] * swing * rates[None, :, None], axis=1)
        change += cross(u[3:6], velocity[:links] - u[:3])

        inertia = rotation @ tree.inertia @ rotation.transpose(0, 2, 1)
        linear = by_point[:links].reshape(3 * links, -1)
        angular = by_spin.reshape(3 * links, -1)
        M = linear.T @ (np.repeat(tree.mass, 3)[:, None] * linear)
        M += angular.T @ (inertia @ by_spin).reshape(3 * links, -1)
        M[np.arange(self.size), np.arange(self.size)] += self.armature
        change[:, 2] += self.gravity
        momentum = (inertia @ spin[:, :, None])[:, :, 0]
        torque = (inertia @ spin_change[:, :, None])[:, :, 0] + cross(spin, momentum)
        bias = linear.T @ (tree.mass[:, None] * change).ravel() + angular.T @ torque.ravel()
        return Motion(rotation, place, axis, by_point, by_spin, M, bias)

    def energy(self, motion, u):
        """Return kinetic and potential energy."""
        height = motion.place[:, 2] + (motion.rotation @ self.tree.com[:, :, None])[:, 2, 0]
        return 0.5 * u @ motion.mass_matrix @ u, self.gravity * self.tree.mass @ height


def skew(a):
    out = np.zeros((*a.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -a[..., 2], a[..., 1], -a[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = a[..., 2], -a[..., 1], a[..., 0]
    return out


def rotation_of(quaternion):
    """Return the rotation of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
