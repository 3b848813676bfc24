"""Simulated speed measurements by cameras, with noise, delay and dropouts: visual odometry on board, and an external
tracker.
"""

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
    """The errors of visual odometry, a speed measurement from the images of a camera on board.

    Source: assumed, of the size that rovers report; the paper has no visual odometry.
    """

    sd: Scalar = quantity(0.004, "m/s", "assumed: a tenth of the rover's speed", 1e-5, 10.0)
    scale: Scalar = quantity(1.0, "", "assumed: a calibrated stereo base", 0.1, 10.0)
    latency: Scalar = quantity(0.5, "s", "assumed: time to match two images", 0.0, 10.0)
    period: Scalar = quantity(0.1, "s", "assumed: ten images a second", 1e-3, 10.0)
    dropouts: Scalar = quantity(0.1, "", "assumed: fraction of images without features", 0.0, 1.0)


class VisualOdometry:
    """A simulated visual odometry, which measures the forward speed with noise, latency and dropouts, sample by sample.

    Parameters
    ----------
    camera : Camera
        The errors of the measurement.
    control_period : float
        Time between two calls of `speed` [s].
    seed : int
        Seed of the random noise; `reset` starts the noise from this seed again.
    """

    def __init__(self, camera: Camera, control_period: float, seed: int):
        self.camera, self.seed = camera, seed
        self.lag = round(float(camera.latency) / control_period)
        "latency, as a number of samples"
        self.image_interval = max(1, round(float(camera.period) / control_period))
        "number of samples from one image to the next"
        self.reset()

    def reset(self) -> None:
        """Start the noise from its seed again and discard the images that are still being processed, at the start of a
        drive.
        """
        self.random = np.random.default_rng(self.seed)
        self.pending: deque[float] = deque()
        self.samples = 0

    def speed(self, reading: Reading) -> float:
        """Return the forward speed [m/s] that was measured one latency ago, or NaN if no image measured the speed at
        that time.

        Call this method once in each control period.
        """
        heading, velocity = reading.attitude[2], reading.truth.velocity
        true_speed = float(velocity[0]) * math.cos(heading) + float(velocity[1]) * math.sin(heading)
        noise, lost = self.random.standard_normal(), self.random.random() < float(self.camera.dropouts)
        self.samples += 1
        seen = not lost and self.samples % self.image_interval == 0
        measured = float(self.camera.scale) * true_speed + float(self.camera.sd) * noise
        # One value for each sample waits for the latency to pass, so that a late value keeps its own time.
        self.pending.append(measured if seen else math.nan)
        return self.pending.popleft() if len(self.pending) > self.lag else math.nan


@dataclass(frozen=True)
class Tracker(Record):
    """The errors of an external tracker next to the test rig. If both numbers are 0, the tracker measures the true
    speed.
    """

    sd: Scalar = quantity(Sensors().velocity_sd, "m/s", "assumed: video tracking, the value of `Sensors`", 0.0, 1.0)
    delay: Scalar = quantity(0.1, "s", "assumed: time to take, match and send two images", 0.0, 10.0)


class TrackedSlip:
    """A slip estimate by Eq (1) of the paper from the wheel rates and the travel speed that an external tracker
    measures.

    The measured travel speed has noise and a delay. All wheels have one common noise, because the tracker measures the
    body.

    Parameters
    ----------
    radii : array
        Radii of the wheels (wheels,) [m].
    tracker : Tracker
        The errors of the measurement.
    period : float
        Time between two calls of `slip` [s].
    seed : int
        Seed of the random noise; `reset` starts the noise from this seed again.

    Source: section 2 of the paper, "3D video tracking"; its errors are assumed.
    """

    def __init__(self, radii: np.ndarray, tracker: Tracker, period: float, seed: int):
        self.radii, self.tracker, self.seed = radii, tracker, seed
        self.lag = round(float(tracker.delay) / period)
        self.reset()

    def reset(self) -> None:
        """Start the noise from its seed again and discard the images that are still being processed, at the start of a
        drive.
        """
        self.random = np.random.default_rng(self.seed)
        self.pending: deque[tuple[np.ndarray, np.ndarray]] = deque()

    def slip(self, reading: Reading) -> np.ndarray:
        """Return the estimated slip S_hat of each wheel (wheels,) [-] at the time one delay ago. Until the delay has
        passed, the result is the estimate of the first sample.

        Call this method once in each control period.
        """
        # One random number is added to the speeds of all wheels, because the tracker measures the body once.
        rim = self.radii * reading.wheel_rate
        v = reading.truth.travel + float(self.tracker.sd) * self.random.standard_normal()
        S = [float(slip_ratio(*speeds, AlgebraicSlip().v_0)) for speeds in zip(rim.tolist(), v.tolist(), strict=True)]
        # A wheel in reverse has the slip of its mirror image.
        self.pending.append((np.clip(np.where(rim < 0.0, -1.0, 1.0) * S, -1.0, 1.0), v))
        if len(self.pending) > self.lag + 1:
            self.pending.popleft()
        return self.pending[0][0]

    def travel(self, reading: Reading) -> np.ndarray:
        """Return the travel speeds of the wheels (wheels,) [m/s] that the latest S_hat was computed from."""
        return self.pending[0][1]
