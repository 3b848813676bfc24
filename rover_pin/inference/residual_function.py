"""Evidence that an unlisted function of the inputs (a discrepancy that no cause explains) acts in addition to the
fitted causes.

The residuals then contain T v, with known columns T (n, m) and unknown coefficients v ~ N(0, a^2 I). The coefficients v
and the fit's parameters are integrated out. With C = A'W T / s^2, S = T'W T / s^2 - C'H^-1 C and e = T'W r / s^2 -
C'H^-1 g (`expansion` defines A, W, s, H, g and r):

    ln Z(with T) - ln Z = e'(S + I / a^2)^-1 e / 2 - ln|I + a^2 S| / 2

The evidence is averaged over the prior of the amplitude a and over all functions with equal weights, because at most
one of them acts. For the most likely function, Huber's weights W are computed again, because a residual that the
function explains is no outlier. Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), section
2.7.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from rover_pin.estimation.columns import MIN_IDENTIFIABLE_SHARE, Columns, no_columns
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.residual import huber, huber_weights
from rover_pin.inference.error_model import PRIORS
from rover_pin.inference.expansion import Expansion, Laplace

AMPLITUDE_NODES = np.array([-math.sqrt(3.0), 0.0, math.sqrt(3.0)])
"""Nodes of the three-point Gauss-Hermite rule that averages the evidence over the amplitude of a function: values of
the amplitude's logarithm in prior SDs. Three points integrate polynomials up to degree 5 exactly; more points would
repeat the most expensive step."""
AMPLITUDE_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
"""Weights of the three nodes in AMPLITUDE_NODES; their sum is 1."""
MAX_ALTERNATIONS = 6
"""Number of times that Huber's weights of the residuals and the unlisted function are computed in turn. A residual that
the function explains gets its full weight after two or three of them; six leave a margin."""
MAX_KNOTS = 100
"""Maximum number of samples that represent a smooth function. If there are more samples, the function is interpolated
between evenly chosen ones. The value is assumed: a function with a correlation length of half the range is smooth
between them."""


class FunctionEvidence(NamedTuple):
    """Evidence that an unlisted function of the inputs acts, and the fit together with the most likely function."""

    gain: float
    """log evidence with a function minus log evidence without a function [nats]; the evidence is averaged over all
    functions"""
    mean: np.ndarray
    """posterior mean of u with the most likely function (parameters,)"""
    covariance: np.ndarray
    """posterior covariance of u with the most likely function (parameters, parameters)"""
    rows: np.ndarray
    """values of the most likely function at the samples (n,) in SDs of the noise, minus the part that the parameters
    absorb"""
    missed: np.ndarray
    """whitened residuals (n,) after the function was subtracted"""
    scale: float
    """noise scale (factor on the noise) in the fit with the function"""


def _robust_evidence(expansion: Expansion, laplace: Laplace, columns: Columns, amplitude: float) -> FunctionEvidence:
    """Return the evidence of one unlisted function with the amplitude a, with Huber's weights and noise scale from the
    residuals that the function leaves.

    The loss L = huber(r_0 + A d - T v) / s^2 + |u_0 + d|^2 + |v|^2 / a^2 is minimised. Then ln Z = -L / 2 - ln|H| / 2 -
    m ln a - n ln s + ln p(s), with H from the last weights. The gain is this value minus the value without the
    function, T = 0 (symbols as at the top of the module).
    """
    # Both sides of the difference are computed in the same way, so that errors of the approximation cancel.
    both = (no_columns(len(expansion.settled)), columns)
    without, best = (_mode(expansion, laplace, function, amplitude) for function in both)
    slopes = expansion.columns[:, : len(best.u)]
    rows = (columns.times(best.size) - slopes @ (best.u - laplace.mean)) / best.scale
    gain = best.log_evidence - without.log_evidence
    return FunctionEvidence(gain, best.u, best.covariance, rows, best.missed, best.scale)


class _Mode(NamedTuple):
    """Minimum of the robust loss of a fit with an unlisted function.

    Fields: log evidence, parameters u and their covariance, coefficients v of the function (`size`), whitened residuals
    (`missed`), and noise scale.
    """

    log_evidence: float
    u: np.ndarray
    covariance: np.ndarray
    size: np.ndarray
    missed: np.ndarray
    scale: float


def _mode(expansion: Expansion, laplace: Laplace, columns: Columns, amplitude: float) -> _Mode:
    """Return the minimum of the robust loss L (see `_robust_evidence`) of a fit with one unlisted function, by
    iteratively reweighted least squares.
    """
    count, many, settled = len(laplace.mean), columns.width, expansion.settled
    slopes, start, scale = expansion.columns[:, :count], expansion.u[:count], laplace.scale
    missed, curvature = settled, np.eye(count + many)
    # Alternate between Huber's weights and noise scale (for fixed residuals) and parameters and function (for fixed
    # weights).
    for _ in range(MAX_ALTERNATIONS):
        weights = huber_weights(missed) / scale**2
        weighted = weights[:, None] * slopes
        across = columns.across(weighted)
        curvature = np.block([[slopes.T @ weighted, -across], [-across.T, columns.normal(weights)]])
        curvature += np.diag(np.concatenate([np.ones(count), np.full(many, amplitude**-2.0)]))
        right = np.concatenate([-weighted.T @ settled - start, columns.across(weights * settled)])
        solved = np.linalg.solve(curvature, right)
        missed = settled + slopes @ solved[:count] - columns.times(solved[count:])
        # The noise scale follows the residuals that the function leaves.
        by_scale = expansion.of_scales(huber(missed), len(missed))
        scale = float(expansion.scales[int(np.argmax(by_scale))])
    u, size = start + solved[:count], solved[count:]
    penalty = float(u @ u) + float(size @ size) / amplitude**2 + float(np.linalg.slogdet(curvature)[1])
    covariance = np.linalg.inv(curvature)[:count, :count]
    return _Mode(float(by_scale.max()) - 0.5 * penalty - many * math.log(amplitude), u, covariance, size, missed, scale)


def with_functions(fits: Sequence[tuple[Expansion, Laplace]], functions: Iterable[Columns]) -> list[FunctionEvidence]:
    """Return, for each fit, the evidence that one of several unlisted functions acts in addition to the fitted causes.

    The result is an empty list if there is no function.

    Parameters
    ----------
    fits : sequence of (Expansion, Laplace)
        Fits, each with its expansion and its posterior.
    functions : iterable of Columns
        Each function as whitened columns. The functions can be generated one by one, because only the most likely one
        is kept.
    """
    amplitudes = PRIORS["a"].median * np.exp(PRIORS["a"].sd * AMPLITUDE_NODES)
    variances = amplitudes**2
    gains: list[list[float]] = [[] for _ in fits]
    likeliest: dict[int, tuple[float, Columns, float]] = {}
    # Evidence of every function in the linear model with the weights of the fit; the most likely one is kept.
    for columns in functions:
        for at, (expansion, laplace) in enumerate(fits):
            # The parameters of the fit absorb a part of the function. This part is projected out of the curvature S of
            # the function's coefficients and out of the gradient e, as at the top of the module.
            count, weights = len(laplace.mean), expansion.weights / laplace.scale**2
            cross = columns.across(weights[:, None] * expansion.columns[:, :count])
            gradient = expansion.whole.slope[0][:count] / laplace.scale**2 + expansion.u[:count]
            back = laplace.covariance @ cross
            values, vectors = np.linalg.eigh(columns.normal(weights) - cross.T @ back)
            along = vectors.T @ (columns.across(weights * expansion.settled) - back.T @ gradient)
            # In the eigenvectors of S the gain is a sum over directions, so that all amplitudes (each is a prior SD of
            # the coefficients) are computed at once.
            scaled = variances[:, None] * np.maximum(values, 0.0)
            by_amplitude = 0.5 * (variances[:, None] / (1.0 + scaled)) @ along**2 - 0.5 * np.log1p(scaled).sum(axis=1)
            gains[at].append(float(logsumexp(by_amplitude, b=AMPLITUDE_WEIGHTS)))
            if at not in likeliest or by_amplitude.max() > likeliest[at][0]:
                likeliest[at] = float(by_amplitude.max()), columns, float(amplitudes[by_amplitude.argmax()])
    # The difference that robust weights make for the most likely function is applied to the mean over all functions.
    evidence = []
    for at, (linear, columns, amplitude) in likeliest.items():
        best = _robust_evidence(*fits[at], columns, amplitude)
        total = float(logsumexp(gains[at])) - math.log(len(gains[at]))
        evidence.append(best._replace(gain=total + best.gain - linear))
    return evidence


def smooth_functions(fit: Fit) -> Iterator[Columns]:
    """Yield smooth functions of the inputs, as possible discrepancies that no cause explains: one for each channel
    alone, and one that acts on all channels.

    Each function is given as whitened columns. It is a Gaussian process with the covariance Y^2 exp(-|x - x'|^2 / 2
    l^2) between the inputs x and x', where Y is the SD of the channel's measured values and l the prior median of the
    correlation length. At most MAX_KNOTS samples represent it (Nystroem's approximation).
    """
    experiment, noise = fit.task.experiment, fit.task.noise
    observed = np.where(noise.good, experiment.observed, np.nan)
    features = _features(experiment.varied, np.asarray(noise.good.any(axis=1)))
    parts = []
    for row in range(observed.shape[1]):
        spread = float(np.nanstd(observed[:, row])) or float(noise.floor[row])
        # A function of one channel: the features appear in this channel only, in units of the spread of its values.
        table = np.zeros((features.shape[-1], *observed.shape))
        table[:, :, row] = spread * np.moveaxis(features, -1, 0)
        parts.append(noise.white(table).T)
    everything = (slice(None),)
    yield from (Columns(part, everything) for part in parts)
    if len(parts) > 1:
        yield Columns(np.concatenate(parts, axis=1), everything)


def _features(inputs: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Return k functions of the inputs (folds, samples, k), whose products between two samples sum to the kernel of the
    Gaussian process.

    `inputs` has the shape (folds, samples, inputs), and `used` (folds, samples) marks the compared samples. k is at
    most MAX_KNOTS.
    """
    # Inputs are scaled to their range, so that one correlation length suits all.
    x = np.nan_to_num(inputs)
    low, high = x[used].min(axis=0), x[used].max(axis=0)
    x = (x - low) / np.where(high > low, high - low, 1.0)
    among = np.flatnonzero(used.ravel())
    knots = x.reshape(-1, x.shape[-1])[among[np.linspace(0, len(among) - 1, min(MAX_KNOTS, len(among))).astype(int)]]
    values, vectors = np.linalg.eigh(_kernel(knots, knots))
    sound = values > MIN_IDENTIFIABLE_SHARE * values[-1]
    features = _kernel(x.reshape(-1, x.shape[-1]), knots) @ (vectors[:, sound] / np.sqrt(values[sound]))
    return np.asarray(features).reshape(*x.shape[:2], -1)


def _kernel(x: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Return the kernel exp(-|x - x'|^2 / 2 l^2) (n, k) of a smooth discrepancy between n inputs x and k knots x'.

    `x` (n, inputs) and `knots` (k, inputs) are set values divided by their range; l is the prior median of the
    correlation length.
    """
    distance = ((x[:, None] - knots[None]) ** 2).sum(axis=-1)
    return np.asarray(np.exp(-0.5 * distance / PRIORS["l"].median ** 2))


def in_shares(columns: Columns, weights: np.ndarray, signal: float) -> Columns:
    """Scale an unlisted function, given as columns, to a common size: if its coefficients have the SD 1, its RMS over
    the residuals equals `signal`.

    All functions are then equally large before the data are seen. The variance is divided equally among all directions
    of possible changes of the residuals by the function. `weights` (n,) are Huber's weights of the residuals.
    """
    parts = []
    for run in columns.runs:
        part = columns.values[run]
        # Directions of the function without influence on the residuals are rounding and are removed.
        values, vectors = np.linalg.eigh(part.T @ (weights[run, None] * part))
        sound = values > MIN_IDENTIFIABLE_SHARE * max(float(values[-1]), 1e-12)
        size = signal * math.sqrt(len(part) / max(int(sound.sum()), 1))
        parts.append(part @ np.where(sound, vectors * size / np.sqrt(np.where(sound, values, 1.0)), 0.0))
    return Columns(np.concatenate(parts), columns.runs)


def rows_signal(fit: Fit) -> float:
    """Return the RMS of the measured values about the mean of their channel, in SDs of the noise, as a measure of the
    signal.

    The prior size of an unlisted function is proportional to it.
    """
    noise, observed = fit.task.noise, fit.task.experiment.observed
    # The mean of a channel is no signal: it says nothing about how the channel changes with the inputs.
    centred = observed - np.nanmean(observed, axis=(0, 2), keepdims=True)
    return float(np.sqrt(np.mean(noise.white(np.nan_to_num(centred)) ** 2)))
