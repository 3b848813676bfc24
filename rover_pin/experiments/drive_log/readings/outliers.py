"""Single poses of a tracker that are another's: a row beyond all its neighbours, by far more than the tracker's noise.

A tracker that takes another marker for the rover's for one frame puts the whole pose elsewhere. Such rows are left out
of what is compared, all six numbers of the pose, and the check of the log says which; two or more in a row are a jump,
which the check tells and nothing mends.
"""

import numpy as np

from rover_pin.estimation.noise import SPREAD
from rover_pin.simulation.trace.trace import Trace

JUMPS = {
    "body_x": 0.005, "body_y": 0.005, "body_z": 0.005, "body_roll": 0.02, "body_pitch": 0.02, "body_yaw": 0.02,
}  # fmt: skip
"""Numbers of a pose, and the least distance from its neighbours that makes an outlier [m, rad]."""
BEYOND = 6.0
"""SDs of the tracker's noise that it lies beyond the nearest of its neighbours: by chance one of some million rows.
Why: a wrong exclusion costs a row, a wrong pose the whole path after it."""
SIDE = 2
"""Neighbours on either side."""
NEAR = 0.3
"""Time between the first and the last neighbour [s] within which they tell where a pose should be; beside a gap of the
poses, half of it to those on the other side."""
ABOUT_THE_MIDDLE = SPREAD / np.sqrt(1.5)
"""SD of white noise over the median distance of a value from the middle of its two neighbours."""


def pose_outliers(log: Trace) -> np.ndarray:
    """Return which rows (T,) of a log have a pose that lies off the two before and the two after.

    What one outlier hides of another is found in a second look.
    """
    outliers = np.zeros(len(log.t), dtype=bool)
    for _ in range(2):
        for name in (channel for channel in JUMPS if channel in log):
            rows = np.flatnonzero(np.isfinite(log[name]) & ~outliers)
            outliers[rows[_outlier_places(log.t[rows], log[name][rows], name)]] = True
    return outliers


def without_pose_outliers(log: Trace) -> Trace:
    """Return the log without its outlying poses: all their numbers are empty."""
    return without_poses(log, pose_outliers(log))


def without_poses(log: Trace, outliers: np.ndarray) -> Trace:
    """Return the log with the poses of these rows (T,) left empty, all numbers of them."""
    if not outliers.any():
        return log
    emptied = {name: np.where(outliers, np.nan, log[name]) for name in JUMPS if name in log}
    return Trace({**log.channels, **emptied}, log.units, log.attrs)


def white_noise_sd(values: np.ndarray) -> float:
    """Return the SD of a channel's white noise as its samples scatter about the middle of their neighbours."""
    deviation = values[1:-1] - (values[:-2] + values[2:]) / 2
    magnitudes = np.abs(deviation[np.isfinite(deviation)])
    return ABOUT_THE_MIDDLE * float(np.median(magnitudes)) if magnitudes.size else 0.0


def _outlier_places(t: np.ndarray, values: np.ndarray, name: str) -> np.ndarray:
    """Return the places of values that lie beyond all their neighbours, on one side of them."""
    if len(t) <= 2 * SIDE:
        return np.zeros(0, dtype=int)
    turned = np.unwrap(values) if JUMPS[name] == JUMPS["body_yaw"] else values
    middle = np.arange(SIDE, len(t) - SIDE)
    distance = np.array([turned[middle] - turned[middle + by] for by in range(-SIDE, SIDE + 1) if by])
    one_side = (distance > 0).all(axis=0) | (distance < 0).all(axis=0)
    noise = white_noise_sd(turned)
    is_dense = np.fmin(t[middle + SIDE] - t[middle], t[middle] - t[middle - SIDE]) < NEAR / 2
    return np.asarray(middle[one_side & is_dense & (np.abs(distance).min(axis=0) > max(JUMPS[name], BEYOND * noise))])
