"""Passive earth pressure: what soil bears before a wall that pushes it out of its way."""

import math
from typing import NamedTuple

import casadi as ca

from rover_pin.contact import Scalar


class Passive(NamedTuple):
    """Passive pressure on a vertical wall of depth h, D_1 (c h + D_2 gamma h^2 / 2) per width [N/m].

    Its part of c is Rankine's, 2 c h tan(45 deg + phi / 2).
    """

    D_1: Scalar
    "cot X + tan(X + phi), X = 45 deg - phi / 2 [-]"
    D_2: Scalar
    "cot X + cot^2 X tan phi [-]: the wedge that slides, and a heap on all of it"
    cot_X: Scalar
    "length of the wedge over its depth [-]"

    def per_width(self, h: Scalar, c: Scalar, gamma: Scalar) -> Scalar:
        """Return the force per width of wall [N/m] at the depth h [m], cohesion c [Pa], weight gamma [N/m^3]."""
        return self.D_1 * (c * h + self.D_2 * gamma * h * h / 2)


def passive(phi: Scalar) -> Passive:
    """Return the coefficients of soil with the friction angle phi [rad].

    Source: Hegedus (1960), in the form of Ishigami, Miwa, Nagatani and Yoshida, J. Field Robotics 24 (2007) 233.
    """
    tilt = math.pi / 4 - phi / 2
    cot = 1.0 / ca.tan(tilt)
    return Passive(cot + ca.tan(tilt + phi), cot + cot * cot * ca.tan(phi), cot)
