"""A winding that warms up, so that its resistance rises and the torque falls."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect, State

ALPHA_COPPER = 0.00393
"Temperature coefficient of copper's resistance [1/K], IEC 60028."


@dataclass(frozen=True)
class WindingHeating(MotorEffect):
    """The motor's winding warms up, so that its resistance R rises and its torque falls.

        R <- R (1 + alpha R_th y),   dy/dt = (i^2 R - y) / tau

    y is the smoothed loss [W] of the current i, and R_th y the temperature rise of the winding. The model has one
    thermal mass against the air and the coefficient alpha of copper. The weakening of the magnets is neglected.

    Source: first-order thermal model of motor data sheets. Differs from the paper: its motor has one resistance.
    """

    title: ClassVar[str] = "winding heating"
    meaning: ClassVar[str] = "the windings warm up, resist more and give less torque"
    R_th: Scalar = quantity(30.0, "K/W", "assumed: a small DC motor in air", 0.0, 500.0, "R_th")
    tau: Scalar = quantity(60.0, "s", "assumed: winding and rotor of a small motor", 0.1, 1e4, "tau")
    states: ClassVar[tuple[State, ...]] = (State("loss"),)
    neutral: ClassVar[dict[str, float]] = {"R_th": 0.0}

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the motor's input with the resistance of the warm winding."""
        return drive._replace(resistance=drive.resistance * (1.0 + ALPHA_COPPER * self.R_th * x[0]))

    def rate(self, drive: Drive, torque: Scalar, x: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the time derivative [W/s] of the smoothed heat loss in the winding."""
        # Heat loss i^2 R of the winding, smoothed over the thermal time constant.
        return ((drive.current * drive.current * drive.resistance - x[0]) / self.tau,)
