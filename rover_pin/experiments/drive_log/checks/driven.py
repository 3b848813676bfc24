"""A logged run in short blocks: the means and speeds that the checks of a drive log look at, and what is declared."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rover_pin.experiments.drive_log.features import SLOW, SLOW_SHARE
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.slip import slip_ratios
from rover_pin.terrain.terrain import Terrain

Remarks = Iterator[tuple[str, str]]
"""What is wrong with a run, and what to do."""

BLOCK = 1.0
"""Length of a block [s]. Why: a tracker's 1.5 mm at 25 Hz then gives the speed within 1 mm/s."""

AT_LEAST = 5
"""Samples of a block, and blocks, that a judgement needs. Why: a mean's error is then half of a sample's."""

OFF, FAR_OFF = 3.0, 20.0
"""Times that a speed, a climb or a current is off what it can be where its unit may be another, and surely is. Why:
units differ by 3.6 or more, mA and counts by far more; a height over way of 3 is 72 deg; downhill a wheel is little
faster than its motor without load (assumed)."""

ROLLING = 0.3
"""Mean rim speed over mean size of rim speed, below which a rover turns rather than drives. Why: in a turn about one's
own wheel it is 0.5 (assumed)."""


class Declared(NamedTuple):
    """What a log declares for all its runs, as far as it does."""

    motor: Motor | None = None
    "where supply and resistance are declared"
    whole_motor: Motor | None = None
    "where all that its current follows from is"
    terrain: Terrain | None = None
    "where the log has one for all runs"
    length: float = 0.0
    "from the rear to the front axle of the rover [m]"
    has_differential: bool = False


@dataclass(frozen=True, eq=False)
class Driven:
    """One run of a drive log; `radius` is the wheels' [m]. Blocks that are mostly gaps are NaN."""

    trace: Trace
    radius: float
    declared: Declared = Declared()

    @property
    def name(self) -> str:
        """The run's file."""
        return str(self.trace.attrs.get("file", "run"))

    @cached_property
    def period(self) -> float:
        """Median time between samples [s]; 0 with fewer than two."""
        return float(np.median(np.diff(self.trace.t))) if len(self.trace.t) > 1 else 0.0

    @cached_property
    def length(self) -> float:
        """Length of a block [s]."""
        return max(BLOCK, AT_LEAST * self.period)

    @cached_property
    def block(self) -> np.ndarray:
        """Number of the block that a sample is in (T,)."""
        t = self.trace.t
        return np.floor((t - t[0]) / self.length).astype(int) if len(t) else np.zeros(0, dtype=int)

    def finite(self, channel: str) -> np.ndarray:
        """Return what is known of a channel (N,); nothing of one that is not recorded."""
        values = self.trace[channel] if channel in self.trace else np.zeros(0)
        return values[np.isfinite(values)]

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return the mean of a channel in every block (B,)."""
        finite = np.isfinite(values)
        count = np.bincount(self.block[finite], minlength=self._count)
        total = np.bincount(self.block[finite], values[finite], minlength=self._count)
        enough = count >= np.maximum(0.5 * np.bincount(self.block, minlength=self._count), 1)
        return np.where(enough, total / np.maximum(count, 1), np.nan)

    def slope(self, values: np.ndarray) -> np.ndarray:
        """Return the rate of change of a channel in every block by least squares (B,)."""
        values = np.where(np.isfinite(values), values, np.nan)
        t = np.where(np.isfinite(values), self.trace.t, np.nan)
        centred_t = t - self.mean(t)[self.block]
        centred_values = values - self.mean(values)[self.block]
        spread, together = self.mean(centred_t**2), self.mean(centred_t * centred_values)
        return np.where(spread > 0.0, together / np.where(spread > 0.0, spread, 1.0), np.nan)

    @property
    def _count(self) -> int:
        return int(self.block[-1]) + 1 if len(self.block) else 0

    def per_wheel(self, channel: str) -> np.ndarray:
        """Return the block means of a channel of all wheels (B, wheels)."""
        return np.column_stack([self.mean(column) for column in self.trace.stack(channel).T])

    @cached_property
    def duty(self) -> np.ndarray:
        """Mean duties (B, wheels); rates as shares of the fastest where they are the input."""
        return self.rate / self.fastest if self.trace.rate_driven else self.per_wheel("duty")

    @cached_property
    def fastest(self) -> float:
        """The greatest rate of a wheel in a block [rad/s]; above 0."""
        return float(np.nanmax(np.abs(self.rate), initial=1e-9))

    @property
    def still(self) -> float:
        """Wheel rate [rad/s] below which a wheel counts as standing."""
        return min(SLOW, SLOW_SHARE * self.fastest) if self.trace.rate_driven else SLOW

    @cached_property
    def rate(self) -> np.ndarray:
        """Mean wheel rates [rad/s] (B, wheels)."""
        return self.per_wheel("wheel_rate")

    @cached_property
    def rim(self) -> np.ndarray:
        """Mean rim speed of the wheels that are known [m/s] (B,); 0 where a rover turns on the spot."""
        finite = np.isfinite(self.rate)
        total = np.sum(np.where(finite, self.rate, 0.0), axis=1)
        count = np.sum(finite, axis=1)
        return np.where(count > 0, self.radius * total / np.maximum(count, 1), np.nan)

    @cached_property
    def velocity(self) -> np.ndarray:
        """Tracked horizontal velocity v_x + i v_y [m/s] (B,)."""
        return self.slope(self.trace["body_x"]) + 1j * self.slope(self.trace["body_y"])

    @cached_property
    def heading(self) -> np.ndarray:
        """Mean direction of the body's x axis as a unit complex number (B,)."""
        return self.direction(self.trace["body_yaw"])

    def direction(self, yaw: np.ndarray) -> np.ndarray:
        """Return the mean of exp(i yaw) in every block, of length 1 (B,)."""
        mean = self.mean(np.cos(yaw)) + 1j * self.mean(np.sin(yaw))
        return mean / np.where(np.abs(mean) > 0.0, np.abs(mean), 1.0)

    @cached_property
    def speed(self) -> np.ndarray:
        """Tracked speed along the heading, and along the slope where the pitch is known [m/s] (B,)."""
        along = np.real(self.velocity * np.conj(self.heading))
        if "body_pitch" not in self.trace:
            return along
        steepness = np.cos(self.mean(self.trace["body_pitch"]))
        return along / np.where(steepness > 0.2, steepness, 1.0)

    @cached_property
    def moving(self) -> np.ndarray:
        """Whether a wheel turns in a block (B,)."""
        return np.any(np.abs(np.where(np.isfinite(self.rate), self.rate, 0.0)) > self.still, axis=1)

    @cached_property
    def steady(self) -> np.ndarray:
        """Whether a block is driven ahead or back, and is not one in which the duty changes its sign (B,).

        The first block is left out, as is turning on the spot, where the rims tell no speed.
        """
        sign = np.sign(np.where(np.isfinite(self.duty), self.duty, 0.0)).sum(axis=1)
        turned = np.concatenate([[True], np.sign(sign[1:]) != np.sign(sign[:-1])]) if len(sign) else sign > 0
        turning = self.radius * self.mean_size(self.rate)
        return self.moving & ~turned & (np.abs(self.rim) > ROLLING * turning)

    def mean_size(self, values: np.ndarray) -> np.ndarray:
        """Return the mean size of what is known over the wheels (B,); 0 where nothing is."""
        finite = np.isfinite(values)
        return np.sum(np.abs(np.where(finite, values, 0.0)), axis=1) / np.maximum(np.sum(finite, axis=1), 1)

    @property
    def moving_time(self) -> float:
        """How long a wheel turns [s]."""
        return float(np.sum(self.moving[self.block])) * self.period

    @property
    def slip(self) -> np.ndarray:
        """Slip ratio of the rover as a whole in its steady blocks, by Eq (1) (blocks,)."""
        rim, speed = self.rim[self.steady], self.speed[self.steady]
        greatest = np.maximum(np.abs(rim), np.abs(speed))
        use = np.isfinite(greatest) & (greatest > 0.1 * self.still * self.radius)
        return slip_ratios(rim[use], speed[use]) * np.sign(rim[use])


def spread(values: np.ndarray) -> float:
    """Return the range from the 5th to the 95th percentile of what is known; 0 where nothing is."""
    finite_values = values[np.isfinite(values)]
    return float(np.ptp(np.percentile(finite_values, [5, 95]))) if finite_values.size else 0.0


def degrees(angle: float) -> str:
    """Return an angle [rad] as text in degrees."""
    return f"{math.degrees(angle):.3g} deg"
