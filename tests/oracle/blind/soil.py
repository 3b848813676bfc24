"""Eqs (2)-(7) on arrays of arcs, by Gauss's rule in u with theta = theta_1 - length u^2."""

from typing import NamedTuple

import numpy as np

NODES = 12


def rule(nodes=NODES):
    x, w = np.polynomial.legendre.leggauss(nodes)
    u = 0.5 * (x + 1.0)
    return (u * u)[:, None], (w * u)[:, None]


PSI, WEIGHT = rule()


class Arc(NamedTuple):
    """Nodes of arcs [nodes, arcs], which do not depend on the slip."""

    back: np.ndarray
    "theta_1 - theta"
    rise: np.ndarray
    "sin theta_1 - sin theta"
    depth: np.ndarray
    "cos theta - cos theta_1"
    sine: np.ndarray
    weight: np.ndarray
    weighted_cosine: np.ndarray


def arc(theta_1, theta_2):
    length = theta_1 - np.maximum(theta_2, -theta_1)
    back = length * PSI
    theta = theta_1 - back
    sine, cosine = np.sin(theta), np.cos(theta)
    weight = length * WEIGHT
    depth = np.maximum(cosine - np.cos(theta_1), 1e-300)
    return Arc(back, np.sin(theta_1) - sine, depth, sine, weight, weight * cosine)


def entry_angle(h, r):
    return np.arccos(1.0 - np.clip(h / r, 2e-12, 1.0))


def travel_ratio(S):
    """Return v / (r omega)."""
    return np.where(S >= 0.0, 1.0 - S, 1.0 / np.maximum(1.0 + S, 1e-14))


def mobilised(back, rise, ratio, stiffness):
    x = stiffness * (back - ratio * rise)
    return np.sign(x) * (1.0 - np.exp(-np.abs(x)))


def forces(on, ratio, soil, r, b):
    """Return f_n and torque of arcs; soil has k, tan_phi, c, n (None: 1) and K = k_1 + k_2 b."""
    stress, scale = (on.depth, soil["K"] * (r / b)) if soil["n"] is None else (
        on.depth ** soil["n"], soil["K"] * (r / b) ** soil["n"]
    )  # fmt: skip
    shear = soil["c"] / scale + soil["tan_phi"] * stress
    shear *= mobilised(on.back, on.rise, ratio, r / soil["k"])
    shear *= on.weight
    f_n = np.einsum("ij,ij->j", stress, on.weighted_cosine) + np.einsum("ij,ij->j", shear, on.sine)
    return r * b * scale * f_n, r * r * b * scale * shear.sum(axis=0)


def peaked_forces(S, theta_1, theta_m, theta_2, soil, r, b):
    """Return f_n and torque with the normal stress of Wong and Reece, whose maximum is at theta_m."""
    n = 1.0 if soil["n"] is None else soil["n"]
    scale, ratio = soil["K"] * (r / b) ** n, travel_ratio(S)
    f_n = torque = 0.0
    front, rear = theta_1 - theta_m, theta_m - theta_2
    stress = np.maximum(np.cos(theta_1 - front * PSI) - np.cos(theta_1), 1e-300) ** n
    for theta, length in ((theta_1 - front * PSI, front), (theta_2 + rear * PSI, rear)):
        mobilised_share = mobilised(theta_1 - theta, np.sin(theta_1) - np.sin(theta), ratio, r / soil["k"])
        shear = (soil["c"] / scale + soil["tan_phi"] * stress) * mobilised_share
        weight = length * WEIGHT
        f_n = f_n + np.sum(weight * (stress * np.cos(theta) + shear * np.sin(theta)), axis=0)
        torque = torque + np.sum(weight * shear, axis=0)
    return r * b * scale * f_n, r * r * b * scale * torque


def rut(h, ratio, n, deeper, K, r, b):
    """Return the additional work for pressing a rut of depth h, compared with the shallower rut of the exponent n -
    deeper [N].
    """
    theta, before = entry_angle(h, r), np.maximum(n - deeper, 0.05)

    def pressed(top, m):
        on = arc(top, -ratio * top)
        return (r / b) ** m * np.einsum("ij,ij->j", on.depth**m, on.weighted_cosine)

    def cost(top, m):
        return K * r * b * (r / b) ** m * (np.cos(ratio * top) - np.cos(top)) ** (m + 1.0) / (m + 1.0)

    carried, low, high = pressed(theta, n), 0.2 * theta, 1.5 * theta
    for _ in range(30):
        middle = 0.5 * (low + high)
        above = pressed(middle, before) > carried
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.maximum(cost(theta, n) - cost(0.5 * (low + high), before), 0.0)
