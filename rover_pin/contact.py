"""The quantities at the contact of a wheel with the soil: the wheel, the soil, one contact patch (`Contact`), and the
forces on the wheel (`Load`).

Sign conventions of the package: x forward, z up. A patch is described in its direction of travel, so that a reversing
wheel is described as the mirror image of a wheel that drives forwards. S > 0 is driving, S < 0 is braking. theta is
measured from the normal of the patch, positive forwards. f_t > 0 pushes the rover in the direction of travel. torque >
0 resists the motor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import casadi as ca

from rover_pin.base.errors import UnknownAttributeError
from rover_pin.base.public import Kind
from rover_pin.base.quantity import Record, is_number, quantity

SMOOTHING = 1e-12
"""Small length in `right_angle` that keeps the result smooth if both sides are 0."""

Scalar = Annotated[Any, Kind("a number or a CasADi expression", is_number)]
"""Type of a number in formulas: a float, or a scalar CasADi expression (SX or MX)."""


@dataclass(frozen=True)
class Wheel(Record):
    """A rigid cylindrical wheel: radius r and width b [m].

    Examples
    --------
    >>> Wheel(r=0.045, b=0.05).values()
    {'r': 0.045, 'b': 0.05}
    """

    r: Scalar = quantity(0.045, "m", "paper, section 2: diameter 0.09 m", 1e-3, 5.0, "r")
    b: Scalar = quantity(0.050, "m", "assumed: the paper gives no wheel width", 1e-3, 5.0, "b")


@dataclass(frozen=True)
class Soil(Record):
    """The constants of a soil in Eqs (2) to (5) of the paper: shear strength (Mohr-Coulomb: c, phi), shear displacement
    (k), pressure-sinkage (k_1, k_2, n), and contact angles.

    `theta_1` and `theta_2` are the fixed entry and exit angle of the paper. If the entry angle theta_1 follows the load
    instead, the exit angle is theta_2 = -`exit_ratio` theta_1; with a negative `exit_ratio`, the contact ends in front
    of the axle. Defaults are Table 1 of the paper; values that the paper does not state are assumed.

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
    """The state of one contact patch of a wheel, described in its direction of travel. All fields except wheel and soil
    are scalars: floats or CasADi expressions.
    """

    S: Scalar
    """slip ratio S, Eq (1) of the paper [-]"""
    S_y: Scalar
    """sideways slip: v_y divided by the larger of rim speed and travel speed [-]"""
    h: Scalar
    """sinkage: largest depth of the rim below the plane of the patch [m]"""
    v_x: Scalar
    """travel speed of the wheel's centre along the ground [m/s]"""
    v_y: Scalar
    """sideways speed of the wheel's centre along the ground, positive to the left of the direction of travel [m/s]"""
    v_n: Scalar
    """approach speed of the wheel's centre to the ground [m/s]"""
    rim: Scalar
    "rim speed r omega, positive in the direction of travel [m/s]"
    x: Scalar
    """x of the wheel's centre in the world [m]"""
    axle: Scalar
    """number of wheels on this side that have passed the place before: 0, 1, 2"""
    wheel: Wheel
    soil: Soil
    uncompacted: Scalar = 0.0
    """fraction of the additional compaction in a deeper rut that the traction law does not contain [-]"""
    trench: Scalar = 0.0
    """depth of the ground under the wheel below the ground next to the wheel, which the sinkage h does not contain
    [m]"""
    loosened: Scalar = 0.0
    """natural logarithm of the reduction factor of the sand's stiffness by slip, skid and drift [-]"""

    @property
    def travel(self) -> Scalar:
        """Speed of the wheel's centre along the ground, sideways motion included [m/s]."""
        return right_angle(ca.fabs(self.v_x), self.v_y)

    def sense(self, v_0: Scalar, q: Scalar = 1.0) -> Scalar:
        """Return the sense of travel v / sqrt(v^2 + u^2) [-], the factor of a resistance: 1 or -1 while the wheel
        travels and 0 at rest. With this factor a resistance opposes a motion and never pushes a wheel at rest.

        v is the travel speed v_x, and u the minimum speed of the full resistance (`fading`), which depends on the rim
        speed, v_0 and q.
        """
        # A smooth sign function: u keeps the derivative finite where the wheel stands still.
        u = fading(self.rim, v_0, q)
        return self.v_x / ca.sqrt(self.v_x * self.v_x + u * u)


def right_angle(first: Scalar, second: Scalar) -> Scalar:
    """Return the hypotenuse sqrt(first^2 + second^2) of a right-angled triangle. If `second` is 0, the result is
    exactly `first`, and the function is smooth there.
    """
    # The usual square root would lose digits for a small `second`: first + second^2 / (|first| + hypotenuse) is the
    # same number.
    square = second * second
    return first + square / (ca.fabs(first) + ca.sqrt(first * first + square + SMOOTHING * SMOOTHING))


def fading(rim: Any, v_0: Scalar, q: Scalar) -> Any:
    """Return the minimum travel speed of a full resistance, which fades below it, u = v_0 (v_0 / sqrt(v_0^2 + (r
    omega)^2))^q [m/s], where r omega is the rim speed.

    A resistance is a Coulomb force: at rest every fraction of it may act, and no result may depend on u. If the wheels
    are at rest, u is v_0 and nothing moves. If they turn, u falls with the rim speed, so that a wheel that stalls is
    held and does not creep. Source: a regularisation (assumed); the exact result is the limit v_0 -> 0.
    """
    return v_0 * (v_0 / (v_0 * v_0 + rim * rim) ** 0.5) ** q


class Load(NamedTuple):
    """Forces and moments of one contact patch on the wheel, described in its direction of travel. The loads of several
    patches or effects are added.
    """

    f_t: Scalar = 0.0
    "tangential force, positive in the direction of travel [N]"
    f_y: Scalar = 0.0
    "sideways force, positive to the left of travel [N]"
    f_n: Scalar = 0.0
    "normal force, positive away from the soil [N]"
    torque: Scalar = 0.0
    "torque about the axle that resists the wheel's driving rotation [N m]"
    moment_z: Scalar = 0.0
    """moment about the patch's normal through the wheel's centre, positive to the left [N m]. Test rigs measure it;
    drives neglect it"""

    def plus(self, addend: Load) -> Load:
        """Return the sum of this load and another load."""
        return Load(*(mine + theirs for mine, theirs in zip(self, addend, strict=True)))


def _refuse_name(patch: Any, name: str) -> Any:
    """Raise an error for a name that a Contact or a Load does not have. The error lists similar names."""
    raise UnknownAttributeError(patch, name, patch._fields)


# A named tuple's own body takes no such method that a type checker would not read as "any name is right".
for _kind in (Contact, Load):
    setattr(_kind, "__getattr__", _refuse_name)  # noqa: B010
