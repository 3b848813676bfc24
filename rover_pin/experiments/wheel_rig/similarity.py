"""Find dimensionless groups that determine the channels of a rig data set, tested on held-out slip levels.

A channel collapses on some groups if it is a function of these groups alone.
"""

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.baselines import missed_by_process
from rover_pin.experiments.wheel_rig.model import conditions
from rover_pin.measurements.channel import MotorTorque, RigChannel, Sinkage, Torque, VerticalMoment
from rover_pin.measurements.rig_set import SAME_LOAD, RigSet
from rover_pin.soil.slip import slip_ratios

TRAVEL, SLIP, ANGLE = "r omega / V", "slip S", "slip angle"
"""Names of the dimensionless groups that every rig has: rim speed r omega divided by travel speed V, slip along the
heading, and slip angle."""
LOAD, SPEED, DEPTH = "W / (gamma b r^2)", "V^2 / (g r)", "h / r"
"""Names of the dimensionless groups of the load W (with the weight gamma of the soil, and width b and radius r of the
wheel), of the travel speed V (with the gravity g), and of the sinkage h."""
NO_GROUP = "no group"
"""Words for a prediction without any group: each channel is then predicted by the mean of the other slip levels."""


@brief
class Collapse(NamedTuple):
    """How accurately a function of some dimensionless groups predicts one channel on held-out slip levels."""

    channel: str
    "name of the channel as a dimensionless number"
    groups: tuple[str, ...]
    "names of the groups"
    share: float
    """explained fraction of the channel's variance on held-out levels; negative if the mean of the other levels
    predicts better"""
    scatter: float
    """RMS of the prediction error on held-out levels"""
    noise: float
    "RMS of the stated SDs"
    by_level: tuple[float, ...]
    "mean square of the prediction error of each level"

    @property
    def named(self) -> str:
        """The names of the groups separated by commas, or "no group"."""
        return ", ".join(self.groups) or NO_GROUP

    @property
    def sentence(self) -> str:
        """A sentence with the groups, the explained fraction of the variance, the prediction error, and the noise."""
        if not self.groups:
            return f"{self.channel} collapses on no group: none predicts held-out levels clearly better than the mean"
        noise = f"the prediction error is {self.scatter:.2g}, the noise {self.noise:.2g}"
        return f"{self.channel} collapses on {self.named}: {self.share:.1%} of its variance on held-out levels; {noise}"


def slip_of_travel(data: RigSet) -> np.ndarray:
    """Return the slip of the whole travel of each run (runs,), (r omega - V) / max(r omega, V).

    Here r omega is the rim speed and V the travel speed, sideways motion included. The value lies between -1 and 1. For
    a wheel without a slip angle, it equals the slip S along the heading.
    """
    _, _, along, rim, across = conditions(data.load, data.slip, data.speeds, data.slip_angle).T
    return slip_ratios(rim, np.hypot(along, across))


def groups(data: RigSet) -> dict[str, np.ndarray]:
    """Return the dimensionless groups that vary within a data set: name -> values (runs,).

    The values are scaled for smooth functions: for r omega / V (rim speed divided by travel speed), the value is the
    slip of the whole travel, and for load and speed it is a logarithm. The sinkage h / r is measured, and all other
    groups are set by the rig. The weight gamma of the soil is the declared density times gravity. Without a declared
    density, gamma is 1 N/m^3, because only differences of the logarithm matter.
    """
    wheel = data.wheel
    values = {TRAVEL: slip_of_travel(data)}
    if data.askew.any():
        values |= {SLIP: data.slip, ANGLE: data.slip_angle}
    weight = (
        (data.beside["bulk_density"] * data.gravity if "bulk_density" in data.beside else 1.0)
        * float(wheel.b)
        * float(wheel.r) ** 2
    )
    logarithms = {LOAD: np.log(data.load / weight)}
    if data.speeds is not None:
        # Travel speed along the heading, divided by the cosine of the slip angle, is the speed of the whole travel.
        travel = data.speeds[:, 0] / np.maximum(np.cos(data.slip_angle), 1e-6)
        logarithms[SPEED] = np.log(np.maximum(travel, 1e-9) ** 2 / (data.gravity * float(wheel.r)))
    # A group counts as varied if the load, or the speed, varies by the factor SAME_LOAD.
    min_range = {LOAD: math.log(SAME_LOAD), SPEED: 2.0 * math.log(SAME_LOAD)}
    values |= {name: row for name, row in logarithms.items() if np.ptp(row) >= min_range[name]}
    sunk = [channel.measured for channel in data.channels if isinstance(channel, Sinkage)]
    return values | ({DEPTH: sunk[0] / float(wheel.r)} if sunk else {})


def as_number(data: RigSet, channel: RigChannel) -> tuple[str, np.ndarray]:
    """Return the name of a channel as a dimensionless number, such as "drawbar pull / W", and the divisors of its
    values (runs,).
    """
    # Torques and moments are divided by radius times load, forces by the load.
    r, load = float(data.wheel.r), data.load
    if isinstance(channel, Sinkage):
        return DEPTH, np.full(load.size, r)
    if isinstance(channel, (Torque, MotorTorque, VerticalMoment)):
        return f"{channel.name} / (r W)", r * load
    return f"{channel.name} / W", load


def collapses(data: RigSet, progress: Callable[[str], None] = lambda message: None) -> list[Collapse]:
    """Return how accurately each combination of dimensionless groups predicts each channel on held-out slip levels.

    Each level is predicted by a Gaussian process of the groups that is fitted to all other levels.

    Parameters
    ----------
    data : RigSet
        The measured runs.
    progress : callable
        Function that is called with a line of text before each channel.
    """
    by_name, rows = groups(data), []
    for channel in data.channels:
        name, unit = as_number(data, channel)
        candidates = [group for group in by_name if group != name]
        progress(f"{name} by {', '.join(candidates)}")
        used = channel.has_value & np.all([np.isfinite(by_name[group]) for group in candidates], axis=0)
        values, level = (channel.measured / unit)[used], data.level[used]
        noise = float(np.sqrt(np.mean((channel.sd / unit)[used] ** 2)))
        # Without a group, the mean of the other levels predicts a level.
        mean = np.array([value - values[level != own].mean() for value, own in zip(values, level, strict=True)])
        # All combinations, the smallest first. Both forms of the slip say nearly the same, so one of them is enough.
        combinations = itertools.chain.from_iterable(
            itertools.combinations(candidates, size) for size in range(len(candidates) + 1)
        )
        for chosen in combinations:
            if {TRAVEL, SLIP} <= set(chosen):
                continue
            missed = mean
            if chosen:
                inputs = np.array([by_name[group][used] for group in chosen]).T
                missed = missed_by_process(inputs / np.maximum(np.ptp(inputs, axis=0), 1e-12), values, level)
            squares = tuple(float(np.mean(missed[level == number] ** 2)) for number in np.unique(level))
            share, scatter = 1.0 - float(missed @ missed / (mean @ mean)), float(np.sqrt(np.mean(missed**2)))
            rows.append(Collapse(name, chosen, share, scatter, noise, squares))
    return rows


def simplest(rows: list[Collapse]) -> dict[str, Collapse]:
    """Return for each channel the fewest groups whose prediction of held-out slip levels is as good as the best one.

    A combination counts as equally good if its error exceeds the error of the best combination by at most two standard
    errors. Among combinations of equal size, the best one is returned. The compared quantity is the logarithm of mean
    square error plus noise of each level, averaged over the levels, so that no single level decides. Breiman et al.,
    Classification and Regression Trees (1984), take one standard error, which chance exceeds if many combinations are
    tried.
    """
    chosen: dict[str, Collapse] = {}
    for name in dict.fromkeys(row.channel for row in rows):
        # The smallest combinations come first, so that the first one that is good enough is the simplest.
        ranked = sorted((row for row in rows if row.channel == name), key=lambda row: (len(row.groups), row.scatter))
        best = min(ranked, key=lambda row: row.scatter)
        for row in ranked:
            # The noise is added, so that two errors below the noise count as equal.
            row_squares, best_squares = (np.array(each.by_level) + each.noise**2 for each in (row, best))
            worse = np.log(row_squares / best_squares)
            if worse.mean() <= 2.0 * worse.std() / math.sqrt(max(worse.size - 1, 1)):
                chosen[name] = row
                break
    return chosen
