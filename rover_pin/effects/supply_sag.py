"""A supply whose voltage drops under load: every wheel feels the current of all wheels."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect, State


@dataclass(frozen=True)
class SupplySag(MotorEffect):
    """The voltage of the supply drops under load, so that every wheel feels the current of all wheels.

        V <- V - R_b y,   dy/dt = (I - y) / tau

    I is the current that all motors draw, the sum of duty times motor current, and y is I smoothed over the time tau.
    One resistance R_b feeds all bridges, behind a buffer with the time constant tau. The effect is common to all wheels
    and has no memory beyond tau. I is known one step late, and the buffer also keeps a stiff supply stable.

    Source: ohmic source resistance, duty-averaged bridges. Differs from the paper: its supply is ideal.
    """

    title: ClassVar[str] = "supply sag"
    meaning: ClassVar[str] = "the bus voltage drops with the current that all motors draw"
    R_b: Scalar = quantity(2.0, "ohm", "assumed: 1.5 % of 7.2 V where six wheels draw 0.05 A", 0.0, 20.0, "R_b")
    tau: Scalar = quantity(0.1, "s", "assumed: shorter than the rows of a drive log", 0.05, 10.0, "tau")
    states: ClassVar[tuple[State, ...]] = (State("drawn"),)
    neutral: ClassVar[dict[str, float]] = {"R_b": 0.0}

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the motor's input with the supply voltage that remains under the load of all motors."""
        return drive._replace(supply=drive.supply - self.R_b * x[0])

    def rate(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the time derivative [A/s] of the smoothed total current."""
        return ((drive.bus_current - x[0]) / self.tau,)
