"""A supply that gives way under load: every wheel feels what any wheel draws."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect, State


@dataclass(frozen=True)
class SupplySag(MotorEffect):
    """V <- V - R_b y, dy/dt = (I - y) / tau, I the current that all motors draw: the sum of delta i.

    One resistance before all bridges, with a buffer that takes tau to follow: common to all wheels, without memory
    beyond tau. With I computed one step late, the buffer is also what keeps a stiff supply stable.
    Source: ohmic source resistance, duty-averaged bridges. Differs from the paper: its supply is ideal.
    """

    title: ClassVar[str] = "supply sag"
    meaning: ClassVar[str] = "the bus voltage drops with the current that all motors draw"
    R_b: Scalar = quantity(2.0, "ohm", "assumed: 1.5 % of 7.2 V where six wheels draw 0.05 A", 0.0, 20.0, "R_b")
    tau: Scalar = quantity(0.1, "s", "assumed: shorter than what a drive's log resolves", 0.05, 10.0, "tau")
    states: ClassVar[tuple[State, ...]] = (State("drawn"),)
    neutral: ClassVar[dict[str, float]] = {"R_b": 0.0}

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the drive at the sagged voltage."""
        return drive._replace(supply=drive.supply - self.R_b * x[0])

    def rate(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return dy/dt."""
        return ((drive.bus_current - x[0]) / self.tau,)
