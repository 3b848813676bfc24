"""Forces on a wheel with the normal stress of Wong and Reece, a variant of Eqs (4), (6) and (7) of the paper. Its
maximum lies at an angle theta_m in front of the axle, whereas the paper's maximum lies under the axle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.quadrature import FAST, cubic_graded
from rover_pin.soil.slip import speed_ratio
from rover_pin.soil.stress import ShearLaw, shear_law, strength, stress_scale
from rover_pin.soil.wheel_forces import WheelForces


@dataclass(frozen=True)
class PeakAngle(Record):
    """Law for the angle theta_m at which the normal stress under a wheel is largest: theta_m = (a_0 + a_1 S) theta_1,
    with the slip ratio S, the entry angle theta_1 and the constants a_0 and a_1.
    """

    a_0: Scalar = quantity(0.40, "", "Ishigami et al. 2007, FJS-1, within Wong and Reece's range", 0.0, 1.0, "a_0")
    a_1: Scalar = quantity(0.15, "", "Ishigami et al. 2007, FJS-1, within Wong and Reece's range", -1.0, 1.0, "a_1")

    def at(self, S: Scalar, theta_1: Scalar) -> Scalar:
        """Return the angle theta_m [rad] of the largest normal stress for the slip ratio S [-] and the entry angle
        theta_1 [rad].
        """
        return (self.a_0 + self.a_1 * S) * theta_1


def peak_stress_forces(
    S: Scalar, angles: tuple[Scalar, Scalar, Scalar], wheel: Wheel, soil: Soil, nodes: int = FAST
) -> WheelForces:
    """Return the forces on a wheel whose normal stress rises from the entry to the angle theta_m and falls to the exit.

    In front of theta_m the normal stress follows Eq (4) with the depth h = r (cos theta - cos theta_1). Behind theta_m,
    the stress at theta equals the stress of the front part at the angle theta_1 - (theta - theta_2) (theta_1 - theta_m)
    / (theta_m - theta_2). The stress therefore vanishes at both ends of the contact arc.

    Parameters
    ----------
    S : Scalar
        Slip ratio [-], in [-1, 1].
    angles : tuple of Scalar
        Entry angle theta_1, angle theta_m of the largest normal stress (`PeakAngle.at`), and exit angle theta_2 [rad],
        in falling order.
    wheel, soil : Wheel, Soil
        Dimensions of the wheel and constants of the soil.
    nodes : int
        Number of quadrature nodes in front of theta_m, and again behind theta_m.

    Raises
    ------
    ParameterError
        `nodes` is not a whole number of 2 or more.

    Source: Wong and Reece 1967, J. Terramechanics 4(1). Differs from the paper: the paper's maximum lies under the
    axle.
    """
    theta_1, theta_m, theta_2 = angles
    cohesion, friction, n = strength(wheel, soil)
    law = shear_law(speed_ratio(S), wheel, soil)
    front, rear = theta_1 - theta_m, theta_m - theta_2
    # psi runs from 0 at an end of the arc to 1 at the peak, both for the part in front of the peak and for the rear.
    sums = PeakSums()
    rule = cubic_graded(nodes)
    for psi, weight in zip(rule.psi, rule.weights, strict=True):
        # Each node serves both parts of the arc, because equal relative positions have the same stress.
        s = front * psi
        sigma = (2 * ca.sin(theta_1 - s / 2) * ca.sin(s / 2)) ** n
        # The strength follows from the normal stress; the law decides which fraction of it is mobilised.
        tau_most = cohesion + friction * sigma
        for theta, length in ((theta_1 - s, front), (theta_2 + rear * psi, rear)):
            sums = sums.plus(weight * length, terms(theta, theta_1, sigma, tau_most, law))
    return sums.forces(wheel, soil)


class PeakSums(NamedTuple):
    """Integrals of the stresses over the angle theta of a wheel's contact arc [rad], with the stresses divided by
    `stress_scale`. The integrands are sigma cos theta, sigma sin theta, tau, tau cos theta and tau sin theta, where
    sigma is the normal stress and tau the shear stress.
    """

    sigma_cos: Scalar = 0.0
    sigma_sin: Scalar = 0.0
    tau: Scalar = 0.0
    tau_cos: Scalar = 0.0
    tau_sin: Scalar = 0.0

    def plus(self, weight: Scalar, part: PeakSums) -> PeakSums:
        """Return these integrals after one further quadrature node: `weight` times the node's integrands `part` is
        added.
        """
        return PeakSums(*(total + weight * term for total, term in zip(self, part, strict=True)))

    def forces(self, wheel: Wheel, soil: Soil) -> WheelForces:
        """Return the forces on the wheel from the integrals over its whole contact arc."""
        # The integrals are in units of the stress scale; r b turns stresses into forces.
        patch = wheel.r * wheel.b * stress_scale(wheel, soil)
        return WheelForces(
            f_n=patch * (self.sigma_cos + self.tau_sin),
            f_t=patch * (self.tau_cos - self.sigma_sin),
            torque=patch * wheel.r * self.tau,
            thrust=patch * self.tau_cos,
            compaction=patch * self.sigma_sin,
        )


def terms(theta: Scalar, theta_1: Scalar, sigma: Scalar, tau_most: Scalar, law: ShearLaw) -> PeakSums:
    """Return the five integrands of `PeakSums` (normal and shear stress times sine and cosine) at the angle theta
    [rad].

    `sigma` is the normal stress at theta and `tau_most` the shear strength at theta, both divided by `stress_scale`.
    `law` returns the mobilised fraction of the strength.
    """
    # The law's second argument is sin theta_1 - sin theta, as a product that loses no digits at small angles.
    cos, sin, half = ca.cos(theta), ca.sin(theta), (theta_1 - theta) / 2
    tau = tau_most * law(2 * half, 2 * ca.cos(theta_1 - half) * ca.sin(half))
    return PeakSums(sigma * cos, sigma * sin, tau, tau * cos, tau * sin)
