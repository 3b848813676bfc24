"""Curves through measured points: what a user would otherwise take, to be printed beside a physical model."""

import math
import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize


def mean(inputs: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the mean."""
    return np.full(len(at), values.mean())


def quadratic(inputs: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the least-squares quadratic in all inputs."""

    def terms(x: np.ndarray) -> np.ndarray:
        products = [x[:, i] * x[:, j] for i in range(x.shape[1]) for j in range(i, x.shape[1])]
        return np.column_stack([np.ones(len(x)), *x.T, *products])

    return terms(at) @ np.linalg.lstsq(terms(inputs), values, rcond=None)[0]


def gaussian_process(inputs: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return a Gaussian process with a squared-exponential kernel, lengths, height and noise by marginal likelihood."""
    middle, scale = values.mean(), values.std()
    y = (values - middle) / scale
    best = _likeliest(inputs, y)
    K = _kernel(inputs, inputs, best) + np.exp(2 * best[1]) * np.eye(len(y))
    return middle + scale * _kernel(at, inputs, best) @ np.linalg.solve(K, y)


def missed_by_process(inputs: np.ndarray, values: np.ndarray, fold: np.ndarray) -> np.ndarray:
    """Return by how much a Gaussian process of all others misses each fold; its lengths are those of all points.

    r_f = (K^-1)_ff^-1 (K^-1 y)_f, y less the mean of the others. Source: Rasmussen and Williams, Gaussian Processes for
    Machine Learning (2006), 5.4.2.
    """
    scale = values.std()
    best = _likeliest(inputs, (values - values.mean()) / scale)
    inverse = np.linalg.inv(_kernel(inputs, inputs, best) + np.exp(2 * best[1]) * np.eye(len(values)))
    missed = np.empty(len(values))
    for at in np.unique(fold):
        out = fold == at
        y = values - values[~out].mean()
        missed[out] = np.linalg.solve(inverse[np.ix_(out, out)], inverse[out] @ y)
    return missed


def _kernel(x: np.ndarray, z: np.ndarray, log: np.ndarray) -> np.ndarray:
    distance = ((x[:, None] - z[None]) / np.exp(log[2:])) ** 2
    return np.asarray(np.exp(2 * log[0] - distance.sum(axis=2) / 2))


def _likeliest(inputs: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return logarithms of height, noise and lengths of the greatest marginal likelihood."""

    def cost(log: np.ndarray) -> float:
        K = _kernel(inputs, inputs, log) + np.exp(2 * log[1]) * np.eye(len(y))
        return float(y @ np.linalg.solve(K, y) + np.linalg.slogdet(K)[1])

    bounds = [(-2.0, 3.0), (-4.0, 1.0), *[(-2.5, 2.0)] * inputs.shape[1]]
    starts = [np.array([0.0, -2.0, *[length] * inputs.shape[1]]) for length in (-1.0, 0.0)]
    solutions = (minimize(cost, start, bounds=bounds) for start in starts)
    return np.asarray(min(solutions, key=lambda solution: solution.fun).x)


Predict = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
CURVES: dict[str, Predict] = {"mean": mean, "quadratic": quadratic, "Gaussian process": gaussian_process}
"""By name: inputs and values of the other folds, and where to predict."""


class Baseline(NamedTuple):
    """The held-out RMSE of one channel, predicted by a curve instead of the model, in the channel's unit."""

    channel: str
    unit: str
    curve: str
    error: float
    given: str = "what was set"
    "what it is a function of"
    by_fold: tuple[float, ...] = ()
    "RMSE of each fold; NaN where nothing was measured"


def curves(observed: np.ndarray, inputs: np.ndarray, channels: Sequence[tuple[str, str]]) -> tuple[Baseline, ...]:
    """Return the held-out errors of all curves through what was observed (folds, channels, samples), NaN left out.

    `inputs` (folds, samples, inputs) are what was set at each sample, `channels` name and unit of each channel.
    """
    baselines = []
    for at, (name, unit) in enumerate(channels):
        good = np.isfinite(observed[:, at])
        for curve, predict in CURVES.items():
            errors = [_fold_error(observed[:, at], inputs, good, fold, predict) for fold in range(len(observed))]
            by_fold = tuple(float(np.sqrt(np.mean(row**2))) if row.size else math.nan for row in errors)
            whole = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
            baselines.append(Baseline(name, unit, curve, whole, by_fold=by_fold))
    return tuple(baselines)


def _fold_error(values: np.ndarray, inputs: np.ndarray, good: np.ndarray, fold: int, predict: Predict) -> np.ndarray:
    """Return by how much a curve through the other folds misses one fold; their mean where there is no curve."""
    training_mask = good.copy()
    training_mask[fold] = False
    fold_mask = good[fold]
    scale = np.maximum(np.ptp(inputs[good], axis=0), 1e-12)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            prediction = predict(inputs[training_mask] / scale, values[training_mask], inputs[fold][fold_mask] / scale)
    except np.linalg.LinAlgError:
        prediction = mean(inputs[training_mask], values[training_mask], inputs[fold][fold_mask])
    return np.asarray(values[fold][fold_mask] - prediction)
