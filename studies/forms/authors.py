"""The model that the authors of the measured CMU sets published with them, with their own numbers.

Pavlov and Johnson, github.com/robomechanics/3d-terramechanics at commit 55a6e92b35cb (MIT text): Wong and Reece's
stresses, Jia's averages under lugs (Robotica 30 (2012) 491), shear along the whole slip, and Wong's bulldozing at the
side. This is their variant without soil flow. They fitted a_0, a_1, b_0, b_1 at each slip angle to all their runs,
including the runs that are predicted here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rover_pin.measurements.rig_set import RigSet

AUTHORS = "the authors' model"
K_SINK, C, K, PHI, GAMMA = 8e6, 1e3, 0.021, np.radians(29.0), 1330.0 * 9.8
"""Pressure-sinkage modulus [Pa/m^n], cohesion [Pa], shear modulus [m], angle of repose, specific weight [N/m^3]."""
R, B = 0.058, 0.050
N_0, N_1 = 1.46, 0.01
STEPS, HALVINGS, SLOWEST = 101, 40, 1e-9


class Surface(NamedTuple):
    """Numbers that depend on the lugs: height [m], share of the rim at the tips, change of n with skid, angles."""

    h_g: float
    tips: float
    n_2: float
    shares: dict[int, tuple[float, float, float, float]]
    """Slip angle [deg] -> a_0, a_1, b_0, b_1: theta_m and theta_r over theta_f, at no slip and per slip."""


SMOOTH = Surface(0.0, 1.0, 0.55, {
    0: (0.20239, 0.70484, -0.47599, -0.00029), 15: (0.22417, 0.69689, -0.47011, -0.00528),
    30: (0.56972, 0.19932, -0.50760, -0.00973), 45: (0.62989, 0.16685, -0.46052, -0.14710),
})  # fmt: skip
LUGGED = Surface(0.005, 0.1, 0.74, {
    0: (0.27335, 0.67290, -0.66396, -0.17658), 15: (0.28855, 0.65065, -0.49896, -0.40766),
    30: (0.46811, 0.44985, -0.43718, -0.56266), 45: (0.61734, 0.29847, -0.50873, -0.49121),
})  # fmt: skip


class Runs(NamedTuple):
    """Runs of a wheel rig, as columns of shape [runs, 1].

    The columns are four speeds [m/s] and the wheel load [N]. The speeds are the rim speed at the radius where the sand
    shears, the speed of travel, and its components along the wheel and across the wheel.
    """

    rim: np.ndarray
    travel: np.ndarray
    ahead: np.ndarray
    aside: np.ndarray
    load: np.ndarray
    shares: np.ndarray
    """Angle shares a_0, a_1, b_0, b_1 of each run [runs, 4]."""
    surface: Surface

    @property
    def r_s(self) -> float:
        """Return the radius at which sand shears, over the lugs [m]."""
        return R + self.surface.h_g

    @property
    def driven(self) -> np.ndarray:
        """Return a mask of the runs in which the wheel does not skid. The slip is computed from the whole travel,
        sideways included.
        """
        return self.rim >= self.travel

    @property
    def slip(self) -> np.ndarray:
        """Return the slip computed from the whole travel, r_s omega - V over the larger of both."""
        return (self.rim - self.travel) / np.maximum(self.rim, self.travel)

    def at_no_slip(self) -> Runs:
        """Return the runs with their slip set to zero. Each run gets the load of the run with the same slip angle and
        the smallest slip.
        """
        angles, slip = np.arctan2(self.aside, self.ahead), np.abs(self.slip)
        least = np.argmin(np.where(np.isclose(angles, angles.T), slip.T, np.inf), axis=1)
        return self._replace(rim=self.travel, load=self.load[least])


def authors_errors(data: RigSet) -> np.ndarray:
    """Return the errors [channels, runs] of the authors' model, with the sinkage that carries each run's load."""
    angle = np.abs(np.asarray(data.slip_angle))[:, None]
    surface = LUGGED if data.beside.get("lug_height") else SMOOTH
    shares = np.array([surface.shares[round(float(np.degrees(a)))] for a in angle[:, 0]])
    speeds = np.asarray(data.speeds)
    ahead, rim = speeds[:, :1], np.maximum(speeds[:, 1:], SLOWEST) * (R + surface.h_g) / R
    runs = Runs(rim, ahead / np.cos(angle), ahead, ahead * np.tan(angle), data.load[:, None], shares, surface)
    # A braked wheel keeps the angles of the rolling wheel, so these are found first.
    rolling = runs.at_no_slip()
    braked = rolling_angles(rolling, sinkage(rolling))
    h = sinkage(runs, braked)
    pull, side, _ = forces(runs, h, braked)
    values = {"drawbar pull": pull, "sinkage": h[:, 0], "side force": side * np.sign(data.slip_angle)}
    return np.array([values[channel.name] - channel.measured for channel in data.channels])


def rolling_angles(runs: Runs, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return theta_m and theta_r at no slip, which a braked wheel keeps."""
    theta_f = np.arccos(1.0 - h / runs.r_s)
    return runs.shares[:, :1] * theta_f, runs.shares[:, 2:3] * theta_f


def sinkage(runs: Runs, braked: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
    """Return the sinkage [runs, 1] that carries the load, by bisection."""
    low, high = np.full_like(runs.load, 1e-4), np.full_like(runs.load, 1.5 * R)
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        light = forces(runs, middle, braked)[2][:, None] < runs.load
        low, high = np.where(light, middle, low), np.where(light, high, middle)
    return (low + high) / 2.0


def forces(
    runs: Runs, h: np.ndarray, braked: tuple[np.ndarray, np.ndarray] | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return drawbar pull, side force and f_n [runs]. f_n is 0 if a braked wheel's theta_m exceeds theta_f."""
    r_s, slip = runs.r_s, runs.slip
    theta_f = np.arccos(1.0 - h / r_s)
    a_0, a_1, b_0, b_1 = (runs.shares[:, i : i + 1] for i in range(4))
    theta_m, theta_r = theta_f * (a_0 + a_1 * slip), theta_f * (b_0 + b_1 * slip)
    if braked is not None:
        theta_m, theta_r = np.where(runs.driven, theta_m, braked[0]), np.where(runs.driven, theta_r, braked[1])
    # Normal stress: the rear half of the arc is mapped to the front half (Wong and Reece).
    theta = theta_r + (theta_f - theta_r) * np.linspace(0.0, 1.0, STEPS)
    folded = np.where(theta >= theta_m, theta, theta_f - (theta - theta_r) / (theta_m - theta_r) * (theta_f - theta_m))
    exponent = N_0 + np.where(runs.driven, N_1, -runs.surface.n_2) * slip
    rise = np.maximum(np.cos(folded) - np.cos(theta_f), 0.0)
    tips = runs.surface.tips
    sigma = K_SINK * rise**exponent * (tips * r_s**exponent + (1.0 - tips) * R**exponent)
    # Shear displacement forward and sideways; both share one shear strength.
    along, j_t = tangential(runs, theta, theta_f)
    j_l = (theta_f - theta) * runs.aside * r_s / runs.rim
    strength = (C + sigma * np.tan(PHI)) * -np.expm1(-np.hypot(j_t, j_l) / K)
    shear = strength / np.maximum(np.hypot(along, runs.aside), SLOWEST)
    # The flank of the buried disc pushes sand sideways.
    beside = flank(theta, theta_f, theta_r, r_s) * (runs.aside / runs.travel) ** 2 * np.cos(theta) / B
    per_angle = (
        -sigma * np.sin(theta) + shear * along * np.cos(theta),
        shear * runs.aside + beside,
        sigma * np.cos(theta) + shear * along * np.sin(theta),
    )
    carried = (theta_m < theta_f)[:, 0]
    pull, side, f_n = (r_s * B * np.trapezoid(integrand, theta, axis=1) for integrand in per_angle)
    return pull, side, np.where(carried, f_n, 0.0)


def tangential(runs: Runs, theta: np.ndarray, theta_f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return speed and distance of the rim relative to the sand; in front of theta_0 a braked rim drags the sand."""
    omega, v = runs.rim / runs.r_s, runs.ahead
    # theta_0 separates the front part, where a braked rim drags the sand along, from the rear part.
    theta_0 = theta_f * (1.0 + (runs.rim / runs.travel - 1.0) / 2.0)
    dragged = (np.sin(theta_f) - np.sin(theta_0)) / np.where(runs.driven, 1.0, theta_f - theta_0)
    in_front = ~runs.driven & (theta > theta_0)
    along = runs.rim - v * np.cos(theta) + np.where(in_front, dragged * v - runs.rim, 0.0)
    start = np.where(runs.driven, theta_f, theta_0)
    # Shear displacement behind theta_0, and then in front of it.
    rear = R * (start - theta) - (np.sin(start) - np.sin(theta)) * v / omega
    front = v / omega * ((theta_f - theta) * dragged - (np.sin(theta_f) - np.sin(theta)))
    return along, np.where(in_front, front, rear)


def flank(theta: np.ndarray, theta_f: np.ndarray, theta_r: np.ndarray, r_s: float) -> np.ndarray:
    """Return Wong's bulldozing force per length of the disc below the line from entry to exit [N/m]."""
    slope = (np.cos(theta_r) - np.cos(theta_f)) / (np.sin(theta_f) - np.sin(theta_r))
    chord = (np.sin(theta) - np.sin(theta_r)) * slope - (np.cos(theta_r) - np.cos(theta))
    depth = np.minimum(2.0 * np.cos(theta), chord) * r_s
    cot = 1.0 / np.tan(np.pi / 4.0 - PHI / 2.0)
    return GAMMA / 2.0 * depth**2 * cot**2 * (1.0 + cot * np.tan(PHI) / 2.0) + 2.0 * C * depth * cot
