"""What pull a wheel has when its torque is at the bound, in each reading of the load-traction factor."""

from dataclasses import dataclass, field
from typing import NamedTuple

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.control.bound_law import FINE
from rover_pin.control.torque_bounds import BY_LOAD, SLIP_LIMIT
from rover_pin.soil.angles import FixedAngles, SinkageAngles
from rover_pin.soil.quadrature import entry_graded
from rover_pin.soil.sinkage import ShearState, entry_angle, fully_sheared, slipping
from rover_pin.soil.wheel_forces import GrossTraction, NetTraction, TorqueTraction, forces


@dataclass(frozen=True)
class TractionLimit:
    """What counts as too much slip, which ratio is the traction factor, and which arc it is taken over."""

    slip: float = SLIP_LIMIT
    form: NetTraction | TorqueTraction | GrossTraction = field(default_factory=NetTraction)
    angles: FixedAngles | SinkageAngles = BY_LOAD


DEFAULT_LIMIT = TractionLimit()


class Pull(NamedTuple):
    """A wheel's pull."""

    force: Scalar
    "f_t = F W [N]"
    factor: Scalar
    "F [-]"
    slope: Scalar
    "atan F [rad]: where the pull just holds the wheel's own load; negative where it does not even move it on the flat"


class BoundPulls(NamedTuple):
    """The pull at both bounds."""

    saturation: Pull
    limit: Pull


def pull_at_bounds(load: Scalar, soil: Soil, wheel: Wheel, limit: TractionLimit = DEFAULT_LIMIT) -> BoundPulls:
    """Return the pull of a wheel whose torque is at T_sat and at T_lim.

    The torque bounds are the same in every form: the torque of the soil at the slip limit is one number. What differs
    is the pull that this torque buys: all of it (`TorqueTraction`: T / r), its horizontal part (`GrossTraction`), or
    what is left after the compaction resistance (`NetTraction`, the paper's Eq 7).

    Parameters and errors are those of `torque_bounds`. A `MotionResistance` of the model is not subtracted.
    Source: Eqs (6) and (7); section 3.2. Differs from the paper: it has the net form only.
    """
    states: tuple[ShearState, ShearState] = (fully_sheared, slipping)
    return BoundPulls(*(_pull(load, soil, wheel, limit, state) for state in states))


def _pull(load: Scalar, soil: Soil, wheel: Wheel, limit: TractionLimit, state: ShearState) -> Pull:
    if isinstance(limit.angles, FixedAngles):
        theta_1, theta_2 = soil.theta_1, soil.theta_2
    else:
        theta_1 = entry_angle(load, limit.slip, wheel, soil, state=state)
        theta_2 = -soil.exit_ratio * theta_1
    at = forces(theta_1, theta_2, state(limit.slip, wheel, soil), wheel, soil, entry_graded(FINE))
    factor = limit.form.factor(at, wheel, limit.slip)
    return Pull(factor * load, factor, ca.atan(factor))
