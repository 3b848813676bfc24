"""Where the contact arc begins and ends: the paper's fixed angles, or angles that follow the sinkage."""

from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel

SHALLOW = 1e-12
"""Least sinkage / diameter in `SinkageAngles`: the arc of a wheel that just touches has an angle of 2e-6 rad, not 0."""


class Angles(Protocol):
    """A rule for the arc of a wheel that has sunk in by h."""

    def angles(self, h: Scalar, wheel: Wheel, soil: Soil) -> tuple[Scalar, Scalar]:
        """Return theta_1, theta_2 [rad] at the sinkage h [m]."""


@dataclass(frozen=True)
class FixedAngles:
    """theta_1 and theta_2 of the soil, whatever the sinkage: how the paper draws Figs 3 and 6."""

    def angles(self, h: Scalar, wheel: Wheel, soil: Soil) -> tuple[Scalar, Scalar]:
        """Return the soil's theta_1, theta_2 [rad]."""
        return soil.theta_1, soil.theta_2


@dataclass(frozen=True)
class SinkageAngles:
    """theta_1 from the sinkage by Eq (5), theta_2 = -exit_ratio theta_1.

    Differs from the paper: it holds both angles; -5/35 of Table 1 is kept as their ratio, so light wheels have an arc.
    """

    def angles(self, h: Scalar, wheel: Wheel, soil: Soil) -> tuple[Scalar, Scalar]:
        """Return theta_1, theta_2 [rad] at the sinkage h [m]; the wheel is in the soil to its axle at most."""
        half_sine = ca.sqrt(ca.fmin(ca.fmax(h / (2 * wheel.r), SHALLOW), 0.5))
        theta_1 = 2 * ca.asin(half_sine)
        return theta_1, -soil.exit_ratio * theta_1


ANGLES: dict[str, FixedAngles | SinkageAngles] = {"fixed": FixedAngles(), "sinkage": SinkageAngles()}
"""What settings and drive logs call them."""
