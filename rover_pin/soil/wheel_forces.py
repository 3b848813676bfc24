"""Normal force and drawbar pull on a wheel, Eqs (6) and (7), its torque, and three definitions of the load-traction
factor F(S), the ratio of pull to normal force.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

import casadi as ca
import numpy as np

from rover_pin.base.errors import ParameterError, one_of
from rover_pin.base.public import public
from rover_pin.base.quantity import is_symbolic
from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.angles import ANGLES, Angles, FixedAngles, SinkageAngles
from rover_pin.soil.arc_integrals import Arc, integrate
from rover_pin.soil.compaction import compaction
from rover_pin.soil.quadrature import FAST, QuadratureRule, entry_graded
from rover_pin.soil.sinkage import sinkage
from rover_pin.soil.slip import speed_ratio
from rover_pin.soil.stress import ShearLaw, shear_law, strength, stress_scale


class WheelForces(NamedTuple):
    """Forces of the soil on a wheel [N], and the torque about the wheel's axle [N m]."""

    f_n: Scalar
    "normal force, Eq (6) [N]"
    f_t: Scalar
    "drawbar pull, Eq (7) [N]: thrust - compaction"
    torque: Scalar
    "torque that the motor must provide [N m]: r^2 b int tau dtheta"
    thrust: Scalar
    """forward force of the shear stress [N]: r b int tau cos theta dtheta"""
    compaction: Scalar
    """compaction resistance, the backward force of the normal stress [N]: r b int sigma sin theta dtheta"""


@public
def wheel_forces(
    S: Scalar, theta_1: Scalar, theta_2: Scalar, wheel: Wheel, soil: Soil, nodes: int = FAST
) -> WheelForces:
    """Return the forces on a wheel by Eqs (2)-(7), for floats and for CasADi scalars.

    Parameters
    ----------
    S : Scalar or array
        Slip ratio [-], in [-1, 1]. An array may have any shape; soil and wheel must then hold numbers.
    theta_1, theta_2 : Scalar
        Entry and exit angle [rad], 0 < theta_1 < pi/2. theta_2 cannot be below -theta_1, where the arc ends.
    wheel : Wheel
        The wheel, with its radius r and width b [m].
    soil : Soil
        The constants of the soil. Its contact angles are not used.
    nodes : int
        Quadrature nodes. The default of 16 is chosen for simulation: at Table 1's angles and down to k = 1 mm its error
        is 3e-7 for a driven wheel and 4e-4 of f_n for a braked one (`quadrature.FAST` lists other angles).

    Returns
    -------
    WheelForces
        f_n, f_t, thrust and compaction [N], and the torque about the axle [N m].

    Raises
    ------
    ParameterError
        `nodes` is not a whole number of 2 or more.

    Source: Eqs (2)-(7); the torque is the moment of tau about the axle, which the paper uses without printing it.
    Differs from the paper: braking (S < 0) uses v / (r omega) = 1 / (1 + S) and a signed shear, `mobilised_share`.

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


def forces(
    theta_1: Scalar, theta_2: Scalar, law: ShearLaw, wheel: Wheel, soil: Soil, rule: QuadratureRule
) -> WheelForces:
    """Return the forces of the soil on a wheel whose mobilised shear strength follows the shear law `law`.

    theta_1 and theta_2 are the entry and exit angle [rad]. `rule` is one quadrature rule over the whole contact arc.
    """
    # The arc ends where the rim leaves the soil's surface, at -theta_1 or earlier.
    length = theta_1 - ca.fmax(theta_2, -theta_1)
    return assemble(integrate(theta_1, 0.0, length, law, strength(wheel, soil), rule), theta_1, length, wheel, soil)


def assemble(arc: Arc, theta_1: Scalar, length: Scalar, wheel: Wheel, soil: Soil) -> WheelForces:
    """Return the forces on a wheel from the integrals `arc` of the stresses over its contact arc.

    The arc begins at the entry angle theta_1 [rad] and has the length `length` [rad].
    """
    # The integrals are in units of the stress scale; r b turns stresses into forces.
    patch = wheel.r * wheel.b * stress_scale(wheel, soil)
    resistance = compaction(theta_1, length, wheel, soil)
    thrust = patch * arc.tau_cos
    # Eq (6) is the normal force and Eq (7) the pull; the torque has the radius as its lever arm.
    return WheelForces(
        f_n=patch * (arc.sigma_cos + arc.tau_sin),
        f_t=thrust - resistance,
        torque=patch * wheel.r * arc.tau,
        thrust=thrust,
        compaction=resistance,
    )


def pressing_force(h: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return the normal force f_n [N] of a wheel that is pressed into the soil by h [m] without turning.

    There is no shear stress, and the parts of the contact arc behind and in front of the axle are equally long. The
    gaps between the lugs fill with soil. The radius r is therefore the radius at the tips of the lugs, and h is
    measured from the first contact of the tips with the soil (measured; derived here, new).
    """
    # Without cohesion and friction the soil has no shear strength, so that only the normal stress acts.
    arc, _ = SinkageAngles().angles(h, wheel, soil)
    return wheel_forces(0.0, arc, -arc, wheel, soil.replace(c=0.0, phi=0.0)).f_n


def plate_force(h: Scalar, b: Scalar, area: Scalar, soil: Soil) -> Scalar:
    """Return the force [N] that presses a flat plate into the soil by h [m]: the pressure of Eq (4) times the area.

    b [m] is the radius of a round plate or the shorter side of a rectangular plate, and `area` its area [m^2].

    Source: Eq (4) with p = (k_1 + k_2 b) (h / b)^n, as Bekker measured its constants with plates. Differs from the
    paper: the paper presses no plates.
    """
    return area * (soil.k_1 + soil.k_2 * b) * (h / b) ** soil.n


def paid_for(pull: Scalar, shear: Scalar, S: Scalar) -> Scalar:
    """Return a wheel's pull f_t [N], limited so that it does no more work than the wheel's torque T provides.

        min(f_t, (1 + min(S, 0)) T / r)

    The argument `pull` is f_t, and `shear` is T / r, the torque divided by the wheel radius. The soil takes the power T
    omega - f_t v from wheel and rover and gives no power back. For a braked wheel r omega = (1 + S) v by Eq (1), so
    that f_t <= (1 + S) T / r. Eq (2) alone breaks this limit: sand that is sheared forwards at the entry of the rim,
    and sheared back under more pressure below the axle, returns more energy than it took. For a driven wheel every part
    of the rim slides in the direction of its shear stress, so that f_t <= T / r holds without the limit.

    Source: conservation of energy. Differs from the paper: the paper has driven wheels only.
    """
    return ca.fmin(pull, (1.0 + ca.fmin(S, 0.0)) * shear)


def pull_of_shear(torque: Scalar, wheel: Wheel, S: Scalar) -> Scalar:
    """Return the pull [N] of the shear stress that causes the torque T [N m] of a wheel: T divided by the wheel radius.
    If the wheel is braked, `paid_for` limits the pull.
    """
    shear = torque / wheel.r
    return paid_for(shear, shear, S)


class TractionForm(Protocol):
    """A definition of the load-traction factor F(S), the ratio of a wheel's pull to its normal force at the slip ratio
    S.

    Every definition limits the pull so that it does no more work than the torque provides (`paid_for`).
    """

    name: ClassVar[str]

    def factor(self, forces: WheelForces, wheel: Wheel, S: Scalar) -> Scalar:
        """Return the factor F(S) [-] for the forces on a wheel at the slip ratio S."""


@dataclass(frozen=True)
class NetTraction:
    """The traction factor F = f_t / f_n, drawbar pull divided by normal force, as in Eqs (6) and (7) of the paper. The
    drawbar pull includes the compaction resistance.
    """

    name: ClassVar[str] = "net"

    def factor(self, forces: WheelForces, wheel: Wheel, S: Scalar) -> Scalar:
        """Return the net traction factor f_t / f_n [-], drawbar pull divided by normal force.

        The pull is limited so that it does no more work than the torque provides (`paid_for`).
        """
        return paid_for(forces.f_t / forces.f_n, forces.torque / (wheel.r * forces.f_n), S)


@dataclass(frozen=True)
class TorqueTraction:
    """The traction factor F = T / (r f_n), the motor's torque T divided by wheel radius and normal force. The paper
    measures this factor for its Fig 6, as its section 4 describes.
    """

    name: ClassVar[str] = "torque"

    def factor(self, forces: WheelForces, wheel: Wheel, S: Scalar) -> Scalar:
        """Return the traction factor T / (r f_n) [-], the motor's torque T divided by wheel radius and normal force.

        The pull T / r is limited so that it does no more work than the torque provides (`paid_for`).
        """
        shear = forces.torque / (wheel.r * forces.f_n)
        return paid_for(shear, shear, S)


@dataclass(frozen=True)
class GrossTraction:
    """The traction factor F = thrust / f_n, thrust divided by normal force: the drawbar pull of Eq (7) without its
    compaction resistance.
    """

    name: ClassVar[str] = "gross"

    def factor(self, forces: WheelForces, wheel: Wheel, S: Scalar) -> Scalar:
        """Return the gross traction factor thrust / f_n [-], thrust divided by normal force.

        The thrust is limited so that it does no more work than the torque provides (`paid_for`).
        """
        return paid_for(forces.thrust / forces.f_n, forces.torque / (wheel.r * forces.f_n), S)


FORMS: dict[str, NetTraction | TorqueTraction | GrossTraction] = {
    form.name: form for form in (NetTraction(), TorqueTraction(), GrossTraction())
}
"The definitions of the load-traction factor by name, for the command line and files."


NET, FIXED = NetTraction(), FixedAngles()


@public
def load_traction_factor(
    S: Scalar | np.ndarray | Sequence[float],
    soil: Soil,
    wheel: Wheel,
    form: TractionForm | str = NET,
    angles: Angles | str = FIXED,
    nodes: int = FAST,
) -> Any:
    """Return the load-traction factor F(S) [-], the ratio of a wheel's pull to its normal force at the slip ratio S.

    S may be a float, an array or a CasADi scalar. The contact arc begins at the soil's entry angle theta_1.

    Parameters
    ----------
    S : Scalar
        Slip ratio [-], in [-1, 1].
    soil : Soil
        The constants of the soil, including its entry angle theta_1.
    wheel : Wheel
        The wheel, with its radius r and width b [m].
    form : NetTraction, TorqueTraction, GrossTraction, or "net", "torque", "gross"
        The force that is divided by the normal force f_n: the drawbar pull f_t, torque / r, or the thrust.
    angles : FixedAngles, SinkageAngles, or "fixed", "sinkage"
        Whether the exit angle theta_2 is the soil's theta_2, or -exit_ratio theta_1 with the soil's exit_ratio.
    nodes : int
        Number of quadrature nodes, as in `wheel_forces`.

    Returns
    -------
    Scalar or array
        F(S): a float for a float, an array of equal shape for an array.

    Raises
    ------
    ParameterError
        `nodes` is not a whole number of 2 or more, a name of `form` or `angles` is not known, or S is an array while a
        constant of wheel or soil is an expression.

    Source: section 3.2, F(S) = f_t / f_n, which is `NetTraction`. `NetTraction` does not differ from the paper. With
    the numbers of Table 1 and n = 1, it gives F from -0.164 to +0.001, hardly any traction, although the rover of Fig 8
    climbs 12 deg. `TorqueTraction`, the quantity that section 4 measured, reaches 0.18.

    Examples
    --------
    >>> from rover_pin import SOILS, Wheel, load_traction_factor
    >>> round(load_traction_factor(0.2, SOILS["table-1"], Wheel()), 3)
    -0.125
    >>> load_traction_factor([0.0, 0.2], SOILS["table-1"], Wheel(), "torque").round(3)
    array([0.018, 0.057])
    """
    # A form or a rule may be given by its name or as an object.
    form = FORMS[one_of("form", form, FORMS)] if isinstance(form, str) else form
    angles = ANGLES[one_of("angles", angles, ANGLES)] if isinstance(angles, str) else angles
    if isinstance(S, str):
        raise ParameterError(f"load_traction_factor: S = {S!r} is not allowed: give a number or an array of numbers.")
    if isinstance(S, (np.ndarray, Sequence)):
        slips, slip = np.asarray(S, dtype=float), ca.SX.sym("S")
        factor = load_traction_factor(slip, soil, wheel, form, angles, nodes)
        if any(is_symbolic(value) for value in (*soil.values().values(), *wheel.values().values())):
            raise ParameterError(
                "load_traction_factor: S is an array, but a constant of the soil or of the wheel is a CasADi "
                "expression. Give numbers for soil and wheel, or a single slip ratio S."
            )
        # One compiled expression is mapped over all slips, which is faster than a Python call for each.
        return np.array(ca.Function("F", [slip], [factor])(slips.ravel()[None, :])).reshape(slips.shape)
    # The soil's theta_1 is the entry angle in any case; the rule for the angles decides theta_2.
    theta_1, theta_2 = angles.angles(sinkage(soil.theta_1, wheel), wheel, soil)
    return form.factor(wheel_forces(S, theta_1, theta_2, wheel, soil, nodes), wheel, S)
