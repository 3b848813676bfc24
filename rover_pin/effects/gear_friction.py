"""Dry friction of a gear, modelled as a bristle that winds up, which holds a parked wheel without creep."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect, State


@dataclass(frozen=True)
class GearFriction(MotorEffect):
    """The gear has dry friction: a Coulomb torque tau_c that builds up over the angle theta_c, like a bristle that
    winds up.

        torque = -tau_c z,   theta_c dz/dt = omega - |omega| z

    omega is the rate of the wheel joint, and the wind-up z of the bristle lies between -1 and 1. At rest z keeps its
    value, so that friction holds a parked wheel without creep.

    Source: Dahl, The Aerospace Corporation TOR-0158(3107-18)-1 (1968). Differs from the paper: it has no friction.
    """

    title: ClassVar[str] = "dry gear friction"
    meaning: ClassVar[str] = "the gear takes a torque that does not depend on its speed"
    tau_c: Scalar = quantity(0.05, "N m", "assumed: 5 % of the stall torque", 0.0, 10.0, "tau_c")
    theta_c: Scalar = quantity(0.02, "rad", "assumed: about 1 deg of gear wind-up", 1e-4, 1.0, "theta_c")
    states: ClassVar[tuple[State, ...]] = (State("gear_windup"),)
    neutral: ClassVar[dict[str, float]] = {"tau_c": 0.0}

    def torque(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> Scalar:
        """Return the torque [N m] that the dry friction of the gear adds at the wheel, against its rotation."""
        return -self.tau_c * x[0]

    def rate(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the rate dz/dt [1/s] of the wind-up z of the bristle, which lies between -1 and 1."""
        # After a turn of a few theta_c the wind-up is 1 or -1 and the friction has its full size; at rest the rate is
        # 0.
        return ((drive.omega - ca.fabs(drive.omega) * x[0]) / self.theta_c,)
