"""Forces on a wheel, Eqs (6) and (7), its torque, and the load-traction factor F(S) in its three readings."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

import casadi as ca

from rover_pin.base.public import public
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.angles import Angles, FixedAngles, SinkageAngles
from rover_pin.soil.arc_integrals import Arc, integrate
from rover_pin.soil.compaction import compaction
from rover_pin.soil.quadrature import FAST, Graded, entry_graded
from rover_pin.soil.sinkage import sinkage
from rover_pin.soil.slip import speed_ratio
from rover_pin.soil.stress import Mobilised, shear_law, strength, stress_scale


class WheelForces(NamedTuple):
    """What the soil does to a wheel."""

    f_n: Scalar
    "normal force, Eq (6) [N]"
    f_t: Scalar
    "drawbar pull, Eq (7) [N]: thrust - compaction"
    torque: Scalar
    "torque that the soil asks of the motor [N m]: r^2 b int tau dtheta"
    thrust: Scalar
    "r b int tau cos theta dtheta [N]"
    compaction: Scalar
    "compaction resistance r b int sigma sin theta dtheta [N]"


@public
def wheel_forces(
    S: Scalar, theta_1: Scalar, theta_2: Scalar, wheel: Wheel, soil: Soil, nodes: int = FAST
) -> WheelForces:
    """Return the forces on a wheel by Eqs (2)-(7), for floats and for CasADi scalars.

    Parameters
    ----------
    S : Scalar
        Slip ratio [-], in [-1, 1].
    theta_1, theta_2 : Scalar
        Entry and exit angle [rad], 0 < theta_1 < pi/2; theta_2 is held at -theta_1 or above, where the arc ends.
    wheel : Wheel
        Its r and b [m].
    soil : Soil
        Its constants; its own angles are not looked at.
    nodes : int
        Quadrature nodes. 16 is made for simulation: 3e-7 driving and 4e-4 of f_n braking at Table 1's angles, down to
        k = 1 mm (`quadrature.FAST` tells of other angles).

    Returns
    -------
    WheelForces
        f_n, f_t, thrust and compaction [N], and the torque about the axle [N m].

    Raises
    ------
    ParameterError
        `nodes` is not a whole number of 2 or more.

    Source: Eqs (2)-(7); the torque is the moment of tau about the axle, which the paper uses without printing.
    Differs from the paper: braking (S < 0) uses v / (r omega) = 1 / (1 + S) and a signed shear, `mobilised`.

    Examples
    --------
    >>> import math
    >>> from rover_pin import SOILS, Wheel
    >>> sand = SOILS["table-1"]
    >>> forces = wheel_forces(0.2, sand.theta_1, sand.theta_2, Wheel(), sand)
    >>> round(float(forces.f_n), 1)
    9.5
    """
    law = shear_law(speed_ratio(S), wheel, soil)
    return forces(theta_1, theta_2, law, wheel, soil, entry_graded(nodes))


def forces(theta_1: Scalar, theta_2: Scalar, law: Mobilised, wheel: Wheel, soil: Soil, rule: Graded) -> WheelForces:
    """Return the forces for any law of mobilised shear, with one panel of `rule` over the arc."""
    length = theta_1 - ca.fmax(theta_2, -theta_1)
    return assemble(integrate(theta_1, 0.0, length, law, strength(wheel, soil), rule), theta_1, length, wheel, soil)


def assemble(arc: Arc, theta_1: Scalar, length: Scalar, wheel: Wheel, soil: Soil) -> WheelForces:
    """Return the forces of integrals over an arc of this length [rad]."""
    patch = wheel.r * wheel.b * stress_scale(wheel, soil)
    resistance = compaction(theta_1, length, wheel, soil)
    thrust = patch * arc.tau_cos
    return WheelForces(
        f_n=patch * (arc.sigma_cos + arc.tau_sin),
        f_t=thrust - resistance,
        torque=patch * wheel.r * arc.tau,
        thrust=thrust,
        compaction=resistance,
    )


def pressing_force(h: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return f_n [N] of a wheel pressed in by h without turning: no shear, the arc as far behind as ahead.

    Lugs press with full pockets: r is over their tips and h from where they touch (measured; derived here, new).
    """
    arc, _ = SinkageAngles().angles(h, wheel, soil)
    return wheel_forces(0.0, arc, -arc, wheel, soil.replace(c=0.0, phi=0.0)).f_n


def paid_for(pull: Scalar, shear: Scalar, S: Scalar) -> Scalar:
    """Return the pull, no more than its torque pays for: min(f_t, (1 + min(S, 0)) T / r), `shear` being T / r.

    A soil takes T omega - f_t v from wheel and rover, and gives nothing: braking, r omega = (1 + S) v by Eq (1), that
    is f_t <= (1 + S) T / r. Eq (2) alone breaks it: sand sheared forwards where it meets the rim, and sheared back
    under more pressure below the axle, returns more than it took. Driving, every part of the rim slides the way it
    shears, f_t <= T / r, and nothing changes.
    Source: energy. Differs from the paper: it has driving wheels only.
    """
    return ca.fmin(pull, (1.0 + ca.fmin(S, 0.0)) * shear)


def pull_of_shear(torque: Scalar, wheel: Wheel, S: Scalar) -> Scalar:
    """Return the pull of shear that makes this torque [N]: T / r, and braking what that pays for."""
    shear = torque / wheel.r
    return paid_for(shear, shear, S)


class TractionForm(Protocol):
    """One reading of the load-traction factor; none gives more work than the torque puts in (`paid_for`)."""

    name: ClassVar[str]

    def factor(self, forces: WheelForces, wheel: Wheel, S: Scalar) -> Scalar:
        """Return F(S) [-]."""


@dataclass(frozen=True)
class NetTraction:
    """F = f_t / f_n, Eqs (6) and (7) to the letter: the compaction resistance is inside the factor."""

    name: ClassVar[str] = "net"

    def factor(self, forces: WheelForces, wheel: Wheel, S: Scalar) -> Scalar:
        """Return f_t / f_n [-]."""
        return paid_for(forces.f_t / forces.f_n, forces.torque / (wheel.r * forces.f_n), S)


@dataclass(frozen=True)
class TorqueTraction:
    """F = T / (r f_n): what a motor's torque tells, as section 4 says that Fig 6 was measured."""

    name: ClassVar[str] = "torque"

    def factor(self, forces: WheelForces, wheel: Wheel, S: Scalar) -> Scalar:
        """Return torque / (r f_n) [-]."""
        shear = forces.torque / (wheel.r * forces.f_n)
        return paid_for(shear, shear, S)


@dataclass(frozen=True)
class GrossTraction:
    """F = thrust / f_n: Eq (7) without its compaction resistance."""

    name: ClassVar[str] = "gross"

    def factor(self, forces: WheelForces, wheel: Wheel, S: Scalar) -> Scalar:
        """Return thrust / f_n [-]."""
        return paid_for(forces.thrust / forces.f_n, forces.torque / (wheel.r * forces.f_n), S)


FORMS: dict[str, NetTraction | TorqueTraction | GrossTraction] = {
    form.name: form for form in (NetTraction(), TorqueTraction(), GrossTraction())
}
"""The forms by name, for the command line and files."""


NET, FIXED = NetTraction(), FixedAngles()


@public
def load_traction_factor(
    S: Scalar, soil: Soil, wheel: Wheel, form: TractionForm = NET, angles: Angles = FIXED, nodes: int = FAST
) -> Scalar:
    """Return the load-traction factor F(S) [-] at the soil's theta_1, for floats and for CasADi scalars.

    Parameters
    ----------
    S : Scalar
        Slip ratio [-], in [-1, 1].
    soil : Soil
        Its constants, theta_1 among them.
    wheel : Wheel
        Its r and b [m].
    form : NetTraction, TorqueTraction or GrossTraction
        What is divided by f_n: f_t, torque / r, or the thrust.
    angles : FixedAngles or SinkageAngles
        Whether theta_2 is the soil's or its exit_ratio times theta_1.
    nodes : int
        Quadrature nodes, as those of `wheel_forces`.

    Returns
    -------
    Scalar
        F(S), a float for floats.

    Raises
    ------
    ParameterError
        `nodes` is not a whole number of 2 or more.

    Source: section 3.2, F(S) = f_t / f_n, which is `NetTraction`.
    Differs from the paper: nothing in that form, and there Table 1 gives F from -0.164 to +0.001 for n = 1, hardly any
    traction, where Fig 8 climbs 12 deg. `TorqueTraction`, how section 4 measured it, reaches 0.18.

    Examples
    --------
    >>> from rover_pin import SOILS, Wheel, load_traction_factor
    >>> round(load_traction_factor(0.2, SOILS["table-1"], Wheel()), 3)
    -0.125
    """
    theta_1, theta_2 = angles.angles(sinkage(soil.theta_1, wheel), wheel, soil)
    return form.factor(wheel_forces(S, theta_1, theta_2, wheel, soil, nodes), wheel, S)
