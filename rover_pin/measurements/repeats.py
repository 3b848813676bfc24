"""Repeated runs of a wheel rig: find the groups of runs that repeat one another, and estimate the noise of one run from
the scatter within the groups.
"""

from typing import NamedTuple

import numpy as np
from scipy.stats import f as f_distribution

from rover_pin.measurements.rig_set import SAME_LEVEL, STRAIGHT, classes

SAME_WEIGHT = 1.1
"""Largest ratio of neighbouring loads (sorted by size) within a group of repeated runs. The value allows a hung weight
to vary by 5 % in both directions (assumed)."""
MIN_FREEDOM = 3
"""Minimum degrees of freedom for an estimate of the noise from repeated runs. With three, the 95 % interval of the SD
extends from 0.57 to 3.7 times the estimate."""
OUTLYING_PROBABILITY = 0.01
"""Minimum probability of the scatter of a group of repeated runs: the probability that chance gives at least one of all
groups such a scatter. With a smaller probability, the scatter counts as outlying. The value is the one at which ISO
5725-2 calls a variance an outlier."""


def repeat_groups(level: np.ndarray, load: np.ndarray, slip_angle: np.ndarray) -> np.ndarray:
    """Return, for each run, the number of its group of repeated runs (runs,).

    The runs of a group have one slip level and one slip angle, and their loads, sorted by size, differ from one to the
    next by less than the factor SAME_WEIGHT.

    Parameters
    ----------
    level : array of int (runs,)
        Number of the slip level of each run, from `level_numbers`.
    load, slip_angle : array (runs,)
        Vertical load [N] and slip angle [rad].
    """
    askew = classes(slip_angle, STRAIGHT)
    # Runs are sorted by level, then slip angle, then load, so that repeats are neighbours.
    order = np.lexsort((load, askew, level))
    load, level, angle = load[order], level[order], askew[order]
    is_new_group = (np.diff(level) != 0) | (np.diff(angle) != 0) | (load[1:] > SAME_WEIGHT * load[:-1])
    group = np.empty(order.size, dtype=int)
    group[order] = np.concatenate([[0], np.cumsum(is_new_group)])
    return group


def level_numbers(slip: np.ndarray, names: np.ndarray | None) -> np.ndarray:
    """Return the number of the slip level of each run (runs,): runs with equal numbers were made at nearly equal slip.

    `names` (runs,) are the names of the slip levels in the data. If `names` is None, slips that are close together form
    a level.
    """
    return classes(slip, SAME_LEVEL) if names is None else np.unique(names.astype(str), return_inverse=True)[1]


class RepeatNoise(NamedTuple):
    """SD of one run, estimated from the scatter of repeated runs, with its degrees of freedom and the runs that were
    dropped.
    """

    sd: float
    freedom: int
    "degrees of freedom: number of values minus number of groups"
    outlying: tuple[int, ...]
    """indices of the runs in groups that were dropped, because these groups scatter much more than the others"""


def repeat_noise(values: np.ndarray, slip: np.ndarray, group: np.ndarray) -> RepeatNoise | None:
    """Estimate the SD of one run from the scatter of repeated runs; return None if there are fewer than MIN_FREEDOM
    degrees of freedom.

    The SD is pooled over the groups of repeats: sqrt(sum d^2 / degrees of freedom), where d is the deviation of a value
    from the mean of its group. The slips of repeats differ slightly and the curve rises with slip, so that each value
    is first moved to the mean slip of its group, along the slope of the curve between the neighbouring groups. A group
    with an erroneous run would increase the noise of all runs. The group with the largest variance is therefore left
    out if an F test against the other groups finds it outlying. This test is repeated while half of the degrees of
    freedom remain.

    Parameters
    ----------
    values, slip : array (runs,)
        A channel, NaN where it was not measured, and the slip of Eq (1).
    group : array of int (runs,)
        Group of repeats of each run, from `repeat_groups`.

    Source: ISO 5725-2 (1994), 7.3.3, for the successive test of variances (there Cochran's test, for groups of equal
    size).
    """
    # Only runs with a value of this channel count; the groups are numbered anew without the others.
    runs = np.flatnonzero(np.isfinite(values))
    values, slip, group = values[runs], slip[runs], np.unique(group[runs], return_inverse=True)[1]
    count = np.bincount(group)
    mean, middle = np.bincount(group, values) / count, np.bincount(group, slip) / count
    deviations = values - mean[group] - _slopes(mean, middle)[group] * (slip - middle[group])
    squares, freedom = np.bincount(group, deviations**2), count - 1
    # Groups of a single run have no degrees of freedom.
    used = freedom > 0
    least = max(MIN_FREEDOM, freedom.sum() / 2.0)
    while True:
        # A group may be left out only if enough degrees of freedom remain, and if the other groups scatter at all.
        others = freedom[used].sum() - freedom
        candidates = np.flatnonzero(used & (others >= least) & (squares < squares[used].sum()))
        if not candidates.size:
            break
        of_others = (squares[used].sum() - squares[candidates]) / others[candidates]
        ratio = squares[candidates] / freedom[candidates] / of_others
        # The probability is multiplied by the number of groups, because the most scattered of all groups is tested.
        chance = f_distribution.sf(ratio, freedom[candidates], others[candidates]) * used.sum()
        if chance.min() > OUTLYING_PROBABILITY:
            break
        used[candidates[chance.argmin()]] = False
    total = int(freedom[used].sum())
    if total < MIN_FREEDOM:
        return None
    sd = float(np.sqrt(squares[used].sum() / total))
    outlying = tuple(int(run) for run in runs[~used[group] & (freedom[group] > 0)])
    # Repeats that agree to the last digit were copied or rounded, so they show no noise.
    return RepeatNoise(sd, total, outlying) if sd > 0.0 else None


def _slopes(mean: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Return the derivative of a channel by the slip at each group of repeated runs (groups,), from the two groups next
    to it in slip.

    `mean` (groups,) is the mean value of the channel and `middle` (groups,) the mean slip of each group. The derivative
    is 0 if the neighbouring groups have equal slips.
    """
    order = np.argsort(middle, kind="stable")
    # The first and last group have one neighbour only, so that their slope is one-sided.
    low, high = np.roll(order, 1), np.roll(order, -1)
    low[0], high[-1] = order[0], order[-1]
    run = middle[high] - middle[low]
    slopes = np.zeros(mean.size)
    slopes[order] = np.where(run > SAME_LEVEL, (mean[high] - mean[low]) / np.where(run > SAME_LEVEL, run, 1.0), 0.0)
    return slopes
