"""Wong and Reece's normal stress, which peaks at theta_m instead of under the axle: a variant of Eqs (4), (6), (7)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.quadrature import FAST, cubic_graded
from rover_pin.soil.slip import speed_ratio
from rover_pin.soil.stress import Mobilised, shear_law, strength, stress_scale
from rover_pin.soil.wheel_forces import WheelForces


@dataclass(frozen=True)
class PeakAngle(Record):
    """Where the normal stress is greatest: theta_m = (a_0 + a_1 S) theta_1."""

    a_0: Scalar = quantity(0.40, "", "Ishigami et al. 2007, FJS-1, within Wong and Reece's range", 0.0, 1.0, "a_0")
    a_1: Scalar = quantity(0.15, "", "Ishigami et al. 2007, FJS-1, within Wong and Reece's range", -1.0, 1.0, "a_1")

    def at(self, S: Scalar, theta_1: Scalar) -> Scalar:
        """Return theta_m [rad] at slip S [-] and entry angle theta_1 [rad]."""
        return (self.a_0 + self.a_1 * S) * theta_1


def peak_stress_forces(
    S: Scalar, angles: tuple[Scalar, Scalar, Scalar], wheel: Wheel, soil: Soil, nodes: int = FAST
) -> WheelForces:
    """Return the forces on a wheel whose normal stress rises from the entry to theta_m and falls to the exit.

    In front of theta_m Eq (4) with h = r (cos theta - cos theta_1); behind it the same at the angle
    theta_1 - (theta - theta_2) (theta_1 - theta_m) / (theta_m - theta_2), so the stress vanishes at both ends.

    Parameters
    ----------
    S : Scalar
        Slip ratio [-], in [-1, 1].
    angles : tuple of Scalar
        theta_1, theta_m, theta_2 [rad], falling; see `PeakAngle.at`.
    nodes : int
        Quadrature nodes of each of the two stretches; they share the stress.

    Raises
    ------
    ParameterError
        `nodes` is not a whole number of 2 or more.

    Source: Wong and Reece 1967, J. Terramechanics 4(1). Differs from the paper: it has the peak under the axle.
    """
    theta_1, theta_m, theta_2 = angles
    cohesion, friction, n = strength(wheel, soil)
    law = shear_law(speed_ratio(S), wheel, soil)
    front, rear = theta_1 - theta_m, theta_m - theta_2
    sums = PeakSums()
    rule = cubic_graded(nodes)
    for psi, weight in zip(rule.psi, rule.weights, strict=True):
        s = front * psi
        sigma = (2 * ca.sin(theta_1 - s / 2) * ca.sin(s / 2)) ** n
        tau_most = cohesion + friction * sigma
        for theta, length in ((theta_1 - s, front), (theta_2 + rear * psi, rear)):
            sums = sums.plus(weight * length, terms(theta, theta_1, sigma, tau_most, law))
    return sums.forces(wheel, soil)


class PeakSums(NamedTuple):
    """Integrals over theta per unit of `stress_scale` [rad]."""

    sigma_cos: Scalar = 0.0
    sigma_sin: Scalar = 0.0
    tau: Scalar = 0.0
    tau_cos: Scalar = 0.0
    tau_sin: Scalar = 0.0

    def plus(self, weight: Scalar, part: PeakSums) -> PeakSums:
        """Return the sums with a part of this weight."""
        return PeakSums(*(total + weight * term for total, term in zip(self, part, strict=True)))

    def forces(self, wheel: Wheel, soil: Soil) -> WheelForces:
        """Return the forces of the whole arc's integrals."""
        patch = wheel.r * wheel.b * stress_scale(wheel, soil)
        return WheelForces(
            f_n=patch * (self.sigma_cos + self.tau_sin),
            f_t=patch * (self.tau_cos - self.sigma_sin),
            torque=patch * wheel.r * self.tau,
            thrust=patch * self.tau_cos,
            compaction=patch * self.sigma_sin,
        )


def terms(theta: Scalar, theta_1: Scalar, sigma: Scalar, tau_most: Scalar, law: Mobilised) -> PeakSums:
    """Return the integrands at an angle theta [rad] where the stress is `sigma` and the strength `tau_most`."""
    cos, sin, half = ca.cos(theta), ca.sin(theta), (theta_1 - theta) / 2
    tau = tau_most * law(2 * half, 2 * ca.cos(theta_1 - half) * ca.sin(half))
    return PeakSums(sigma * cos, sigma * sin, tau, tau * cos, tau * sin)
