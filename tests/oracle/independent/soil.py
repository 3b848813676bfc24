"""Eqs (2)-(7) by the tanh-sinh rule, for arrays of slips and sinkages."""

from dataclasses import dataclass
from math import radians

import numpy as np


@dataclass(frozen=True)
class Soil:
    """The soil of Table 1 with the package's assumed pressure-sinkage constants."""

    c: float = 0.005
    phi: float = radians(30.0)
    k: float = 0.05
    k_1: float = 54207.3
    k_2: float = 0.0
    n: float = 1.0
    theta_1: float = radians(35.0)
    theta_2: float = radians(-5.0)
    exit_ratio: float = 1.0 / 7.0


def double_exponential(half, step):
    """Return points in (0, 1), and weights that sum to 1."""
    t = step * np.arange(-half, half + 1)
    inner = 0.5 * np.pi * np.sinh(t)
    points = 0.5 * (1.0 + np.tanh(inner))
    weights = 0.25 * np.pi * step * np.cosh(t) / np.cosh(inner) ** 2
    return points, weights / weights.sum()


POINTS, WEIGHTS = double_exponential(17, 0.17)


def entry_angle(h, r):
    """Return the entry angle by Eq (5); a wheel sinks at most to its axle."""
    return np.arccos(1.0 - np.clip(h / r, 2e-12, 1.0))


def forces(S, theta_1, theta_2, soil, r, b):
    """Return f_n (Eq 6) and the torque r^2 b int tau for arrays of the same shape."""
    length = theta_1 - theta_2
    theta = theta_1[:, None] - length[:, None] * POINTS
    weight = length[:, None] * WEIGHTS
    depth = np.maximum(np.cos(theta) - np.cos(theta_1)[:, None], 0.0)
    sigma = (soil.k_1 + soil.k_2 * b) * (r / b * depth) ** soil.n
    travel = np.where(S >= 0.0, 1.0 - S, 1.0 / np.maximum(1.0 + S, 1e-14))
    j = r * (theta_1[:, None] - theta - travel[:, None] * (np.sin(theta_1)[:, None] - np.sin(theta)))
    tau = (soil.c + sigma * np.tan(soil.phi)) * np.sign(j) * (1.0 - np.exp(-np.abs(j) / soil.k))
    f_n = r * b * np.sum(weight * (sigma * np.cos(theta) + tau * np.sin(theta)), axis=1)
    return f_n, r * r * b * np.sum(weight * tau, axis=1)


def load_and_factor(S, h, soil, r, b, own_arc=False):
    """Return f_n at the angles of the sinkage, and T / (r f_n) at the paper's fixed angles or at the angles of the
    sinkage.
    """
    theta_1 = entry_angle(h, r)
    if own_arc:
        f_n, torque = forces(S, theta_1, -soil.exit_ratio * theta_1, soil, r, b)
        return f_n, torque / (r * f_n)
    count = len(S)
    fixed = np.full(count, soil.theta_1), np.full(count, soil.theta_2)
    f_n, torque = forces(
        np.concatenate([S, S]),
        np.concatenate([theta_1, fixed[0]]),
        np.concatenate([-soil.exit_ratio * theta_1, fixed[1]]),
        soil,
        r,
        b,
    )
    return f_n[:count], torque[count:] / (r * f_n[count:])
