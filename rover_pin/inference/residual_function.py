"""Functions that act besides what was fitted: their evidence, the numbers of a function integrated out.

Rows have besides T v, v ~ N(0, a^2 I): with S = T'W T / s^2 - C'H^-1 C and e = T'W r / s^2 - C'H^-1 g, C = A'W T / s^2,
    ln Z(with T) - ln Z = e'(S + I / a^2)^-1 e / 2 - ln|I + a^2 S| / 2.
Amplitudes a are weighed by their prior, functions alike: at most one of them acts.
Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), section 2.7.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from rover_pin.estimation.columns import Columns
from rover_pin.estimation.fit import Fit
from rover_pin.inference.error_model import PRIORS
from rover_pin.inference.expansion import Expansion, Laplace

NODES = np.array([-math.sqrt(3.0), 0.0, math.sqrt(3.0)])
NODE_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
"""Three-point Gauss-Hermite rule for the logarithm of the amplitude."""
KNOTS, LEAST_SHARE = 100, 1e-3
"""Points that carry a smooth function, and least eigenvalue of its covariance over the greatest that is kept."""


class FunctionEvidence(NamedTuple):
    """What the data say with a function besides: ln Z over that without, and numbers with the likeliest one."""

    gain: float
    mean: np.ndarray
    covariance: np.ndarray
    rows: np.ndarray
    "the likeliest function (n,) less what the numbers take of it, in SDs of the noise: what a model without it leaves"


class _Projected(NamedTuple):
    """A function without what the numbers of a fit take of it: S = V diag(values) V', V'e, and H^-1 C V."""

    columns: Columns
    vectors: np.ndarray
    values: np.ndarray
    along: np.ndarray
    back: np.ndarray

    def gains(self, amplitudes: np.ndarray) -> np.ndarray:
        """Return ln Z with the function over that without (amplitudes,)."""
        shares = amplitudes[:, None] ** 2 / (1.0 + amplitudes[:, None] ** 2 * self.values)
        return np.asarray(
            0.5 * shares @ self.along**2 - 0.5 * np.log1p(amplitudes[:, None] ** 2 * self.values).sum(axis=1)
        )

    def evidence(self, expansion: Expansion, laplace: Laplace, amplitude: float) -> FunctionEvidence:
        """Return what the data say with the function at one amplitude."""
        share = amplitude**2 / (1.0 + amplitude**2 * self.values)
        step = self.back @ (share * self.along)
        function = self.columns.times(self.vectors @ (share * self.along))
        return FunctionEvidence(
            float(self.gains(np.array([amplitude]))[0]),
            laplace.mean + step,
            laplace.covariance + self.back * share @ self.back.T,
            (function - expansion.columns[:, : len(step)] @ step) / laplace.scale,
        )


def with_functions(fits: Sequence[tuple[Expansion, Laplace]], functions: Iterable[Columns]) -> list[FunctionEvidence]:
    """Return what the data say of each fit's own numbers with one of these functions besides."""
    amplitudes = PRIORS["a"].median * np.exp(PRIORS["a"].sd * NODES)
    gains: list[list[float]] = [[] for _ in fits]
    likeliest: dict[int, tuple[float, _Projected, float]] = {}
    for columns in functions:
        for at, (expansion, laplace) in enumerate(fits):
            function = _projected(expansion, laplace, columns)
            by_amplitude = function.gains(amplitudes)
            gains[at].append(float(logsumexp(by_amplitude, b=NODE_WEIGHTS)))
            if at not in likeliest or by_amplitude.max() > likeliest[at][0]:
                likeliest[at] = float(by_amplitude.max()), function, float(amplitudes[by_amplitude.argmax()])
    if not likeliest:
        return [
            FunctionEvidence(-math.inf, *laplace[2:], np.zeros(len(expansion.fit.rows))) for expansion, laplace in fits
        ]
    return [
        function.evidence(*fits[at], amplitude)._replace(gain=float(logsumexp(gains[at])) - math.log(len(gains[at])))
        for at, (_, function, amplitude) in likeliest.items()
    ]


def _projected(expansion: Expansion, laplace: Laplace, columns: Columns) -> _Projected:
    count, weights = len(laplace.mean), expansion.weights / laplace.scale**2
    cross = columns.across(weights[:, None] * expansion.columns[:, :count])
    gradient = expansion.whole.slope[0][:count] / laplace.scale**2 + expansion.u[:count]
    back = laplace.covariance @ cross
    values, vectors = np.linalg.eigh(columns.normal(weights) - cross.T @ back)
    e = columns.across(weights * expansion.settled) - back.T @ gradient
    return _Projected(columns, vectors, np.maximum(values, 0.0), vectors.T @ e, back @ vectors)


def smooth_functions(fit: Fit) -> Iterator[Columns]:
    """Yield smooth functions of what was set: of each channel alone, and of all channels.

    Each is of N(0, Y^2 exp(-|x - x'|^2 / 2 l^2)), Y the channel's spread, l the median of its prior, carried by at most
    KNOTS points (Nystroem's approximation).
    """
    experiment, noise = fit.task.experiment, fit.task.noise
    observed = np.where(noise.good, experiment.observed, np.nan)
    features = _features(experiment.varied, np.asarray(noise.good.any(axis=1)))
    parts = []
    for row in range(observed.shape[1]):
        spread = float(np.nanstd(observed[:, row])) or float(noise.floor[row])
        table = np.zeros((features.shape[-1], *observed.shape))
        table[:, :, row] = spread * np.moveaxis(features, -1, 0)
        parts.append(noise.white(table).T)
    everything = (slice(None),)
    yield from (Columns(part, everything) for part in parts)
    if len(parts) > 1:
        yield Columns(np.concatenate(parts, axis=1), everything)


def _features(inputs: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Return functions (folds, samples, k) whose sum of products is the kernel of inputs (folds, samples, inputs)."""
    x = np.nan_to_num(inputs)
    low, high = x[used].min(axis=0), x[used].max(axis=0)
    x = (x - low) / np.where(high > low, high - low, 1.0)
    among = np.flatnonzero(used.ravel())
    knots = x.reshape(-1, x.shape[-1])[among[np.linspace(0, len(among) - 1, min(KNOTS, len(among))).astype(int)]]
    values, vectors = np.linalg.eigh(_kernel(knots, knots))
    sound = values > LEAST_SHARE * values[-1]
    features = _kernel(x.reshape(-1, x.shape[-1]), knots) @ (vectors[:, sound] / np.sqrt(values[sound]))
    return np.asarray(features).reshape(*x.shape[:2], -1)


def _kernel(x: np.ndarray, knots: np.ndarray) -> np.ndarray:
    distance = ((x[:, None] - knots[None]) ** 2).sum(axis=-1)
    return np.asarray(np.exp(-0.5 * distance / PRIORS["l"].median ** 2))


def in_shares(columns: Columns, weights: np.ndarray, signal: float) -> Columns:
    """Return the same function by numbers of SD 1 that together move rows by as much as was measured, `signal` an RMS.

    A row's share is even over all directions in which the function can move the rows at all.
    """
    parts = []
    for run in columns.runs:
        part = columns.values[run]
        values, vectors = np.linalg.eigh(part.T @ (weights[run, None] * part))
        sound = values > LEAST_SHARE * max(float(values[-1]), 1e-12)
        size = signal * math.sqrt(len(part) / max(int(sound.sum()), 1))
        parts.append(part @ np.where(sound, vectors * size / np.sqrt(np.where(sound, values, 1.0)), 0.0))
    return Columns(np.concatenate(parts), columns.runs)


def rows_signal(fit: Fit) -> float:
    """Return the RMS of the whitened rows of what was measured about each channel's mean."""
    noise, observed = fit.task.noise, fit.task.experiment.observed
    centred = observed - np.nanmean(observed, axis=(0, 2), keepdims=True)
    return float(np.sqrt(np.mean(noise.white(np.nan_to_num(centred)) ** 2)))
