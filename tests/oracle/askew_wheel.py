"""A wheel at a slip angle in plain NumPy, with side force and moments; imports nothing of rover_pin.

x forward, y left, z up; at a positive slip angle the wheel goes to its right. Stresses are midpoint sums over the
contact arc, the load is balanced by bisection on the sinkage, and the moment is the sum of r x F over all points of
rim and flank, taken as vectors.
"""

from __future__ import annotations

import numpy as np

NODES = 4000
FRICTION = np.pi / 6
"""Of the soil beside the wheel."""


class AskewWheel:
    """A wheel, a soil, and the share and the way [m] of the pressure on its flank."""

    def __init__(self, r, b, c, phi, k, K, n, exit_ratio, flank=0.0, k_f=0.02):
        self.r, self.b, self.c, self.phi, self.k, self.K, self.n = r, b, c, phi, k, K, n
        self.exit_ratio, self.flank, self.k_f = exit_ratio, flank, k_f

    def wrench(self, h, S, angle):
        """Force (x, y, z) and moment (x, y, z) about the wheel's centre."""
        entry = np.arccos(1 - h / self.r)
        leave = -self.exit_ratio * entry
        theta = leave + (entry - leave) * (np.arange(NODES) + 0.5) / NODES
        patch = self.r * self.b * (entry - leave) / NODES
        sigma = self.K * (self.r * (np.cos(theta) - np.cos(entry)) / self.b) ** self.n
        travel = 1 - S if S >= 0 else 1 / (1 + S)
        right = travel * np.tan(angle)
        j_x = self.r * (entry - theta - travel * (np.sin(entry) - np.sin(theta)))
        j_y = self.r * right * (entry - theta)
        j = np.hypot(j_x, j_y)
        tau = (self.c + sigma * np.tan(self.phi)) * -np.expm1(-j / self.k) / j
        at = self.r * np.column_stack([np.sin(theta), 0 * theta, -np.cos(theta)])
        inward = np.column_stack([-np.sin(theta), 0 * theta, np.cos(theta)])
        forward = np.column_stack([np.cos(theta), 0 * theta, np.sin(theta)])
        left = np.array([0.0, 1.0, 0.0])
        force = patch * (sigma[:, None] * inward + (tau * j_x)[:, None] * forward + (tau * j_y)[:, None] * left)
        beside, where = self.beside(entry, leave, right)
        whole = force.sum(axis=0) + beside.sum(axis=0)
        return whole, np.cross(at, force).sum(axis=0) + np.cross(where, beside).sum(axis=0)

    def beside(self, entry, leave, right):
        """Forces on strips of the buried disc, and where they act: passive pressure of walls of their depth."""
        theta = -entry + 2 * entry * (np.arange(NODES) + 0.5) / NODES
        wide = self.r * np.cos(theta) * 2 * entry / NODES
        depth = self.r * (np.cos(theta) - np.cos(entry))
        X = np.pi / 4 - FRICTION / 2
        D_1, D_2 = 1 / np.tan(X) + np.tan(X + FRICTION), 1 / np.tan(X) + np.tan(FRICTION) / np.tan(X) ** 2
        wall = D_1 * (self.c * depth + D_2 * 15700 * depth**2 / 2)
        built = -np.expm1(-self.r * abs(right) * (entry - leave) / self.k_f)
        push = self.flank * np.sign(right) * built * wall * wide
        force = np.column_stack([0 * push, push, 0 * push])
        return force, np.column_stack([self.r * np.sin(theta), 0 * theta, depth / 2 - self.r * np.cos(theta)])

    def run(self, W, S, angle):
        """Drawbar pull, torque, sinkage, side force and moment about the vertical under a load."""
        low, high = 1e-6, 0.98 * self.r
        for _ in range(60):
            h = (low + high) / 2
            low, high = (h, high) if self.wrench(h, S, angle)[0][2] < W else (low, h)
        force, moment = self.wrench(h, S, angle)
        return force[0], -moment[1], h, force[1], moment[2]
