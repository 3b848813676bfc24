"""A motor driver that limits the current, and so the torque."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect

SHARPNESS = 8
"""Even exponent in the formula of the limiter. With 8, the current is reduced by 8 % at the limit itself, and by 0.05 %
at half the limit."""


@dataclass(frozen=True)
class TorqueSaturation(MotorEffect):
    """The motor driver limits the current to i_max, and so the torque.

        i <- i / (1 + (i / i_max)^8)^(1/8),   delta <- delta - R (i - i_limited) / V

    The limiter reduces the duty delta, as a chopping driver does, until the current i has its limited value; R is the
    winding resistance and V the supply voltage.

    Source: assumed form, a smooth limit. Differs from the paper: only the supply limits its torque.
    """

    title: ClassVar[str] = "torque limit of the motors"
    meaning: ClassVar[str] = "the motors' current, and with it their torque, is limited"
    i_max: Scalar = quantity(0.03, "A", "assumed: a tenth of the stall current", 1e-3, 1e3, "i_max")
    neutral: ClassVar[dict[str, float]] = {"i_max": 1e3}

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the motor's input with the duty ratio that the current limiter lets through."""
        # The limiter lowers the duty until the current is the limited one: delta = (R i + K omega) / V.
        current = drive.current
        limited = current / (1.0 + (current / self.i_max) ** SHARPNESS) ** (1.0 / SHARPNESS)
        return drive._replace(delta=drive.delta - drive.resistance * (current - limited) / drive.supply)
