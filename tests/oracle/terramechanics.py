"""Eqs (1)-(9) of the paper a second time, in mpmath and in plain NumPy; imports nothing of rover_pin.

The part in mpmath integrates to 30 digits with the tanh-sinh rule, on which the factor (theta_1 - theta)^n of the
stress at the ends has no influence, on pieces that end where j changes its sign. The part in NumPy is a sum over many
panels.

Braking follows the interpretation that the package states: v / (r omega) = 1 / (1 + S) and sgn(j) (1 - exp(-|j| / k)).
"""

from __future__ import annotations

import mpmath as mp
import numpy as np

mp.mp.dps = 30


def slip(rim, v):
    """Return the slip by Eq (1), written branch by branch as in the paper."""
    if rim == v:
        return 0.0
    return (rim - v) / rim if rim > v else (rim - v) / v


def ratio(S):
    """Return v / (r omega); infinite for a locked wheel."""
    S = mp.mpf(S)
    if S >= 0:
        return 1 - S
    return mp.inf if S == -1 else 1 / (1 + S)


class Wheel:
    """Stresses and forces of one wheel; all angles in radians, everything else SI."""

    def __init__(self, r, b, c, phi, k, k_1, k_2, n):
        self.r, self.b, self.c, self.phi, self.k, self.k_1, self.k_2, self.n = map(
            mp.mpf, (r, b, c, phi, k, k_1, k_2, n)
        )

    def sigma(self, theta, theta_1):
        """Return the normal stress by Eq (4) with the local sinkage of Eq (5)."""
        h = self.r * (mp.cos(theta) - mp.cos(theta_1))
        return (self.k_1 + self.k_2 * self.b) * (max(h, mp.mpf(0)) / self.b) ** self.n

    def j(self, theta, theta_1, S):
        """Return the shear displacement j in the exponent of Eq (2) [m]."""
        rise = mp.sin(theta_1) - mp.sin(theta)
        if S == -1:
            return -mp.inf if rise > 0 else self.r * (theta_1 - theta)
        return self.r * (theta_1 - theta - ratio(S) * rise)

    def tau(self, theta, theta_1, S):
        """Return the shear stress by Eq (2), with its sign."""
        j = self.j(theta, theta_1, S)
        share = mp.sign(j) * (1 - mp.exp(-abs(j) / self.k))
        return (self.c + self.sigma(theta, theta_1) * mp.tan(self.phi)) * share

    def breaks(self, theta_1, theta_2, S):
        """Return the ends of the pieces: the ends of the arc, zeros of j, and points near the entry if k is small."""
        theta_1, theta_2 = mp.mpf(theta_1), mp.mpf(theta_2)
        points = {theta_1, theta_2}
        if -1 < S < 0:
            grid = [theta_1 + (theta_2 - theta_1) * mp.mpf(i) / 200 for i in range(1, 201)]
            values = [self.j(theta, theta_1, S) for theta in grid]
            for (a, fa), (b, fb) in zip(
                zip(grid, values, strict=True), zip(grid[1:], values[1:], strict=True), strict=False
            ):
                if fa * fb < 0:
                    points.add(mp.findroot(lambda t: self.j(t, theta_1, S), (a, b), solver="anderson", tol=1e-40))
        length = theta_1 - theta_2
        points |= {theta_1 - length * mp.mpf(10) ** -e for e in (1, 2, 3, 4)}
        return sorted(points)

    def forces(self, S, theta_1, theta_2):
        """Return the forces of Eqs (6) and (7), the torque, the thrust, the compaction resistance and the scale of
        errors, as floats.

        The scale is r b int (|sigma| + |tau|), the sum of all absolute contributions, because the results cancel.
        """
        theta_1, theta_2 = mp.mpf(theta_1), mp.mpf(theta_2)
        S = mp.mpf(S)
        pieces = self.breaks(theta_1, theta_2, S)
        tau = lambda t: self.tau(t, theta_1, S)  # noqa: E731
        sigma = lambda t: self.sigma(t, theta_1)  # noqa: E731
        patch = self.r * self.b
        quad = lambda f: mp.quad(f, pieces)  # noqa: E731
        thrust = patch * quad(lambda t: tau(t) * mp.cos(t))
        compaction = patch * quad(lambda t: sigma(t) * mp.sin(t))
        f_n = patch * quad(lambda t: sigma(t) * mp.cos(t) + tau(t) * mp.sin(t))
        torque = patch * self.r * quad(tau)
        scale = patch * quad(lambda t: sigma(t) + abs(tau(t)))
        return {
            "f_n": f_n,
            "f_t": thrust - compaction,
            "torque": torque,
            "thrust": thrust,
            "compaction": compaction,
            "scale": scale,
        }


class PeakedWheel(Wheel):
    """A wheel with the normal stress of Wong and Reece: behind theta_m it equals the stress at an angle in front,
    linearly from theta_2.
    """

    def __init__(self, theta_m, theta_2, *constants):
        super().__init__(*constants)
        self.theta_m, self.theta_2 = mp.mpf(theta_m), mp.mpf(theta_2)

    def sigma(self, theta, theta_1):
        """Return Eq (4) at the angle in front whose stress is the stress at theta."""
        if theta < self.theta_m:
            share = (theta - self.theta_2) / (self.theta_m - self.theta_2)
            theta = theta_1 - share * (theta_1 - self.theta_m)
        return super().sigma(theta, theta_1)

    def breaks(self, theta_1, theta_2, S):
        """Return the ends of the pieces of the plain wheel, theta_m, and points near the exit."""
        length = self.theta_m - self.theta_2
        near_exit = {self.theta_2 + length * mp.mpf(10) ** -e for e in (1, 2, 3, 4)}
        return sorted({*super().breaks(theta_1, theta_2, S), self.theta_m, *near_exit})


def panel_forces(S, theta_1, theta_2, r, b, c, phi, k, K, n, theta_m=None, panels=1000):
    """Return f_n, f_t and torque by Eqs (2)-(7) in plain NumPy, with four Gauss points in each of many panels that
    become narrower towards the ends.

    The arguments are numbers or arrays (N,). With theta_m, the normal stress is that of Wong and Reece with its maximum
    there. The error is below 1e-10 of a force, or of 2 % of r b int (|sigma| + |tau|), for n from 0.3 to 1.6, theta_1
    from 2 to 70 deg, theta_2 from -theta_1 to 0 and k from 1 to 100 mm.
    """
    arguments = (S, theta_1, theta_2, r, b, c, phi, k, K, n, theta_2 if theta_m is None else theta_m)
    S, theta_1, theta_2, r, b, c, phi, k, K, n, theta_m = (
        np.asarray(argument, dtype=float)[..., None] for argument in arguments
    )
    x, w = np.polynomial.legendre.leggauss(4)
    u = ((np.arange(panels)[:, None] + (x + 1) / 2) / panels).ravel()
    arc = (theta_1 - theta_2) * u**4 * (35 + u * (-84 + u * (70 - 20 * u)))
    step = (theta_1 - theta_2) * np.tile(w / 2 / panels, panels) * 140 * (u * (1 - u)) ** 3
    theta = theta_1 - arc
    rear = theta_1 - (theta - theta_2) / np.where(theta_m > theta_2, theta_m - theta_2, 1.0) * (theta_1 - theta_m)
    depth = np.cos(np.where(theta >= theta_m, theta, rear)) - np.cos(theta_1)
    sigma = K * (r * np.maximum(depth, 0.0) / b) ** n
    ratio = np.where(S >= 0, 1 - S, 1 / np.maximum(1 + S, 1e-12))
    j = r * (arc - ratio * (np.sin(theta_1) - np.sin(theta)))
    tau = (c + sigma * np.tan(phi)) * np.sign(j) * -np.expm1(-np.abs(j) / k)
    total = lambda stress: np.sum(r * b * step * stress, axis=-1)  # noqa: E731
    f_t = total(tau * np.cos(theta) - sigma * np.sin(theta))
    return total(sigma * np.cos(theta) + tau * np.sin(theta)), f_t, total(r * tau)


def full_shear_closed_form(theta_1, theta_2, phi, n):
    """Return the closed forms at S = 1, k -> 0, c = 0, for a unit of the stress: f_n, thrust and torque for n = 1 and n
    = 2.
    """
    t = mp.tan(mp.mpf(phi))
    C = mp.cos(mp.mpf(theta_1))

    def primitive(theta):
        s, c2 = mp.sin(theta), mp.sin(2 * theta)
        if n == 1:
            full = s - C * theta
            cos = theta / 2 + c2 / 4 - C * s
        else:
            full = theta / 2 + c2 / 4 - 2 * C * s + C**2 * theta
            cos = s - s**3 / 3 - 2 * C * (theta / 2 + c2 / 4) + C**2 * s
        sin = -((mp.cos(theta) - C) ** (n + 1)) / (n + 1)
        return full, cos, sin

    full, cos, sin = (a - b for a, b in zip(primitive(mp.mpf(theta_1)), primitive(mp.mpf(theta_2)), strict=True))
    return cos + t * sin, t * cos, t * full
