"""Curves through measured points that know no physics (a mean, a quadratic, a Gaussian process). A physical model must
predict better than such curves.
"""

import math
import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize


def mean(inputs: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the mean of the measured `values` (n,) as the prediction for each of the m points `at` (m, inputs).

    This is the simplest curve that a physical model has to beat. `inputs` (n, inputs) are not used; all curves are
    called with these arguments.

    Examples
    --------
    >>> inputs, values = np.array([[0.0], [1.0], [2.0]]), np.array([0.0, 1.0, 4.0])
    >>> mean(inputs, values, at=np.array([[3.0], [4.0]])).round(2).tolist()
    [1.67, 1.67]
    """
    return np.full(len(at), values.mean())


def quadratic(inputs: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Fit a polynomial of second degree by least squares to the measured `values` (n,), and return its value at m new
    points.

    `inputs` (n, inputs) are the coordinates (such as slip and load) of the measured points, and `at` (m, inputs) the
    coordinates of the new points.

    Examples
    --------
    >>> inputs, values = np.array([[0.0], [1.0], [2.0]]), np.array([0.0, 1.0, 4.0])
    >>> quadratic(inputs, values, at=np.array([[3.0], [4.0]])).round(2).tolist()
    [9.0, 16.0]
    """

    def terms(x: np.ndarray) -> np.ndarray:
        products = [x[:, i] * x[:, j] for i in range(x.shape[1]) for j in range(i, x.shape[1])]
        return np.column_stack([np.ones(len(x)), *x.T, *products])

    return terms(at) @ np.linalg.lstsq(terms(inputs), values, rcond=None)[0]


def gaussian_process(inputs: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Fit a Gaussian process to the measured `values` (n,), and return its mean at m new points.

    `inputs` (n, inputs) are the coordinates (such as slip and load) of the measured points, and `at` (m, inputs) the
    coordinates of the new points. The kernel is squared-exponential. Its length scales, its height and the noise
    maximise the marginal likelihood. Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006),
    chapter 5.
    """
    # The process is fitted to standardised values, because its prior mean is 0 and its bounds are for values of order
    # 1.
    middle, scale = values.mean(), values.std()
    y = (values - middle) / scale
    best = _likeliest(inputs, y)
    K = _kernel(inputs, inputs, best) + np.exp(2 * best[1]) * np.eye(len(y))
    return middle + scale * _kernel(at, inputs, best) @ np.linalg.solve(K, y)


def missed_by_process(inputs: np.ndarray, values: np.ndarray, fold: np.ndarray) -> np.ndarray:
    """Return the held-out residuals (n,) of a Gaussian process: each fold is predicted by a process through all other
    folds.

    `inputs` (n, inputs) are the coordinates of the points, `values` (n,) the measured values, and `fold` (n,) the index
    of the fold of each point. A fold is a group of points that are held out together. No process has to be fitted again
    for a fold: with the covariance matrix K of all points, and the values y minus the mean of the other folds, the
    residuals of fold f are r_f = (K^-1)_ff^-1 (K^-1 y)_f. The length scales are estimated once, from all points.
    Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), section 5.4.2.
    """
    scale = values.std()
    best = _likeliest(inputs, (values - values.mean()) / scale)
    # One inverse of the covariance of all points serves every fold, so that no process is fitted for each fold.
    inverse = np.linalg.inv(_kernel(inputs, inputs, best) + np.exp(2 * best[1]) * np.eye(len(values)))
    missed = np.empty(len(values))
    for at in np.unique(fold):
        out = fold == at
        # The mean of the other folds is subtracted, because the held-out fold must not enter its own prediction.
        y = values - values[~out].mean()
        missed[out] = np.linalg.solve(inverse[np.ix_(out, out)], inverse[out] @ y)
    return missed


def _kernel(x: np.ndarray, z: np.ndarray, log: np.ndarray) -> np.ndarray:
    """Return the squared-exponential kernel (n, m) between the points x (n, inputs) and z (m, inputs).

    `log` (2 + inputs,) holds the logarithms of the kernel's height, of the SD of the noise (not used here), and of the
    length scale of each input.
    """
    distance = ((x[:, None] - z[None]) / np.exp(log[2:])) ** 2
    return np.asarray(np.exp(2 * log[0] - distance.sum(axis=2) / 2))


def _likeliest(inputs: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the parameters of a Gaussian process that maximise the marginal likelihood of the values y (n,) at
    `inputs` (n, inputs).

    The parameters are the logarithms of the kernel's height, of the SD of the noise, and of the length scale of each
    input.
    """

    def cost(log: np.ndarray) -> float:
        K = _kernel(inputs, inputs, log) + np.exp(2 * log[1]) * np.eye(len(y))
        return float(y @ np.linalg.solve(K, y) + np.linalg.slogdet(K)[1])

    # The values are standardised and each input is divided by its range, so that these bounds fit any data.
    bounds = [(-2.0, 3.0), (-4.0, 1.0), *[(-2.5, 2.0)] * inputs.shape[1]]
    starts = [np.array([0.0, -2.0, *[length] * inputs.shape[1]]) for length in (-1.0, 0.0)]
    solutions = (minimize(cost, start, bounds=bounds) for start in starts)
    return np.asarray(min(solutions, key=lambda solution: solution.fun).x)


Predict = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
CURVES: dict[str, Predict] = {"mean": mean, "quadratic": quadratic, "Gaussian process": gaussian_process}
"""Name -> curve without physics. Each curve is a function of three arrays: the inputs and the measured values of the
points through which the curve is fitted, and the inputs of the held-out points. The function returns the predicted
values of the held-out points."""


class Baseline(NamedTuple):
    """The held-out error of one curve without physics in one channel: its RMSE in the unit of the channel. A physical
    model should have a smaller error.
    """

    channel: str
    unit: str
    curve: str
    error: float
    given: str = "what was set"
    """inputs of the curve in words, such as "what was set" (the set inputs of the test)"""
    by_fold: tuple[float, ...] = ()
    """RMSE of each fold (group of samples left out together), in the channel's unit; NaN for a fold without measured
    values"""


def curves(observed: np.ndarray, inputs: np.ndarray, channels: Sequence[tuple[str, str]]) -> tuple[Baseline, ...]:
    """Return the held-out error of each curve without physics (mean, quadratic, Gaussian process) in each channel.

    Each fold (group of samples left out together) is predicted by a curve that was fitted to all other folds. Measured
    values that are NaN are omitted.

    Parameters
    ----------
    observed : array (folds, channels, samples)
        Measured values.
    inputs : array (folds, samples, inputs)
        Inputs of the curves, such as set slip and load, at each sample.
    channels : sequence of (name, unit)
        Name and unit of each channel.
    """
    baselines = []
    for at, (name, unit) in enumerate(channels):
        values = observed[:, at]
        good = np.isfinite(values)
        # Each input is divided by its range, so that one kernel length and one set of bounds fit inputs in any unit.
        scale = np.maximum(np.ptp(inputs[good], axis=0), 1e-12)
        for curve, predict in CURVES.items():
            errors = []
            for fold in range(len(observed)):
                training_mask = good.copy()
                training_mask[fold] = False
                training = inputs[training_mask] / scale, values[training_mask]
                predicted_at = inputs[fold][good[fold]] / scale
                try:
                    # NumPy warns of overflow in kernels with extreme length scales; such a curve is merely bad, not an
                    # error.
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore", RuntimeWarning)
                        prediction = predict(*training, predicted_at)
                except np.linalg.LinAlgError:
                    # A singular curve (for example a quadratic through too few points) is replaced by the mean of the
                    # other folds, the simplest curve.
                    prediction = mean(*training, predicted_at)
                errors.append(np.asarray(values[fold][good[fold]] - prediction))
            by_fold = tuple(float(np.sqrt(np.mean(row**2))) if row.size else math.nan for row in errors)
            # The RMSE of the channel weights each sample equally, not each fold.
            whole = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
            baselines.append(Baseline(name, unit, curve, whole, by_fold=by_fold))
    return tuple(baselines)
