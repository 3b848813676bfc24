"""What meets at a wheel: the wheel, the soil, one contact patch (`Contact`) and what it feels (`Load`).

Signs, said once: x forward, z up; a patch is described in its direction of travel (a reversing wheel sees a mirrored
world); S > 0 driving, S < 0 braking; theta from the patch normal, positive forwards; f_t > 0 pushes the rover in the
direction of travel; torque > 0 is what the soil asks of the motor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import casadi as ca

from rover_pin.base.public import Kind
from rover_pin.base.quantity import Record, is_number, quantity

SMOOTHING = 1e-12
"""Keeps a right angle smooth where both its sides are 0."""

Scalar = Annotated[Any, Kind("a number or a CasADi expression", is_number)]
"""A float, or a scalar CasADi expression (SX or MX)."""


@dataclass(frozen=True)
class Wheel(Record):
    """A rigid cylindrical wheel.

    Examples
    --------
    >>> Wheel(r=0.045, b=0.05).values()
    {'r': 0.045, 'b': 0.05}
    """

    r: Scalar = quantity(0.045, "m", "paper, section 2: diameter 0.09 m", 1e-3, 5.0, "r")
    b: Scalar = quantity(0.050, "m", "assumed: the paper gives no wheel width", 1e-3, 5.0, "b")


@dataclass(frozen=True)
class Soil(Record):
    """The constants of Eqs (2)-(5): shear strength (Mohr-Coulomb), shear displacement, pressure-sinkage, angles.

    `theta_1` and `theta_2` are the paper's fixed angles; `exit_ratio` = -theta_2 / theta_1 holds where theta_1 follows
    the load; below 0 the contact ends in front of the axle. Defaults are Table 1, completed where the paper is silent.

    Examples
    --------
    >>> sand = Soil(k=0.010)
    >>> sand.replace(phi=math.radians(35.0)).k
    0.01
    """

    c: Scalar = quantity(0.005, "Pa", "paper, Table 1", 0.0, 1e6, "c")
    phi: Scalar = quantity(math.radians(30.0), "rad", "paper, Table 1: 30 deg", 0.0, math.radians(60.0), "phi")
    k: Scalar = quantity(0.05, "m", "paper, Table 1", 1e-5, 0.5, "k")
    k_1: Scalar = quantity(54207.3, "Pa", "assumed: Eq 6 at Table 1, S = 0 carries 5.8 kg x 9.81 / 6", -1e9, 1e9, "k_1")
    k_2: Scalar = quantity(0.0, "Pa/m", "assumed: not in the paper", -1e12, 1e12, "k_2")
    n: Scalar = quantity(1.0, "", "assumed: not in the paper", 0.05, 3.0, "n")
    theta_1: Scalar = quantity(math.radians(35.0), "rad", "paper, Table 1: 35 deg", 1e-3, math.radians(89.0), "theta_1")
    theta_2: Scalar = quantity(
        math.radians(-5.0), "rad", "paper, Table 1: -5 deg", -math.radians(89.0), math.radians(81.0), "theta_2"
    )
    exit_ratio: Scalar = quantity(1.0 / 7.0, "", "paper, Table 1: 5/35", -0.9, 1.0, "lambda")


class Contact(NamedTuple):
    """What one contact patch of a wheel knows, in its direction of travel; scalars, floats or expressions."""

    S: Scalar
    "slip ratio, Eq (1) [-]"
    S_y: Scalar
    "sideways slip: v_y over the larger of rim and travel speed [-]"
    h: Scalar
    "sinkage: greatest interference of the rim with the patch's facet [m]"
    v_x: Scalar
    "travel speed of the wheel centre along the facet [m/s]"
    v_y: Scalar
    "sideways speed of the wheel centre along the facet, positive to the left of travel [m/s]"
    v_n: Scalar
    "approach speed of the wheel centre to the facet [m/s]"
    rim: Scalar
    "rim speed r omega, positive in the direction of travel [m/s]"
    x: Scalar
    "world x of the wheel centre [m]"
    axle: Scalar
    "how many wheels of this side have passed before: 0, 1, 2"
    wheel: Wheel
    soil: Soil
    uncompacted: Scalar = 0.0
    "share of what compaction costs more in a deeper rut that the traction law leaves out [-]"
    trench: Scalar = 0.0
    "how far the ground under the wheel lies below that beside it, which h is not counted from [m]"
    loosened: Scalar = 0.0
    "ln of the stiffness that the sand has lost to slip, skid and drift so far [-]"

    @property
    def travel(self) -> Scalar:
        """Speed of the wheel's centre over the ground, whatever its direction [m/s]."""
        return right_angle(ca.fabs(self.v_x), self.v_y)

    def sense(self, v_0: Scalar, q: Scalar = 1.0) -> Scalar:
        """Return v / sqrt(v^2 + u^2), u = `fading` of the rim: 1 under way, so fading that rest is not pushed."""
        u = fading(self.rim, v_0, q)
        return self.v_x / ca.sqrt(self.v_x * self.v_x + u * u)


def right_angle(first: Scalar, second: Scalar) -> Scalar:
    """Return sqrt(first^2 + second^2), exactly `first` where `second` is 0, and smooth there."""
    square = second * second
    return first + square / (ca.fabs(first) + ca.sqrt(first * first + square + SMOOTHING * SMOOTHING))


def fading(rim: Any, v_0: Scalar, q: Scalar) -> Any:
    """Return u = v_0 (v_0 / sqrt(v_0^2 + (r omega)^2))^q [m/s], the travel below which a resistance fades.

    A resistance is Coulomb's: at rest any share of it may act, so that no answer may hang on u. Where wheels stand u is
    v_0, and nothing moves; where they turn it falls with the rim, so that a wheel that stalls is held, and does not
    creep. Source: a regularisation (assumed); the answer is that of v_0 -> 0.
    """
    return v_0 * (v_0 / (v_0 * v_0 + rim * rim) ** 0.5) ** q


class Load(NamedTuple):
    """What one contact patch makes the wheel feel, in its direction of travel; Loads add."""

    f_t: Scalar = 0.0
    "tangential force, positive in the direction of travel [N]"
    f_y: Scalar = 0.0
    "sideways force, positive to the left of travel [N]"
    f_n: Scalar = 0.0
    "normal force, positive away from the soil [N]"
    torque: Scalar = 0.0
    "torque about the axle that resists the wheel's driving rotation [N m]"
    moment_z: Scalar = 0.0
    "about the patch's normal through the wheel's centre, positive to the left; rigs read it, drives leave it out [N m]"

    def plus(self, addend: Load) -> Load:
        """Return the sum of the two loads."""
        return Load(*(mine + theirs for mine, theirs in zip(self, addend, strict=True)))
