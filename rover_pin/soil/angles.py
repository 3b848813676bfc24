"""Entry angle and exit angle of a wheel's contact arc: the paper's fixed angles, or angles that depend on the
sinkage.
"""

from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel

SHALLOW = 1e-12
"""Minimum ratio of sinkage to wheel diameter in `SinkageAngles`. A smaller ratio is replaced by this value, so that a
wheel that just touches the ground has a contact arc of 2e-6 rad instead of 0. At 0 the derivative of the arc with
respect to the sinkage would be infinite."""


class Angles(Protocol):
    """A rule that gives the contact arc of a wheel, from its entry angle to its exit angle, as a function of the
    sinkage.
    """

    def angles(self, h: Scalar, wheel: Wheel, soil: Soil) -> tuple[Scalar, Scalar]:
        """Return entry angle theta_1 and exit angle theta_2 [rad] of a wheel that has sunk by h [m]."""


@dataclass(frozen=True)
class FixedAngles:
    """Rule for the contact arc of a wheel: the entry angle and the exit angle are constants of the soil, theta_1 and
    theta_2, at every sinkage, as in the paper's Figs 3 and 6.
    """

    def angles(self, h: Scalar, wheel: Wheel, soil: Soil) -> tuple[Scalar, Scalar]:
        """Return the soil's entry angle theta_1 and exit angle theta_2 [rad], whatever the sinkage h [m] is."""
        return soil.theta_1, soil.theta_2


@dataclass(frozen=True)
class SinkageAngles:
    """Rule for the contact arc of a wheel: both angles grow with the sinkage h. Eq (5) of the paper, h = r (1 - cos
    theta_1), gives the entry angle theta_1 for the wheel radius r. The exit angle is theta_2 = -exit_ratio theta_1,
    where exit_ratio is a constant of the soil.

    Differs from the paper: the paper holds both angles constant, at theta_1 = 35 deg and theta_2 = -5 deg (Table 1).
    Here only the ratio of these two angles is kept, so that a wheel with a small load also has a contact arc.
    """

    def angles(self, h: Scalar, wheel: Wheel, soil: Soil) -> tuple[Scalar, Scalar]:
        """Return entry angle theta_1 and exit angle theta_2 [rad] of a wheel that has sunk by h [m]. If h is larger
        than the wheel radius, the result holds for a wheel that has sunk to its axle.
        """
        # h = r (1 - cos theta_1) = 2 r sin^2(theta_1 / 2), which loses no digits at small angles.
        half_sine = ca.sqrt(ca.fmin(ca.fmax(h / (2 * wheel.r), SHALLOW), 0.5))
        theta_1 = 2 * ca.asin(half_sine)
        return theta_1, -soil.exit_ratio * theta_1


ANGLES: dict[str, FixedAngles | SinkageAngles] = {"fixed": FixedAngles(), "sinkage": SinkageAngles()}
"""The rules for the contact arc, by the name that settings and drive logs use."""
