"""A tracked velocity that is smoothed before it is logged."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from rover_pin.base.quantity import quantity
from rover_pin.contact import Scalar
from rover_pin.effects.effect import SensorEffect

VELOCITIES = ("body_vx", "body_vy", "body_vz")


@dataclass(frozen=True)
class VelocityFilter(SensorEffect):
    """tau dy/dt = v - y, exactly for a velocity that is linear between the samples; y starts at the first sample.

    Source: first-order low-pass. Differs from the paper: its velocities are not filtered.
    """

    title: ClassVar[str] = "smoothed velocity"
    meaning: ClassVar[str] = "the tracked velocity is low-pass filtered before it is logged"
    tau: Scalar = quantity(0.3, "s", "assumed: smoothing over ten frames at 30 Hz", 0.0, 10.0, "tau")
    neutral: ClassVar[dict[str, float]] = {"tau": 0.0}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the smoothed velocities."""
        if self.tau == 0.0:
            return {}
        return {name: self._smooth_velocity(t, channels[name]) for name in VELOCITIES if name in channels}

    def _smooth_velocity(self, t: np.ndarray, v: np.ndarray) -> np.ndarray:
        y = np.array(v, dtype=float)
        for k in range(1, len(t)):
            step = t[k] - t[k - 1]
            rise, keep = (v[k] - v[k - 1]) / step, np.exp(-step / self.tau)
            y[k] = v[k] - rise * self.tau + (y[k - 1] - v[k - 1] + rise * self.tau) * keep
        return y
