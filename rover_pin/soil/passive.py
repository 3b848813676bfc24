"""Passive earth pressure: the resistance of soil against a wall that pushes it away."""

import math
from typing import NamedTuple

import casadi as ca

from rover_pin.contact import Scalar


class Passive(NamedTuple):
    """Coefficients of the passive earth pressure, the resistance of soil against a vertical wall of depth h that pushes
    the soil away.

        force per metre of width = D_1 (c h + D_2 gamma h^2 / 2)

    Here c is the cohesion, gamma the unit weight, and phi the friction angle of the soil. The term with c is Rankine's
    2 c h tan(45 deg + phi / 2).
    """

    D_1: Scalar
    """coefficient of the whole force [-]: cot X + tan(X + phi), where X = 45 deg - phi / 2"""
    D_2: Scalar
    """coefficient of the term with the soil's weight [-]: cot X + cot^2 X tan phi, for a sliding wedge that carries a
    heap of soil along its whole length"""
    cot_X: Scalar
    "ratio of the sliding wedge's length to its depth [-]"

    def per_width(self, h: Scalar, c: Scalar, gamma: Scalar) -> Scalar:
        """Return the force per metre of wall [N/m] for the depth h [m], the cohesion c [Pa] and the unit weight gamma
        [N/m^3].
        """
        return self.D_1 * (c * h + self.D_2 * gamma * h * h / 2)


def passive(phi: Scalar) -> Passive:
    """Return the coefficients of the passive earth pressure in a soil with the friction angle phi [rad].

    Source: Hegedus (1960), in the form of Ishigami, Miwa, Nagatani and Yoshida, J. Field Robotics 24 (2007) 233.
    """
    # The sliding wedge in front of the wall is inclined by X = 45 deg - phi / 2 against the horizontal.
    tilt = math.pi / 4 - phi / 2
    cot = 1.0 / ca.tan(tilt)
    return Passive(cot + ca.tan(tilt + phi), cot + cot * cot * ca.tan(phi), cot)
