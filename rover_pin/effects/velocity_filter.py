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
    """The tracked velocity v is low-pass filtered to y before it is logged: tau dy/dt = v - y.

    The equation is solved exactly for a velocity that is linear between the samples, and y starts at the first sample.

    Source: first-order low-pass filter. Differs from the paper: its velocities are not filtered.
    """

    title: ClassVar[str] = "smoothed velocity"
    meaning: ClassVar[str] = "the tracked velocity is low-pass filtered before it is logged"
    tau: Scalar = quantity(0.3, "s", "assumed: smoothing over ten frames at 30 Hz", 0.0, 10.0, "tau")
    neutral: ClassVar[dict[str, float]] = {"tau": 0.0}

    def read(self, t: np.ndarray, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the logged velocities of the body: the velocities after the low-pass filter."""
        if self.tau == 0.0:
            return {}
        smoothed = {}
        for name in (name for name in VELOCITIES if name in channels):
            v = channels[name]
            # The filter starts at the first sample, so that a constant velocity passes unchanged.
            y = np.array(v, dtype=float)
            for k in range(1, len(t)):
                # Exact step of the filter: the particular solution lags a ramp by tau, the rest decays.
                step = t[k] - t[k - 1]
                rise, keep = (v[k] - v[k - 1]) / step, np.exp(-step / self.tau)
                y[k] = v[k] - rise * self.tau + (y[k - 1] - v[k - 1] + rise * self.tau) * keep
            smoothed[name] = y
        return smoothed
