"""On which dimensionless groups the channels of a rig set collapse, each level predicted from the others."""

import itertools
import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.baselines import missed_by_process
from rover_pin.experiments.wheel_rig.model import conditions
from rover_pin.measurements.channel import RigChannel, Sinkage, Torque, VerticalMoment
from rover_pin.measurements.rig_set import SAME_LOAD, RigSet
from rover_pin.parameters.gravity import EARTH
from rover_pin.soil.slip import slip_ratios

TRAVEL, SLIP, ANGLE = "r omega / V", "slip S", "slip angle"
LOAD, SPEED, DEPTH = "W / (gamma b r^2)", "V^2 / (g r)", "h / r"
NOBODY = "no group"
"""The set of groups that is none: a channel's mean."""


@brief
class Collapse(NamedTuple):
    """How well one channel is a function of some groups, on levels left out."""

    channel: str
    "as a dimensionless number"
    groups: tuple[str, ...]
    share: float
    "of the channel's variance that is explained; below 0 where the mean of the other levels is better"
    scatter: float
    "RMS that is left"
    noise: float
    "RMS of the stated SDs"
    by_level: tuple[float, ...]
    "mean square that is left of each level"

    @property
    def named(self) -> str:
        """The groups, in words."""
        return ", ".join(self.groups) or NOBODY

    @property
    def sentence(self) -> str:
        """One sentence for a reader."""
        if not self.groups:
            return f"{self.channel} collapses on no group: none is surely better than the mean on levels left out"
        noise = f"the scatter left is {self.scatter:.2g}, the noise {self.noise:.2g}"
        return f"{self.channel} collapses on {self.named}: {self.share:.1%} of its variance on levels left out; {noise}"


def slip_of_travel(data: RigSet) -> np.ndarray:
    """Return (r omega - V) / max(r omega, V) [runs], a function of r omega / V from -1 to 1; straight it is S."""
    _, _, along, rim, across = conditions(data.load, data.slip, data.speeds, data.slip_angle).T
    return slip_ratios(rim, np.hypot(along, across))


def groups(data: RigSet) -> dict[str, np.ndarray]:
    """Return the groups that vary over a set, each as a number in which curves are smooth [runs].

    r omega / V as the slip of the whole travel, load and speed as logarithms; h / r is measured, the others are set.
    gamma is that of the declared density, else 1 N/m^3: only its logarithm's range counts.
    """
    wheel = data.wheel
    values = {TRAVEL: slip_of_travel(data)}
    if data.askew.any():
        values |= {SLIP: data.slip, ANGLE: data.slip_angle}
    weight = data.beside.get("bulk_density", 1.0 / EARTH) * EARTH * float(wheel.b) * float(wheel.r) ** 2
    logarithms = {LOAD: np.log(data.load / weight)}
    if data.speeds is not None:
        travel = data.speeds[:, 0] / np.maximum(np.cos(data.slip_angle), 1e-6)
        logarithms[SPEED] = np.log(np.maximum(travel, 1e-9) ** 2 / (EARTH * float(wheel.r)))
    least = {LOAD: math.log(SAME_LOAD), SPEED: 2.0 * math.log(SAME_LOAD)}
    values |= {name: row for name, row in logarithms.items() if np.ptp(row) >= least[name]}
    sunk = [channel.measured for channel in data.channels if isinstance(channel, Sinkage)]
    return values | ({DEPTH: sunk[0] / float(wheel.r)} if sunk else {})


def as_number(data: RigSet, channel: RigChannel) -> tuple[str, np.ndarray]:
    """Return a channel as a dimensionless number: its name, and what its values are divided by [runs]."""
    r, load = float(data.wheel.r), data.load
    if isinstance(channel, Sinkage):
        return DEPTH, np.full(load.size, r)
    if isinstance(channel, (Torque, VerticalMoment)):
        return f"{channel.name} / (r W)", r * load
    return f"{channel.name} / W", load


def collapses(data: RigSet, progress: Callable[[str], None] = lambda message: None) -> list[Collapse]:
    """Return how well each channel is a function of each set of groups, a Gaussian process of them."""
    by_name, rows = groups(data), []
    for channel in data.channels:
        name, unit = as_number(data, channel)
        candidates = [group for group in by_name if group != name]
        progress(f"{name} by {', '.join(candidates)}")
        used = channel.has_value & np.all([np.isfinite(by_name[group]) for group in candidates], axis=0)
        values, level = (channel.measured / unit)[used], data.level[used]
        noise = float(np.sqrt(np.mean((channel.sd / unit)[used] ** 2)))
        mean = np.array([value - values[level != of].mean() for value, of in zip(values, level, strict=True)])
        for chosen in _sets(candidates):
            missed = mean
            if chosen:
                inputs = np.array([by_name[group][used] for group in chosen]).T
                missed = missed_by_process(inputs / np.maximum(np.ptp(inputs, axis=0), 1e-12), values, level)
            squares = tuple(float(np.mean(missed[level == of] ** 2)) for of in np.unique(level))
            share, scatter = 1.0 - float(missed @ missed / (mean @ mean)), float(np.sqrt(np.mean(missed**2)))
            rows.append(Collapse(name, chosen, share, scatter, noise, squares))
    return rows


def _sets(candidates: list[str]) -> Iterator[tuple[str, ...]]:
    """Yield sets of groups, the smallest first; two names of the slip say the same beside each other."""
    for size in range(len(candidates) + 1):
        yield from (some for some in itertools.combinations(candidates, size) if not {TRAVEL, SLIP} <= set(some))


def simplest(rows: list[Collapse]) -> dict[str, Collapse]:
    """Return for each channel the fewest groups that predict levels as well as the best, within two standard errors.

    Of sets of as many groups the best. The error is that of the mean difference over the levels of ln of the square
    that is left and noise besides, so that no one level decides. One of it, as in Breiman et al., Classification and
    Regression Trees (1984), is passed by chance where many sets are tried.
    """
    chosen: dict[str, Collapse] = {}
    for name in dict.fromkeys(row.channel for row in rows):
        ranked = sorted((row for row in rows if row.channel == name), key=lambda row: (len(row.groups), row.scatter))
        best = min(ranked, key=lambda row: row.scatter)
        chosen[name] = next(row for row in ranked if _is_as_good(row, best))
    return chosen


def _is_as_good(row: Collapse, best: Collapse) -> bool:
    row_squares, best_squares = (np.array(of.by_level) + of.noise**2 for of in (row, best))
    worse = np.log(row_squares / best_squares)
    return bool(worse.mean() <= 2.0 * worse.std() / math.sqrt(max(worse.size - 1, 1)))
