"""Curves through measured points, with each slip level predicted from the others, as the usual alternative to a law."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rover_pin.estimation.baselines import gaussian_process, mean, quadratic
from rover_pin.measurements.rig_set import RigSet

Predict = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def left_out(data: RigSet, predict: Predict) -> np.ndarray:
    """Return the errors [channels, runs] of a baseline, with each level predicted from the other levels."""
    inputs = np.column_stack([data.slip, np.asarray(data.slip_angle)])
    # A constant input cannot carry a curve.
    inputs = inputs[:, np.ptp(inputs, axis=0) > 0]
    error = np.zeros((len(data.channels), len(inputs)))
    for number, channel in enumerate(data.channels):
        for level in range(len(data.level_names)):
            out = data.level == level
            error[number, out] = predict(inputs[~out], channel.measured[~out], inputs[out]) - channel.measured[out]
    return error


def carried_over(data: RigSet, second: RigSet, predict: Predict) -> np.ndarray:
    """Return the errors [channels, runs] of a baseline that is fitted to all points of one wheel (`data`) and predicts
    another wheel (`second`).
    """
    measured_at, wanted_at = (np.asarray(rig.slip)[:, None] for rig in (data, second))
    pairs = zip(data.channels, second.channels, strict=True)
    return np.array([predict(measured_at, channel.measured, wanted_at) - two.measured for channel, two in pairs])


BASELINES = {"mean": mean, "quadratic": quadratic, "Gaussian process": gaussian_process}
