"""What torque the soil can take under a load: at full shear (saturation) and at a given slip."""

from __future__ import annotations

import casadi as ca

from rover_pin.contact import Scalar, Soil, Wheel
from rover_pin.soil.arc import Mobilised
from rover_pin.soil.quadrature import FAST, entry_graded
from rover_pin.soil.sinkage import LOAD_FLOOR, ShearState, entry_angle, sheared, slipping
from rover_pin.soil.traction import forces


def saturation_torque(load: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return T_sat [N m]: r^2 b int (c + sigma tan phi) dtheta at the theta_1 that carries the load [N].

    The torque above which the soil fails along the whole arc: section 5's "maximum share stress". Exactly 0 for a
    lifted wheel (load <= 0), and smooth (C2) in the load there.

    Raises
    ------
    ParameterError
        Numbers for which no theta_1 below 90 deg carries the load.

    Source: Eqs (3), (4), (6) with the moment of tau. Differs from the paper: it names the bound, not its formula.
    """
    return _torque(load, 1.0, wheel, soil, sheared)


def torque_at_slip(load: Scalar, S: Scalar, wheel: Wheel, soil: Soil) -> Scalar:
    """Return the torque [N m] that the soil asks at slip S [-] under the load [N], with theta_1 from the load.

    Exactly 0 for a lifted wheel (load <= 0), and smooth (C2) in the load there.

    Raises
    ------
    ParameterError
        Numbers for which no theta_1 below 90 deg carries the load.

    Source: Eqs (2)-(6) with the moment of tau. Differs from the paper: theta_1 follows the load.
    """
    return _torque(load, S, wheel, soil, slipping)


def _torque(load: Scalar, S: Scalar, wheel: Wheel, soil: Soil, state: ShearState) -> Scalar:
    theta_1 = entry_angle(load, S, wheel, soil, state=state)
    law: Mobilised = state(S, wheel, soil)
    torque = forces(theta_1, -soil.exit_ratio * theta_1, law, wheel, soil, entry_graded(FAST)).torque
    return contact_share(load) * torque


def contact_share(load: Scalar) -> Scalar:
    """Return 0 for a lifted wheel, 1 - 1.5 (floor / load)^2 for a loaded one, C2 between."""
    pressed = ca.fmax(load / LOAD_FLOOR, 0.0)
    return (pressed / ca.sqrt(1 + pressed**2)) ** 3
