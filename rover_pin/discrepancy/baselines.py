"""What a user would otherwise take: curves through the points, each fold predicted from the others like the model."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.estimation.baselines import gaussian_process, mean, quadratic
from rover_pin.estimation.wording import shown

Predict = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
CURVES: dict[str, Predict] = {"mean": mean, "quadratic": quadratic, "Gaussian process": gaussian_process}
"""By name: inputs and values of the other folds, and where to predict."""
LOSES = 0.95
"""Share of the model's held-out error below which a baseline's is called better."""


class Baseline(NamedTuple):
    """The held-out RMSE of one channel, predicted by a curve instead of the model, in the channel's unit."""

    channel: str
    unit: str
    curve: str
    error: float


def curves(observed: np.ndarray, inputs: np.ndarray, channels: Sequence[tuple[str, str]]) -> tuple[Baseline, ...]:
    """Return the held-out errors of all curves.

    Parameters
    ----------
    observed : array [folds, channels, samples]
        What was measured; NaN is left out.
    inputs : array [folds, samples, inputs]
        What was set at each sample.
    channels : sequence of (str, str)
        Name and unit of each channel.
    """
    found = []
    for at, (name, unit) in enumerate(channels):
        good = np.isfinite(observed[:, at])
        for curve, predict in CURVES.items():
            errors = [_missed(observed[:, at], inputs, good, fold, predict) for fold in range(len(observed))]
            found.append(Baseline(name, unit, curve, float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))))
    return tuple(found)


def _missed(values: np.ndarray, inputs: np.ndarray, good: np.ndarray, fold: int, predict: Predict) -> np.ndarray:
    """Return by how much a curve through the other folds misses one fold; their mean where there is no curve."""
    rest = good.copy()
    rest[fold] = False
    own = good[fold]
    scale = np.maximum(np.ptp(inputs[good], axis=0), 1e-12)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            found = predict(inputs[rest] / scale, values[rest], inputs[fold][own] / scale)
    except np.linalg.LinAlgError:
        found = mean(inputs[rest], values[rest], inputs[fold][own])
    return np.asarray(values[fold][own] - found)


def losses(scores: Sequence[ChannelScore], baselines: Sequence[Baseline]) -> tuple[str, ...]:
    """Return where a curve predicts what was not fitted better than the model does, one sentence a channel."""
    said = []
    for score in scores:
        own = [one for one in baselines if one.channel == score.name]
        best = min(own, key=lambda one: one.error, default=None)
        if best is not None and best.error < LOSES * score.after:
            errors = f"{shown(best.error, score.unit)} against {shown(score.after, score.unit)}"
            said.append(f"held out, {score.name} is predicted better by a {best.curve} of what was set ({errors})")
    return tuple(said)
