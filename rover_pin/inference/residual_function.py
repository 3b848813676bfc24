"""Functions that act besides what was fitted: their evidence, the numbers of a function integrated out.

Rows have besides T v, v ~ N(0, a^2 I): with S = T'W T / s^2 - C'H^-1 C and e = T'W r / s^2 - C'H^-1 g, C = A'W T / s^2,
    ln Z(with T) - ln Z = e'(S + I / a^2)^-1 e / 2 - ln|I + a^2 S| / 2.
Amplitudes a are weighed by their prior, functions alike: at most one of them acts. W are the weights of rows as the fit
leaves them; with the likeliest function they are taken anew (`_robust_evidence`), for what it explains is no stray.
Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), section 2.7.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from rover_pin.estimation.columns import IDENTIFIABLE_SHARE, Columns, no_columns
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import huber, huber_weights
from rover_pin.inference.error_model import PRIORS
from rover_pin.inference.expansion import Expansion, Laplace

NODES = np.array([-math.sqrt(3.0), 0.0, math.sqrt(3.0)])
NODE_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
"""Three-point Gauss-Hermite rule for the logarithm of the amplitude."""
TURNS = 6
"""Turns of weights and function: rows that it explains count in full after two or three."""
KNOTS = 100
"""Points that carry a smooth function."""


class FunctionEvidence(NamedTuple):
    """What the data say with a function besides: ln Z over that without, and numbers with the likeliest one."""

    gain: float
    mean: np.ndarray
    covariance: np.ndarray
    rows: np.ndarray
    "the likeliest function (n,) less what the numbers take of it, in SDs of the noise: what a model without it leaves"
    missed: np.ndarray
    "what is left with it (n,)"
    scale: float
    "of the noise with it"


class _Projected(NamedTuple):
    """A function without what the numbers of a fit take of it: S = V diag(values) V', and V'e."""

    values: np.ndarray
    along: np.ndarray

    def gains(self, amplitudes: np.ndarray) -> np.ndarray:
        """Return ln Z with the function over that without (amplitudes,)."""
        shares = amplitudes[:, None] ** 2 / (1.0 + amplitudes[:, None] ** 2 * self.values)
        return np.asarray(
            0.5 * shares @ self.along**2 - 0.5 * np.log1p(amplitudes[:, None] ** 2 * self.values).sum(axis=1)
        )


def _robust_evidence(expansion: Expansion, laplace: Laplace, columns: Columns, amplitude: float) -> FunctionEvidence:
    """Return what the data say with a function of one amplitude, rows and noise weighed by what is left with it.

    minimise huber(r_0 + A d - T v) / s^2 + |u_0 + d|^2 + |v|^2 / a^2 by turns of weights, s and (d, v);
    ln Z = -(that) / 2 - ln|H| / 2 - m ln a - n ln s + ln p(s), H with the last weights; less the same without T.
    """
    both = (no_columns(len(expansion.settled)), columns)
    without, best = (_mode(expansion, laplace, function, amplitude) for function in both)
    slopes = expansion.columns[:, : len(best.u)]
    rows = (columns.times(best.size) - slopes @ (best.u - laplace.mean)) / best.scale
    gain = best.log_evidence - without.log_evidence
    return FunctionEvidence(gain, best.u, best.covariance, rows, best.missed, best.scale)


class _Mode(NamedTuple):
    log_evidence: float
    u: np.ndarray
    covariance: np.ndarray
    size: np.ndarray
    missed: np.ndarray
    scale: float


def _mode(expansion: Expansion, laplace: Laplace, columns: Columns, amplitude: float) -> _Mode:
    count, many, settled = len(laplace.mean), columns.width, expansion.settled
    slopes, start, scale = expansion.columns[:, :count], expansion.u[:count], laplace.scale
    missed, curvature = settled, np.eye(count + many)
    for _ in range(TURNS):
        weights = huber_weights(missed) / scale**2
        weighted = weights[:, None] * slopes
        across = columns.across(weighted)
        curvature = np.block([[slopes.T @ weighted, -across], [-across.T, columns.normal(weights)]])
        curvature += np.diag(np.concatenate([np.ones(count), np.full(many, amplitude**-2.0)]))
        right = np.concatenate([-weighted.T @ settled - start, columns.across(weights * settled)])
        solved = np.linalg.solve(curvature, right)
        missed = settled + slopes @ solved[:count] - columns.times(solved[count:])
        by_scale = expansion.of_scales(huber(missed), len(missed))
        scale = float(expansion.scales[int(np.argmax(by_scale))])
    u, size = start + solved[:count], solved[count:]
    penalty = float(u @ u) + float(size @ size) / amplitude**2 + float(np.linalg.slogdet(curvature)[1])
    covariance = np.linalg.inv(curvature)[:count, :count]
    return _Mode(float(by_scale.max()) - 0.5 * penalty - many * math.log(amplitude), u, covariance, size, missed, scale)


def with_functions(fits: Sequence[tuple[Expansion, Laplace]], functions: Iterable[Columns]) -> list[FunctionEvidence]:
    """Return what the data say of each fit's own numbers with one of these functions; [] without any."""
    amplitudes = PRIORS["a"].median * np.exp(PRIORS["a"].sd * NODES)
    gains: list[list[float]] = [[] for _ in fits]
    likeliest: dict[int, tuple[float, Columns, float]] = {}
    for columns in functions:
        for at, (expansion, laplace) in enumerate(fits):
            function = _project_columns(expansion, laplace, columns)
            by_amplitude = function.gains(amplitudes)
            gains[at].append(float(logsumexp(by_amplitude, b=NODE_WEIGHTS)))
            if at not in likeliest or by_amplitude.max() > likeliest[at][0]:
                likeliest[at] = float(by_amplitude.max()), columns, float(amplitudes[by_amplitude.argmax()])
    evidence = []
    for at, (linear, columns, amplitude) in likeliest.items():
        best = _robust_evidence(*fits[at], columns, amplitude)
        total = float(logsumexp(gains[at])) - math.log(len(gains[at]))
        evidence.append(best._replace(gain=total + best.gain - linear))
    return evidence


def _project_columns(expansion: Expansion, laplace: Laplace, columns: Columns) -> _Projected:
    count, weights = len(laplace.mean), expansion.weights / laplace.scale**2
    cross = columns.across(weights[:, None] * expansion.columns[:, :count])
    gradient = expansion.whole.slope[0][:count] / laplace.scale**2 + expansion.u[:count]
    back = laplace.covariance @ cross
    values, vectors = np.linalg.eigh(columns.normal(weights) - cross.T @ back)
    e = columns.across(weights * expansion.settled) - back.T @ gradient
    return _Projected(np.maximum(values, 0.0), vectors.T @ e)


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
    sound = values > IDENTIFIABLE_SHARE * values[-1]
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
        sound = values > IDENTIFIABLE_SHARE * max(float(values[-1]), 1e-12)
        size = signal * math.sqrt(len(part) / max(int(sound.sum()), 1))
        parts.append(part @ np.where(sound, vectors * size / np.sqrt(np.where(sound, values, 1.0)), 0.0))
    return Columns(np.concatenate(parts), columns.runs)


def rows_signal(fit: Fit) -> float:
    """Return the RMS of the whitened rows of what was measured about each channel's mean."""
    noise, observed = fit.task.noise, fit.task.experiment.observed
    centred = observed - np.nanmean(observed, axis=(0, 2), keepdims=True)
    return float(np.sqrt(np.mean(noise.white(np.nan_to_num(centred)) ** 2)))
