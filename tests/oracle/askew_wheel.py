"""A wheel at a slip angle in plain NumPy, with side force and moments; imports nothing of rover_pin.

x points forward, y to the left, z up. At a positive slip angle the wheel moves to its right. Stresses are midpoint sums
over the contact arc, the load is balanced by bisection on the sinkage, and the moment is the sum of r x F over all
points of rim and flank, as vectors. Along the wheel, the rim is sheared relative to u = v V / sqrt(v^2 + (v_y / 5)^2),
which is nearly the speed over the ground V. The resistance of the rut's pressure is multiplied by u^2 / (u^2 + (v_y /
5)^2).
"""

from __future__ import annotations

import numpy as np

NODES = 4000
FRICTION = np.pi / 6
"""Of the soil beside the wheel."""


class AskewWheel:
    """A wheel and a soil, with the share of the pressure on the wheel's flank and the distance [m] over which it builds
    up.
    """

    def __init__(self, r, b, c, phi, k, K, n, exit_ratio, flank=0.0, k_f=0.02):
        self.r, self.b, self.c, self.phi, self.k, self.K, self.n = r, b, c, phi, k, K, n
        self.exit_ratio, self.flank, self.k_f = exit_ratio, flank, k_f

    def wrench(self, h, S, angle):
        """Return force (x, y, z) and moment (x, y, z) about the wheel's centre."""
        entry = np.arccos(1 - h / self.r)
        leave = -self.exit_ratio * entry
        theta = leave + (entry - leave) * (np.arange(NODES) + 0.5) / NODES
        patch = self.r * self.b * (entry - leave) / NODES
        sigma = self.K * (self.r * (np.cos(theta) - np.cos(entry)) / self.b) ** self.n
        v, rim = 1 - max(S, 0.0), 1 + min(S, 0.0)
        aside = v * np.tan(angle)
        u = v * np.hypot(v, aside) / np.hypot(v, aside / 5)
        travel, right = u / rim, aside / rim
        j_x = self.r * (entry - theta - travel * (np.sin(entry) - np.sin(theta)))
        j_y = self.r * right * (entry - theta)
        j = np.hypot(j_x, j_y)
        tau = (self.c + sigma * np.tan(self.phi)) * -np.expm1(-j / self.k) / j
        at = self.r * np.column_stack([np.sin(theta), 0 * theta, -np.cos(theta)])
        inward = np.column_stack([-np.sin(theta), 0 * theta, np.cos(theta)])
        forward = np.column_stack([np.cos(theta), 0 * theta, np.sin(theta)])
        left = np.array([0.0, 1.0, 0.0])
        force = patch * (sigma[:, None] * inward + (tau * j_x)[:, None] * forward + (tau * j_y)[:, None] * left)
        beside, where = self.beside(entry, h, (v, rim, aside), u)
        full = force.sum(axis=0) + beside.sum(axis=0)
        full[0] += patch * (sigma * np.sin(theta)).sum() / (1 + (5 * u / aside) ** 2) if aside else 0.0
        return full, np.cross(at, force).sum(axis=0) + np.cross(where, beside).sum(axis=0)

    def beside(self, entry, h, speeds, u):
        """Return the forces on strips of the buried disc, and the points where they act: the passive pressure on walls
        of their depth.

        The wedge of each strip carries the part of the heap at the disc that lies on it: half of the rut's sand and the
        swept sand. The pressure builds up with the sideways distance over the chord, and falls if the rim spins. The
        sand rubs along the disc at 0.43 h above its lowest point.
        """
        v, rim, aside = speeds
        theta = -entry + 2 * entry * (np.arange(NODES) + 0.5) / NODES
        wide = self.r * np.cos(theta) * 2 * entry / NODES
        depth = self.r * (np.cos(theta) - np.cos(entry))
        X = np.pi / 4 - FRICTION / 2
        swept = (depth * wide).sum() * abs(aside) / np.hypot(v, aside)
        heap, long = np.sqrt(2 * np.tan(FRICTION) * (swept + self.b * h / 2)), depth / np.tan(X)
        area = long * (depth / 2 + heap - long * np.tan(FRICTION) / 2)
        wall = (1 / np.tan(X) + np.tan(X + FRICTION)) * (self.c * depth + 15700 * area)
        top = max(rim, u)
        built = -np.expm1(-2 * self.r * np.sin(entry) * abs(aside) / np.hypot(min(u / top, 1.0), 0.02) / top / self.k_f)
        spun = 1 - ((min(u, top) / top) ** 8 + (aside / top) ** 8) ** 0.125 * (1 - min(rim / u - 1, 0.0))
        spun = max(spun, 0.0) if abs(spun) > 0.01 else (spun + 0.01) ** 2 / 0.04
        most = self.flank * np.exp(-1.3 * spun) * wall * wide
        push = np.sign(aside) * built * most
        force = np.column_stack([0 * push, push, 0 * push])
        where = np.column_stack([self.r * np.sin(theta), 0 * theta, depth / 2 - self.r * np.cos(theta)])
        arm, rate_share = self.r - 0.43 * h, 0.001 * 0.02 / np.hypot(0.02, rim)  # speeds over 0.05 m/s
        slides = v - rim * arm / self.r
        size = np.tan(self.phi) * most.sum() * (np.hypot(built, 0.05) - 0.05)
        rubs = -size * slides / np.sqrt(slides**2 + aside**2 + (rate_share / 0.05) ** 2)
        return np.vstack([force, [rubs, 0.0, 0.0]]), np.vstack([where, [0.0, 0.0, -arm]])

    def run(self, W, S, angle):
        """Return drawbar pull, torque, sinkage, side force and moment about the vertical axis under a load."""
        low, high = 1e-6, 0.98 * self.r
        for _ in range(60):
            h = (low + high) / 2
            low, high = (h, high) if self.wrench(h, S, angle)[0][2] < W else (low, h)
        force, moment = self.wrench(h, S, angle)
        return force[0], -moment[1], h, force[1], moment[2]
