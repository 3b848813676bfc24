"""The noise of an experiment: its SD, its correlation in time and between channels, and the whitening of residuals.

A block is one sample of a channel; in a drive log, it is the mean of the channel over a short time. The memory of the
noise is its correlation between successive blocks.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.random_effects.random_field import RandomEffectsFilter

CORRELATION_SHRINKAGE = 0.2
"""Reduction of the estimated correlations between the noise of different channels towards 0, as a fraction. A few
blocks cannot determine the correlations of a dozen channels, and a wrong correlation gives single combinations of
channels too much weight (assumed)."""
MAX_MEMORY = 0.95
"""Largest correlation of the noise in successive blocks. A larger estimate is replaced by this value, because whitening
divides by sqrt(1 - rho^2) and would amplify differences without limit."""
LEARNT_NOISE_INFLATION = 1.5
"""Factor on the variances of parameters, and on the decrease of chi2 that chance explains, if the noise was estimated
from the residual.

Without this factor, intervals would be too narrow, and chance would look like an effect: terrain that is prepared anew
leaves residuals with more correlation than the noise model has. The value was set on 14 blind data sets without a
missing effect."""
SD_OVER_MAD = 1.4826
"""Ratio of the SD to the median absolute deviation of a normal distribution. A robust SD is the median absolute
deviation times this ratio."""


@brief
@dataclass(frozen=True, eq=False)
class Noise:
    """Model of the noise: correlated in time within each channel, and correlated between channels.

    The errors r_b of all channels in block b are r_b = rho r_(b-1) + e_b with e_b = sd sqrt(1 - rho^2) L n_b. Here rho
    is the correlation between successive blocks, sd the SD of each channel, L the root of the correlation matrix of the
    channels, and n_b white noise of SD 1.
    """

    sd: np.ndarray
    """SD of each channel (channels,), or of each block (folds, channels, samples) for noise without correlations"""
    rho: np.ndarray
    """correlation of the noise in successive blocks (channels,)"""
    mixing: np.ndarray = field(repr=False)
    """inverse of the matrix L that describes the correlations between channels (channels, channels), for whitening
    residuals"""
    good: np.ndarray = field(repr=False)
    """mask of the compared samples (folds, channels, samples)"""
    inflation: float = LEARNT_NOISE_INFLATION
    """ratio of variances, and of decreases of chi2 by chance, to their values for white noise; 1 for declared white
    noise"""
    least: np.ndarray | float = field(default=0.0, repr=False)
    """minimum SD (channels,) of estimated noise, for example the error of a replay"""
    random_effects: RandomEffectsFilter | None = None
    """random differences between runs in addition to the noise, for example of the terrain"""

    @property
    def floor(self) -> np.ndarray:
        """RMS of the noise of each channel (channels,), in the channel's unit."""
        return self.sd if self.sd.ndim == 1 else rms_of(self.sd, self.good)

    def lower_bound(self, sample_scatter: np.ndarray | None) -> np.ndarray:
        """Return the smallest error (SD) of each channel (channels,) that a model can reach.

        For a channel whose samples have a known scatter (`sample_scatter` (channels,), in the channel's unit), this is
        the scatter, raised to at least `least`. For every other channel it is the RMS of the noise (`floor`).
        """
        if sample_scatter is None:
            return self.floor
        known = np.nan_to_num(sample_scatter) > 0
        return np.where(known, np.fmax(sample_scatter, self.least), self.floor)

    @property
    def fold(self) -> np.ndarray:
        """Index of the fold of each compared sample (n,)."""
        return np.nonzero(self.good)[0]

    @property
    def count(self) -> int:
        """Number of compared samples of all channels."""
        return int(self.good.sum())

    def white(self, residual: np.ndarray) -> np.ndarray:
        """Return residuals (..., folds, channels, samples) as whitened residuals (..., n): with an SD of 1 and no
        correlations, for the n compared samples.

        The residual of a missing prediction (NaN) stays NaN and does not affect its neighbours.
        """
        lost = np.isnan(residual)
        # Missing predictions are computed as 0 and set back to NaN at the end, so that they do not spread to their
        # neighbours.
        known = np.where(lost, 0.0, residual)
        if self.sd.ndim > 1:
            # Noise with an SD for each block has no memory and no correlations between channels.
            scaled = known / self.sd
        else:
            # First the correlation in time is removed (channel by channel), then the correlation between channels.
            steps = innovations(np.where(self.good, known, 0.0), self.good, self.rho)
            steps = steps / (self.sd * np.sqrt(1 - self.rho**2))[:, None]
            scaled = self.mixing @ np.where(self.good, steps, 0.0)
        rows = np.asarray(scaled[..., self.good])
        if self.random_effects is not None:
            rows = self.random_effects.taken_out(rows, self.good)
        return np.where(lost[..., self.good], np.nan, rows)


def innovations(residual: np.ndarray, good: np.ndarray, rho: np.ndarray) -> np.ndarray:
    """Return the part of each residual that cannot be predicted from the previous block (folds, channels, samples).

    For block b this innovation is r_b - rho r_(b-1), or sqrt(1 - rho^2) r_b if block b - 1 is missing, where rho
    (channels,) is the correlation of the noise in successive blocks. Both expressions have the variance sd^2 (1 -
    rho^2), so that a block after a gap has the weight of every other block. `residual` and `good` have the shape
    (folds, channels, samples); `good` marks the compared samples.
    """
    before = np.zeros_like(residual)
    before[..., 1:] = residual[..., :-1]
    # A block follows its predecessor only if both are compared.
    follows = np.zeros_like(good)
    follows[..., 1:] = good[..., 1:] & good[..., :-1]
    memory = rho[:, None]
    return np.where(follows, residual - memory * before, np.sqrt(1 - memory**2) * residual)


def first_noise(residual: np.ndarray, least: np.ndarray) -> Noise:
    """Return uncorrelated noise for a first fit, with the SD of each channel estimated from a residual (folds,
    channels, samples).

    The SD of each channel is raised to at least `least` (channels,).
    """
    good = np.isfinite(residual)
    sd = np.array([spread(residual[:, row][good[:, row]]) for row in range(residual.shape[1])])
    return Noise(np.maximum(sd, least), np.zeros(len(sd)), np.eye(len(sd)), good, least=least)


def declared_noise(sd: np.ndarray, observed: np.ndarray) -> Noise:
    """Return white noise whose SDs are declared, not estimated.

    Parameters
    ----------
    sd : array (channels,) or (folds, channels, samples)
        SD of each channel, or of each measured value.
    observed : array (folds, channels, samples)
        Measured values; a value that is NaN is not compared.
    """
    channels = observed.shape[1]
    return Noise(np.asarray(sd, float), np.zeros(channels), np.eye(channels), np.isfinite(observed), inflation=1.0)


class AbsorbedNoise(NamedTuple):
    """Noise that the fitted parameters imitated, so that the residual no longer contains it.

    `variance` is its variance in each block, and `lagged` its covariance with the block before. Both have the shape
    (folds, channels, samples).
    """

    variance: np.ndarray
    lagged: np.ndarray


def noise_of(residual: np.ndarray, good: np.ndarray, least: np.ndarray, absorbed: AbsorbedNoise | None = None) -> Noise:
    """Estimate the noise of an experiment from a residual (folds, channels, samples).

    `good` marks the compared samples. The SD of each channel is raised to at least `least` (channels,). A fit of p
    parameters to n residuals absorbs a fraction p / n of the noise's variance. If `absorbed` is given, its variances
    and covariances are therefore added to the squares and products of the residual (one step of expectation
    maximisation). Source: Dempster, Laird and Rubin, J. Roy. Stat. Soc. B 39 (1977) 1.
    """
    channels = residual.shape[1]
    sd, rho, given_back = np.zeros((3, channels))
    for row in range(channels):
        values = np.where(good[:, row], residual[:, row], np.nan)
        sd[row] = max(spread(values[np.isfinite(values)]), least[row])
        # Outliers would dominate the products, so that they are clipped at 3 SD.
        clipped = np.clip(values, -3 * sd[row], 3 * sd[row])
        current, previous = clipped[:, 1:].ravel(), clipped[:, :-1].ravel()
        # Correlation in time: mean product of neighbouring blocks divided by the mean square.
        both = np.isfinite(current * previous)
        power = float(np.nanmean(clipped**2)) if both.any() else 0.0
        product = float(np.mean(current[both] * previous[both])) if both.any() else 0.0
        taken = lagged = 0.0
        if absorbed is not None and both.any():
            taken = float(np.mean(absorbed.variance[:, row][good[:, row]]))
            lagged = float(np.mean(absorbed.lagged[:, row, 1:].ravel()[both]))
            sd[row], power, product = float(np.hypot(sd[row], np.sqrt(taken))), power + taken, product + lagged
        # A negative correlation is set to 0, which makes the intervals wider, never narrower.
        memory = product / power if power > 0 else 0.0
        rho[row] = min(max(memory, 0.0), MAX_MEMORY)
        # Variance of the innovations that the fit absorbed, needed for the correlations between channels.
        step = taken * (1 + rho[row] ** 2) - 2 * rho[row] * lagged
        given_back[row] = max(step, 0.0) / (sd[row] ** 2 * (1 - rho[row] ** 2))
    plain = Noise(sd, rho, np.eye(channels), good, least=least)
    # Correlations between channels are estimated from innovations (see `innovations`) in SDs, clipped at 3 SD, because
    # outliers would dominate the products.
    rows: np.ndarray = np.full(residual.shape, np.nan)
    rows[good] = np.clip(plain.white(residual), -3, 3)
    table = np.moveaxis(rows, 1, 0).reshape(channels, -1)
    finite = np.isfinite(table)
    filled = np.where(finite, table, 0.0)
    shared = np.maximum(finite.astype(float) @ finite.T, 1.0)
    covariance = filled @ filled.T / shared
    # The absorbed variance is added to the variance of each channel, but not to the covariances, because it belongs to
    # one channel alone. The correlations are reduced by CORRELATION_SHRINKAGE.
    size = np.maximum(np.sqrt(np.diag(covariance) + given_back), least / sd)
    correlation = (1 - CORRELATION_SHRINKAGE) * covariance / np.outer(size, size)
    np.fill_diagonal(correlation, 1.0)
    # Pairs of channels may be compared on different blocks, and their correlations may then contradict each other:
    # eigenvalues of at least 0.05 keep the matrix positive definite.
    values, vectors = np.linalg.eigh(correlation)
    sound = (vectors * np.maximum(values, 0.05)) @ vectors.T
    # The inverse Cholesky factor removes the correlations between channels from whitened residuals.
    lower = np.linalg.cholesky(sound)
    return replace(plain, mixing=np.asarray(np.linalg.inv(lower) / size))


def rms_of(table: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Return the RMS of each channel (channels,) of a table (folds, channels, samples), from the values that `good`
    marks as compared; 0 for a channel without compared values.
    """
    squares = np.where(good, table, 0.0) ** 2
    return np.asarray(np.sqrt(squares.sum(axis=(0, 2)) / np.maximum(good.sum(axis=(0, 2)), 1)))


def spread(values: np.ndarray) -> float:
    """Return the robust SD of values whose mean is known to be 0, such as residuals: SD_OVER_MAD times their median
    absolute value.
    """
    return SD_OVER_MAD * float(np.median(np.abs(values))) if values.size else 0.0


def correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Return the correlation of two series of samples; samples with a value that is not finite are omitted.

    The result is 0 if fewer than three samples remain, or if a series is constant.
    """
    both = np.isfinite(first) & np.isfinite(second)
    a, b = first[both], second[both]
    if len(a) < 3 or np.std(a) < 1e-12 or np.std(b) < 1e-12:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
