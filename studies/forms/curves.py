"""Curves through measured points, each slip level predicted from the others: what a user would otherwise take."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rover_pin.estimation.baselines import gaussian_process, mean, quadratic
from rover_pin.measurements.rig_set import RigSet

Predict = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def left_out(data: RigSet, predict: Predict) -> np.ndarray:
    """Return the errors [channels, runs] of a baseline, each level predicted from the others."""
    inputs = np.column_stack([data.slip, np.asarray(data.slip_angle)])
    inputs = inputs[:, np.ptp(inputs, axis=0) > 0]
    error = np.zeros((len(data.channels), len(inputs)))
    for number, channel in enumerate(data.channels):
        for level in range(len(data.level_names)):
            out = data.level == level
            error[number, out] = predict(inputs[~out], channel.measured[~out], inputs[out]) - channel.measured[out]
    return error


def carried_over(data: RigSet, other: RigSet, predict: Predict) -> np.ndarray:
    """Return the errors [channels, runs] on another wheel of a baseline that is fitted to all points of this one."""
    seen, asked = (np.asarray(each.slip)[:, None] for each in (data, other))
    pairs = zip(data.channels, other.channels, strict=True)
    return np.array([predict(seen, one.measured, asked) - two.measured for one, two in pairs])


BASELINES = {"mean": mean, "quadratic": quadratic, "Gaussian process": gaussian_process}
