"""The slip as an external tracker would give it: from a travel speed that is noisy and late."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from rover_pin.base.quantity import Record, quantity
from rover_pin.contact import Scalar
from rover_pin.effects.slip import AlgebraicSlip
from rover_pin.simulation.command import Reading
from rover_pin.simulation.sensors import Sensors
from rover_pin.soil.slip import slip_ratio


@dataclass(frozen=True)
class Tracker(Record):
    """What a tracker beside the test bed adds to the truth; 0 and 0 is the truth itself."""

    sd: Scalar = quantity(Sensors().velocity_sd, "m/s", "assumed: video tracking, as of `Sensors`", 0.0, 1.0)
    delay: Scalar = quantity(0.1, "s", "assumed: two images are taken, matched and sent", 0.0, 10.0)


class TrackedSlip:
    """S_hat by Eq (1) from the travel speed of a while ago with noise, which is that of the body: all wheels share it.

    `reset` starts the noise of the seed again. Source: section 2, "3D video tracking"; its errors are assumed.
    """

    def __init__(self, radii: np.ndarray, tracker: Tracker, period: float, seed: int):
        self.radii, self.tracker, self.seed = radii, tracker, seed
        self.lag = round(float(tracker.delay) / period)
        self.reset()

    def reset(self) -> None:
        """Begin again."""
        self.random = np.random.default_rng(self.seed)
        self.pending: deque[tuple[np.ndarray, np.ndarray]] = deque()

    def slip(self, reading: Reading) -> np.ndarray:
        """Return S_hat, one value a wheel [-]; the first one until a later one has come through."""
        rim = self.radii * reading.wheel_rate
        v = reading.truth.travel + float(self.tracker.sd) * self.random.standard_normal()
        S = [float(slip_ratio(*speeds, AlgebraicSlip().v_0)) for speeds in zip(rim.tolist(), v.tolist(), strict=True)]
        self.pending.append((np.clip(np.where(rim < 0.0, -1.0, 1.0) * S, -1.0, 1.0), v))
        if len(self.pending) > self.lag + 1:
            self.pending.popleft()
        return self.pending[0][0]

    def travel(self, reading: Reading) -> np.ndarray:
        """Return the travel speeds behind the slips last told [m/s]."""
        return self.pending[0][1]
