"""What cameras tell, noisy, late or nothing: the speed of the base from on board, the slip by a tracker beside."""

import math
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
class Camera(Record):
    """A visual odometry's errors. Source: assumed, of the order of what rovers report; the paper has none."""

    sd: Scalar = quantity(0.004, "m/s", "assumed: a tenth of the rover's speed", 1e-5, 10.0)
    scale: Scalar = quantity(1.0, "", "assumed: a calibrated stereo base", 0.1, 10.0)
    latency: Scalar = quantity(0.5, "s", "assumed: matching two images takes so long", 0.0, 10.0)
    period: Scalar = quantity(0.1, "s", "assumed: ten images a second", 1e-3, 10.0)
    dropouts: Scalar = quantity(0.1, "", "assumed: share of images without features", 0.0, 1.0)


class VisualOdometry:
    """What a camera tells of the forward speed, sample by sample; `reset` starts the noise of the seed again."""

    def __init__(self, camera: Camera, control_period: float, seed: int):
        self.camera, self.seed = camera, seed
        self.lag = round(float(camera.latency) / control_period)
        self.every = max(1, round(float(camera.period) / control_period))
        self.reset()

    def reset(self) -> None:
        """Begin again."""
        self.random = np.random.default_rng(self.seed)
        self.pending: deque[float] = deque()
        self.taken = 0

    def speed(self, reading: Reading) -> float:
        """Return the forward speed of `latency` ago [m/s]; NaN where no image tells it."""
        heading, velocity = reading.attitude[2], reading.truth.velocity
        true_speed = float(velocity[0]) * math.cos(heading) + float(velocity[1]) * math.sin(heading)
        noise, lost = self.random.standard_normal(), self.random.random() < float(self.camera.dropouts)
        self.taken += 1
        seen = not lost and self.taken % self.every == 0
        measured = float(self.camera.scale) * true_speed + float(self.camera.sd) * noise
        self.pending.append(measured if seen else math.nan)
        return self.pending.popleft() if len(self.pending) > self.lag else math.nan


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
