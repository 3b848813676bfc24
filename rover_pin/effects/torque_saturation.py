"""A driver that limits the current, and so the torque."""

from dataclasses import dataclass
from typing import ClassVar

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import Drive, MotorEffect

SHARPNESS = 8
"""Even; at the limit itself a current is cut by 8 %, at half of it by 0.05 %."""


@dataclass(frozen=True)
class TorqueSaturation(MotorEffect):
    """i <- i / (1 + (i / i_max)^8)^(1/8), by the duty: delta <- delta - R (i - i_limited) / V, as a limiter chops.

    Source: assumed form, a smooth limit. Differs from the paper: its torque is limited by the supply alone.
    """

    title: ClassVar[str] = "torque limit of the motors"
    meaning: ClassVar[str] = "the motors' current, and with it their torque, is limited"
    i_max: Scalar = quantity(0.03, "A", "assumed: a tenth of the stall current", 1e-3, 1e3, "i_max")
    neutral: ClassVar[dict[str, float]] = {"i_max": 1e3}

    def amend(self, drive: Drive, x: tuple[Scalar, ...]) -> Drive:
        """Return the drive with the duty that the limiter lets through."""
        current = drive.current
        limited = current / (1.0 + (current / self.i_max) ** SHARPNESS) ** (1.0 / SHARPNESS)
        return drive._replace(delta=drive.delta - drive.resistance * (current - limited) / drive.supply)
