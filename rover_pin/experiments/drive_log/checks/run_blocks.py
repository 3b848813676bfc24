"""Means of a logged run over blocks of about one second, and the statistics that the checks of a drive log compute from
them.

`RunBlocks` holds one run with the duties, wheel rates, tracked speed and slip of each block. The functions below the
class decide whether two series of block means are correlated beyond chance.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from rover_pin.experiments.drive_log.features import SLOW, SLOW_SHARE
from rover_pin.simulation.model.motor import Motor
from rover_pin.simulation.trace.trace import Trace
from rover_pin.soil.slip import slip_ratios
from rover_pin.terrain.terrain import Terrain

Remarks = Iterator[tuple[str, str]]
"""Pairs (fault of a run, remedy). If a remedy is empty, the report prints the remedy of the check (`Check.remedy`)."""

BLOCK = 1.0
"""Duration of a block [s]. Over this time, a tracker with a noise of 1.5 mm at 25 Hz gives the speed within 1 mm/s."""

MIN_SAMPLES = 5
"""Minimum number of samples in a block, and of blocks in a statistic. With fewer, the error of a mean exceeds about
half of the error of a single value, and the check is skipped."""

SUSPECT_RATIO, WRONG_RATIO = 3.0, 20.0
"""Limits for the ratio of a measured speed, climb or current to its largest possible value. Above the first limit the
unit is suspect, and above the second limit it is certainly wrong. Units of speed differ by a factor of 3.6 or more, and
mA and converter counts by far more; a ratio of height to distance of 3 is a slope of 72 deg; downhill, a wheel turns
only a little faster than its motor without load (assumed)."""

MIN_ROLLING = 0.3
"""Minimum ratio of the mean rim speed to the mean absolute rim speed. From this value on, the rover counts as driving
ahead or back. At a lower ratio, left and right wheels turn against each other, and the rover turns on the spot. A turn
about one of the wheels gives 0.5 (assumed)."""

MAX_CHANCE = 1e-5
"""Maximum probability that unrelated series have the observed correlation, if the correlation of a wheel's channel is
to refuse a run. A log has about a hundred such channels, so that chance refuses about one log in a thousand."""


class DeclaredFacts(NamedTuple):
    """Motor, terrain and rover dimensions that a log declares for all its runs, for use in the checks.

    Motor and terrain are None if the log does not declare them.
    """

    motor: Motor | None = None
    """the motor, if its supply voltage and resistance are declared"""
    whole_motor: Motor | None = None
    """the motor, if all numbers for the computation of its current are declared"""
    terrain: Terrain | None = None
    "the terrain, if one terrain is declared for all runs"
    length: float = 0.0
    "distance from the rear axle to the front axle of the rover [m]"
    has_differential: bool = False
    """whether a differential connects the two rockers of the rover"""


@dataclass(frozen=True, eq=False)
class RunBlocks:
    """One run of a drive log divided into blocks of time. Most properties are means over these blocks.

    The mean over a block is NaN if more than half of its samples are missing.

    Parameters
    ----------
    trace : Trace
        The run in SI units, unchanged after reading.
    radius : float
        Radius of the wheels [m].
    declared : DeclaredFacts
        Motor, terrain and dimensions of the rover that the log declares.
    """

    trace: Trace
    radius: float
    declared: DeclaredFacts = DeclaredFacts()

    @property
    def name(self) -> str:
        """Name of the run's file."""
        return str(self.trace.attrs.get("file", "run"))

    @cached_property
    def period(self) -> float:
        """Median time between two samples of the run [s]; 0 for fewer than two samples."""
        return float(np.median(np.diff(self.trace.t))) if len(self.trace.t) > 1 else 0.0

    @cached_property
    def length(self) -> float:
        """Duration of a block [s]: BLOCK, or the duration of MIN_SAMPLES samples if this is longer."""
        return max(BLOCK, MIN_SAMPLES * self.period)

    @cached_property
    def block(self) -> np.ndarray:
        """Index of each sample's block (rows,)."""
        t = self.trace.t
        return np.floor((t - t[0]) / self.length).astype(int) if len(t) else np.zeros(0, dtype=int)

    @property
    def _count(self) -> int:
        """Number of blocks B."""
        return int(self.block[-1]) + 1 if len(self.block) else 0

    def finite(self, channel: str) -> np.ndarray:
        """Return the values of a channel that are finite (N,), or an empty array if the channel is not recorded."""
        values = self.trace[channel] if channel in self.trace else np.zeros(0)
        return values[np.isfinite(values)]

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return the mean of samples (rows,) over each block (blocks,); NaN where more than half of the samples are
        missing.
        """
        finite = np.isfinite(values)
        count = np.bincount(self.block[finite], minlength=self._count)
        total = np.bincount(self.block[finite], values[finite], minlength=self._count)
        enough = count >= np.maximum(0.5 * np.bincount(self.block, minlength=self._count), 1)
        return np.where(enough, total / np.maximum(count, 1), np.nan)

    def mean_size(self, values: np.ndarray) -> np.ndarray:
        """Return the mean absolute value over the wheels (blocks,), from block means (blocks, wheels); 0 in a block
        without any value.
        """
        finite = np.isfinite(values)
        return np.sum(np.abs(np.where(finite, values, 0.0)), axis=1) / np.maximum(np.sum(finite, axis=1), 1)

    def slope(self, values: np.ndarray) -> np.ndarray:
        """Return the rate of change of samples (rows,) within each block (blocks,) [1/s], as the slope of a
        least-squares line.
        """
        # Time and value of missing samples are left out, so that both means belong to the same samples.
        values = np.where(np.isfinite(values), values, np.nan)
        t = np.where(np.isfinite(values), self.trace.t, np.nan)
        centred_t = t - self.mean(t)[self.block]
        centred_values = values - self.mean(values)[self.block]
        variance, covariance = self.mean(centred_t**2), self.mean(centred_t * centred_values)
        return np.where(variance > 0.0, covariance / np.where(variance > 0.0, variance, 1.0), np.nan)

    def per_wheel(self, channel: str) -> np.ndarray:
        """Return the block means (blocks, wheels) of a channel that each wheel has, such as "duty" or "wheel_rate"."""
        return np.column_stack([self.mean(column) for column in self.trace.stack(channel).T])

    @cached_property
    def duty(self) -> np.ndarray:
        """Mean duty of each wheel in each block (blocks, wheels).

        A log without duties has the measured wheel rates as the input of a replay. For such a log, the duty is replaced
        by the wheel rate divided by the fastest wheel rate.
        """
        return self.rate / self.fastest if self.trace.rate_driven else self.per_wheel("duty")

    @cached_property
    def fastest(self) -> float:
        """Largest absolute block mean of a wheel rate, over all wheels and blocks [rad/s]; at least 1e-9."""
        return float(np.nanmax(np.abs(self.rate), initial=1e-9))

    @property
    def still(self) -> float:
        """Minimum wheel rate [rad/s] of a turning wheel."""
        return min(SLOW, SLOW_SHARE * self.fastest) if self.trace.rate_driven else SLOW

    @cached_property
    def rate(self) -> np.ndarray:
        """Mean rate of each wheel in each block [rad/s] (blocks, wheels)."""
        return self.per_wheel("wheel_rate")

    @cached_property
    def rim(self) -> np.ndarray:
        """Mean rim speed in each block [m/s] (blocks,), over all wheels with a recorded rate. It is 0 if the rover
        turns on the spot.
        """
        finite = np.isfinite(self.rate)
        total = np.sum(np.where(finite, self.rate, 0.0), axis=1)
        count = np.sum(finite, axis=1)
        return np.where(count > 0, self.radius * total / np.maximum(count, 1), np.nan)

    @cached_property
    def velocity(self) -> np.ndarray:
        """Tracked horizontal velocity in each block, as the complex number v_x + i v_y [m/s] (blocks,)."""
        return self.slope(self.trace["body_x"]) + 1j * self.slope(self.trace["body_y"])

    @cached_property
    def heading(self) -> np.ndarray:
        """Mean direction of the body's x axis in each block, as a complex number of size 1 (blocks,)."""
        return self.direction(self.trace["body_yaw"])

    def direction(self, yaw: np.ndarray) -> np.ndarray:
        """Return the mean direction of yaw angles (rows,) [rad] in each block, as complex numbers of size 1
        (blocks,).
        """
        mean = self.mean(np.cos(yaw)) + 1j * self.mean(np.sin(yaw))
        return mean / np.where(np.abs(mean) > 0.0, np.abs(mean), 1.0)

    @cached_property
    def speed(self) -> np.ndarray:
        """Tracked speed along the heading in each block [m/s] (blocks,), measured along the slope if the pitch is
        recorded.
        """
        along = np.real(self.velocity * np.conj(self.heading))
        if "body_pitch" not in self.trace:
            return along
        # The tracker gives the horizontal speed. Near-vertical pitch angles are faults and are not divided by.
        steepness = np.cos(self.mean(self.trace["body_pitch"]))
        return along / np.where(steepness > 0.2, steepness, 1.0)

    @cached_property
    def moving(self) -> np.ndarray:
        """Mask of the blocks with at least one turning wheel (blocks,)."""
        return np.any(np.abs(np.where(np.isfinite(self.rate), self.rate, 0.0)) > self.still, axis=1)

    @cached_property
    def steady(self) -> np.ndarray:
        """Mask of the blocks with a rover that drives ahead or back and with a duty that keeps its sign (blocks,).

        The first block is never steady. A turn on the spot is not steady either, because the mean rim speed is then not
        the speed of the rover.
        """
        sign = np.sign(np.where(np.isfinite(self.duty), self.duty, 0.0)).sum(axis=1)
        reversed_duty = np.concatenate([[True], np.sign(sign[1:]) != np.sign(sign[:-1])]) if len(sign) else sign > 0
        turning = self.radius * self.mean_size(self.rate)
        return self.moving & ~reversed_duty & (np.abs(self.rim) > MIN_ROLLING * turning)

    @property
    def moving_time(self) -> float:
        """Total time with at least one turning wheel [s]."""
        return float(np.sum(self.moving[self.block])) * self.period

    @property
    def slip(self) -> np.ndarray:
        """Slip ratio S in each steady block (blocks,), from mean rim speed and tracked speed.

        S is defined by Eq (1) of the paper, the ratio of the difference between rim speed and travel speed to the
        larger of both. Blocks with two speeds of nearly zero are omitted, because their slip is noise.
        """
        rim, speed = self.rim[self.steady], self.speed[self.steady]
        greatest = np.maximum(np.abs(rim), np.abs(speed))
        use = np.isfinite(greatest) & (greatest > 0.1 * self.still * self.radius)
        return slip_ratios(rim[use], speed[use]) * np.sign(rim[use])


def is_significant(correlation: float, count: float, max_chance: float = MAX_CHANCE) -> bool:
    """Return whether a correlation coefficient is too large to be explained by chance, by a one-sided Student's t-test.

    Parameters
    ----------
    correlation : float
        Correlation coefficient of two series.
    count : float
        Number of independent samples in the series, from `independent_blocks`.
    max_chance : float
        Limit of the probability that unrelated series reach this correlation. The correlation is significant if its
        probability is lower.
    """
    if count <= 2.5:
        return False
    t = abs(correlation) * math.sqrt((count - 2.0) / max(1.0 - correlation**2, 1e-12))
    return float(student.sf(t, count - 2.0)) < max_chance


def independent_blocks(a: np.ndarray, b: np.ndarray) -> float:
    """Return the effective number of independent samples in the correlation of two series of block means (n,).

    Slowly varying series have few independent samples and easily correlate by chance. The number is n (1 - a_1 b_1) /
    (1 + a_1 b_1), where a_1 and b_1 are the autocorrelations of neighbouring blocks in both series. Source: Bartlett
    1946.
    """
    # A negative autocorrelation counts as 0.
    product = 1.0
    for series in (a - np.mean(a), b - np.mean(b)):
        power = float(series @ series)
        product *= float(np.clip(series[1:] @ series[:-1] / power, 0.0, 0.99)) if power > 0.0 else 0.0
    return len(a) * (1.0 - product) / (1.0 + product)


def correlation_about_zero(a: np.ndarray, b: np.ndarray) -> float:
    """Return the correlation of two series about zero: sum(a b) / sqrt(sum(a^2) sum(b^2)), over samples that both have.

    Unlike in the usual correlation coefficient, the means are not subtracted, so that the signs of the series count.
    The result is 0 for fewer than MIN_SAMPLES common samples.
    """
    use = np.isfinite(a) & np.isfinite(b)
    size = math.sqrt(float(np.sum(a[use] ** 2)) * float(np.sum(b[use] ** 2)))
    return float(np.sum(a[use] * b[use])) / size if np.sum(use) >= MIN_SAMPLES and size > 0.0 else 0.0


def spread(values: np.ndarray) -> float:
    """Return the range of the finite values from the 5th to the 95th percentile; 0 if no value is finite."""
    finite_values = values[np.isfinite(values)]
    return float(np.ptp(np.percentile(finite_values, [5, 95]))) if finite_values.size else 0.0


def degrees(angle: float) -> str:
    """Return an angle [rad] as text in degrees with three digits, such as "12.5 deg"."""
    return f"{math.degrees(angle):.3g} deg"
