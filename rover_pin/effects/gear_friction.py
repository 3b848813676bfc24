"""Dry friction of the gear, as a bristle that winds up: it holds a parked wheel without creeping."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect, State


@dataclass(frozen=True)
class GearFriction(MotorEffect):
    """torque = -tau_c z, with theta_c dz/dt = omega - |omega| z: Coulomb friction tau_c reached over the angle theta_c.

    Source: Dahl, The Aerospace Corporation TOR-0158(3107-18)-1 (1968). Differs from the paper: it has no friction.
    """

    title: ClassVar[str] = "dry gear friction"
    meaning: ClassVar[str] = "the gear takes a torque that does not depend on its speed"
    tau_c: Scalar = quantity(0.05, "N m", "assumed: 5 % of the stall torque", 0.0, 10.0, "tau_c")
    theta_c: Scalar = quantity(0.02, "rad", "assumed: about 1 deg of gear wind-up", 1e-4, 1.0, "theta_c")
    states: ClassVar[tuple[State, ...]] = (State("gear_windup"),)
    neutral: ClassVar[dict[str, float]] = {"tau_c": 0.0}

    def torque(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> Scalar:
        """Return the friction torque."""
        return -self.tau_c * x[0]

    def rate(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return dz/dt."""
        return ((drive.omega - ca.fabs(drive.omega) * x[0]) / self.theta_c,)
