"""The slip as the controller knows it: Eq (9) from a table of duty and speed, or the truth of an external tracker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rover_pin.control.constant import ConstantDuty
from rover_pin.errors import ParameterError
from rover_pin.motion.command import Reading
from rover_pin.motion.model import Model
from rover_pin.motion.simulate import simulate

SLOWEST_RIM = 1e-3
"""Rim speed [m/s] below which Eq (9) is evaluated at this speed: it has no value at rest."""


class SlipEstimate(Protocol):
    """A way to know the slip of each wheel."""

    def slip(self, reading: Reading) -> np.ndarray:
        """Return S_hat, one value a wheel [-]."""


@dataclass(frozen=True)
class TrueSlip:
    """The slip of Eq (1) itself, as an external tracking system would give it."""

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the true slip [-]."""
        return reading.truth.slip


@dataclass(frozen=True)
class SpeedTable:
    """The empirical table of section 5: steady speed [m/s] against duty [-], linear in between, odd in the duty."""

    duty: tuple[float, ...]
    speed: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.duty) != len(self.speed) or len(self.duty) < 2 or np.any(np.diff(self.duty) <= 0.0):
            raise ParameterError(
                f"SpeedTable: needs two or more duties in increasing order and one speed each; got {len(self.duty)} "
                f"duties and {len(self.speed)} speeds."
            )

    def speed_at(self, duty: np.ndarray) -> np.ndarray:
        """Return v_hat(delta) [m/s]."""
        return np.sign(duty) * np.interp(np.abs(duty), self.duty, self.speed)


@dataclass(frozen=True)
class TableEstimate:
    """S_hat = (r omega - v_hat(delta)) / (r omega), Eq (9), with the duty now applied.

    Differs from the paper: |r omega| is kept above 1 mm/s and S_hat within [-1, 1]. The estimate knows neither the true
    speed nor the load: a wheel that spins under load turns slower at the same duty, and reads as gripping.
    """

    table: SpeedTable
    r: float

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the estimated slip [-]."""
        rim = self.r * reading.wheel_rate
        sense = np.where(rim < 0.0, -1.0, 1.0)
        speed = np.maximum(np.abs(rim), SLOWEST_RIM)
        return np.clip(1.0 - sense * self.table.speed_at(reading.duty) / speed, -1.0, 1.0)


def calibrated_table(model: Model, duties: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.55, 0.7, 0.85, 1.0)) -> SpeedTable:
    """Return the table measured by driving the rover on `model`'s terrain, which should be flat, at each duty for 6 s.

    The speed is the mean over the last second; the table starts at duty 0 and standstill.
    """
    speeds = [0.0]
    for duty in duties:
        trace = simulate(model, ConstantDuty(duty), 6.0)
        last = trace["t_s"] > 5.0
        speeds.append(float(np.mean(trace["body_vx"][last])))
    return SpeedTable((0.0, *map(float, duties)), tuple(speeds))
