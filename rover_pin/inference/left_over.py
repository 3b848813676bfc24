"""What a fit leaves besides noise as a function of something: its evidence, the function's numbers integrated out.

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


class LeftOver(NamedTuple):
    """What the data say with a function left besides: ln Z over that without, and numbers with the likeliest one."""

    gain: float
    mean: np.ndarray
    covariance: np.ndarray
    rows: np.ndarray
    "the likeliest function (n,), in SDs of the noise"


def left_overs(fits: Sequence[tuple[Expansion, Laplace]], functions: Iterable[Columns]) -> list[LeftOver]:
    """Return what the data say of each fit's own numbers where one of these functions is left besides."""
    amplitudes = PRIORS["a"].median * np.exp(PRIORS["a"].sd * NODES)
    gains: list[list[float]] = [[] for _ in fits]
    best = [
        LeftOver(-math.inf, laplace.mean, laplace.covariance, np.zeros(len(expansion.rows)))
        for expansion, laplace in fits
    ]
    for columns in functions:
        for at, (expansion, laplace) in enumerate(fits):
            rows = _with(expansion, laplace, columns, amplitudes)
            gains[at].append(float(logsumexp([row.gain for row in rows], b=NODE_WEIGHTS)))
            best[at] = max([best[at], *rows], key=lambda row: row.gain)
    return [
        row._replace(gain=float(logsumexp(of_fit)) - math.log(len(of_fit))) if of_fit else row
        for row, of_fit in zip(best, gains, strict=True)
    ]


def _with(expansion: Expansion, laplace: Laplace, columns: Columns, amplitudes: np.ndarray) -> list[LeftOver]:
    own, weights = len(laplace.mean), expansion.weights / laplace.scale**2
    cross = columns.across(weights[:, None] * expansion.columns[:, :own])
    gradient = expansion.whole.slope[0][:own] / laplace.scale**2 + expansion.u[:own]
    back = laplace.covariance @ cross
    values, vectors = np.linalg.eigh(columns.normal(weights) - cross.T @ back)
    values = np.maximum(values, 0.0)
    along = vectors.T @ (columns.across(weights * expansion.settled) - back.T @ gradient)
    spread = amplitudes[:, None] ** 2 / (1.0 + amplitudes[:, None] ** 2 * values)
    gains = 0.5 * spread @ along**2 - 0.5 * np.log1p(amplitudes[:, None] ** 2 * values).sum(axis=1)
    moved = back @ vectors
    return [
        LeftOver(
            float(gain),
            laplace.mean + moved @ (share * along),
            laplace.covariance + moved * share @ moved.T,
            columns.times(vectors @ (share * along)) / laplace.scale,
        )
        for gain, share in zip(gains, spread, strict=True)
    ]


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
    kept = values > LEAST_SHARE * values[-1]
    return np.asarray(_kernel(x.reshape(-1, x.shape[-1]), knots) @ (vectors[:, kept] / np.sqrt(values[kept]))).reshape(
        *x.shape[:2], -1
    )


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
        kept = values > LEAST_SHARE * max(float(values[-1]), 1e-12)
        size = signal * math.sqrt(len(part) / max(int(kept.sum()), 1))
        parts.append(part @ np.where(kept, vectors * size / np.sqrt(np.where(kept, values, 1.0)), 0.0))
    return Columns(np.concatenate(parts), columns.runs)


def rows_signal(fit: Fit) -> float:
    """Return the RMS of the whitened rows of what was measured about each channel's mean."""
    noise, observed = fit.task.noise, fit.task.experiment.observed
    centred = observed - np.nanmean(observed, axis=(0, 2), keepdims=True)
    return float(np.sqrt(np.mean(noise.white(np.nan_to_num(centred)) ** 2)))
