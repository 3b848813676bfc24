"""What is noise in a drive log: size, memory and common mode of the residual blocks, and rows whitened by them."""

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.profile import SURE
from rover_pin.estimation.random_effects.random_field import RandomEffectsFilter

SHRINK = 0.2
"""Share by which correlations between channels are drawn to 0. Why: few blocks learn a dozen channels' (assumed)."""
MOST_MEMORY = 0.95
"""Greatest correlation of successive blocks."""
HUBER_THRESHOLD = 4.0
"""Whitened residuals beyond this many SDs count linearly, not squared. Why: white noise has one such in 16,000."""
COLOURED = 1.5
"""By how much chi2 by chance, and variances, exceed those of white noise: ground prepared anew leaves residuals that
hang together beyond AR(1) blocks and a random field. Why: set on 14 blind null sets (seed 3101): what was not there
gained up to 1.04 white fees, and errors of the numbers were 0.79 of SDs that had been widened by 2.25."""
SPREAD = 1.4826
"""SD over median absolute deviation of a normal law."""


@brief
@dataclass(frozen=True, eq=False)
class Noise:
    """AR(1) blocks with a covariance between channels: r_b = rho r_(b-1) + e_b, e_b = sd sqrt(1 - rho^2) L n_b.

    `sd` (channels,), or of every block (runs, channels, blocks) where rho = 0; `rho` (channels,), `mixing` the inverse
    of L (channels, channels); `good` (runs, channels, blocks) says which blocks are compared.
    """

    sd: np.ndarray
    rho: np.ndarray
    mixing: np.ndarray = field(repr=False)
    good: np.ndarray = field(repr=False)
    inflation: float = COLOURED
    "by how much chi2 by chance, and variances, exceed those of white rows; 1 where the noise is declared white"
    least: np.ndarray | float = field(default=0.0, repr=False)
    "SD (channels,) that it was held to at least, as of the error of a replay"
    random_effects: RandomEffectsFilter | None = None
    "what besides differs from run to run by chance, as the ground does"

    @property
    def floor(self) -> np.ndarray:
        """RMS of the noise of every channel (channels,)."""
        return self.sd if self.sd.ndim == 1 else rms_of(self.sd, self.good)

    def lower_bound(self, sample_scatter: np.ndarray | None) -> np.ndarray:
        """Return the SD (channels,) that no model beats: samples' scatter, where known, or `least`; else the noise."""
        if sample_scatter is None:
            return self.floor
        known = np.nan_to_num(sample_scatter) > 0
        return np.where(known, np.fmax(sample_scatter, self.least), self.floor)

    @property
    def fold(self) -> np.ndarray:
        """Which run each compared block is of (n,)."""
        return np.nonzero(self.good)[0]

    @property
    def count(self) -> int:
        """Number of compared blocks of all channels."""
        return int(self.good.sum())

    def white(self, residual: np.ndarray) -> np.ndarray:
        """Return residuals (..., runs, channels, blocks) as rows (..., n) of SD 1 without memory or common mode.

        A row that is not predicted stays NaN, and tells its neighbours nothing.
        """
        lost = np.isnan(residual)
        rows = np.asarray(self._scale_residual(np.where(lost, 0.0, residual))[..., self.good])
        white = rows if self.random_effects is None else self.random_effects.taken_out(rows, self.good)
        return np.where(lost[..., self.good], np.nan, white)

    def _scale_residual(self, residual: np.ndarray) -> np.ndarray:
        """Return residuals in their SDs, without memory or common mode where the noise has any."""
        if self.sd.ndim > 1:
            return np.asarray(residual / self.sd)
        steps = _innovations(np.where(self.good, residual, 0.0), self.good, self.rho)
        scaled = steps / (self.sd * np.sqrt(1 - self.rho**2))[:, None]
        return np.asarray(self.mixing @ np.where(self.good, scaled, 0.0))


def _innovations(residual: np.ndarray, good: np.ndarray, rho: np.ndarray) -> np.ndarray:
    """Return r_b - rho r_(b-1), or sqrt(1 - rho^2) r_b where the block before is not compared."""
    before = np.zeros_like(residual)
    before[..., 1:] = residual[..., :-1]
    follows = np.zeros_like(good)
    follows[..., 1:] = good[..., 1:] & good[..., :-1]
    memory = rho[:, None]
    return np.where(follows, residual - memory * before, np.sqrt(1 - memory**2) * residual)


def first_noise(residual: np.ndarray, least: np.ndarray) -> Noise:
    """Return noise as large as a residual itself, no less than `least` (channels,), without memory."""
    good = np.isfinite(residual)
    sd = np.array([spread(residual[:, row][good[:, row]]) for row in range(residual.shape[1])])
    return Noise(np.maximum(sd, least), np.zeros(len(sd)), np.eye(len(sd)), good, least=least)


def declared_noise(sd: np.ndarray, observed: np.ndarray) -> Noise:
    """Return white noise of declared SDs, (channels,) or of each of what was observed (folds, channels, samples)."""
    channels = observed.shape[1]
    return Noise(np.asarray(sd, float), np.zeros(channels), np.eye(channels), np.isfinite(observed), inflation=1.0)


class Absorbed(NamedTuple):
    """What a fit took of the noise: variance of each block (runs, channels, blocks), covariance with the one before."""

    variance: np.ndarray
    lagged: np.ndarray


def noise_of(residual: np.ndarray, good: np.ndarray, least: np.ndarray, absorbed: Absorbed | None = None) -> Noise:
    """Return the noise that a residual (runs, channels, blocks) shows, no less than `least` (channels,).

    With what the fit `absorbed` the expected squares and products of the noise itself stand, sum of those of what is
    left and of what is explained (a step of expectation maximisation; Dempster, Laird and Rubin, J. Roy. Stat. Soc. B
    39 (1977) 1), where the residual's alone are too small by the share of the columns in the rows.
    """
    channels = residual.shape[1]
    sd, rho, given_back = np.zeros((3, channels))
    for row in range(channels):
        values = np.where(good[:, row], residual[:, row], np.nan)
        sd[row] = max(spread(values[np.isfinite(values)]), least[row])
        clipped = np.clip(values, -3 * sd[row], 3 * sd[row])
        current, previous = clipped[:, 1:].ravel(), clipped[:, :-1].ravel()
        both = np.isfinite(current * previous)
        power = float(np.nanmean(clipped**2)) if both.any() else 0.0
        product = float(np.mean(current[both] * previous[both])) if both.any() else 0.0
        taken = lagged = 0.0
        if absorbed is not None and both.any():
            taken = float(np.mean(absorbed.variance[:, row][good[:, row]]))
            lagged = float(np.mean(absorbed.lagged[:, row, 1:].ravel()[both]))
            sd[row], power, product = float(np.hypot(sd[row], np.sqrt(taken))), power + taken, product + lagged
        memory = product / power if power > 0 else 0.0
        rho[row] = min(max(memory, 0.0), MOST_MEMORY)
        step = taken * (1 + rho[row] ** 2) - 2 * rho[row] * lagged
        given_back[row] = max(step, 0.0) / (sd[row] ** 2 * (1 - rho[row] ** 2))
    plain = Noise(sd, rho, np.eye(channels), good, least=least)
    return replace(plain, mixing=_mixing(plain, residual, given_back))


def _mixing(plain: Noise, residual: np.ndarray, given_back: np.ndarray) -> np.ndarray:
    """Return the inverse Cholesky factor of the correlations of the innovations, drawn to 0 by SHRINK.

    Innovations are scaled to SD 1, with what a fit took of their variance `given_back` (channels,), but to no more than
    `least` allows. What is added to what is left of a channel is no other channel's.
    """
    rows: np.ndarray = np.full(residual.shape, np.nan)
    rows[plain.good] = np.clip(plain.white(residual), -3, 3)
    table = np.moveaxis(rows, 1, 0).reshape(residual.shape[1], -1)
    finite = np.isfinite(table)
    filled = np.where(finite, table, 0.0)
    shared = np.maximum(finite.astype(float) @ finite.T, 1.0)
    covariance = filled @ filled.T / shared
    size = np.maximum(np.sqrt(np.diag(covariance) + given_back), plain.least / plain.sd)
    correlation = (1 - SHRINK) * covariance / np.outer(size, size)
    np.fill_diagonal(correlation, 1.0)
    values, vectors = np.linalg.eigh(correlation)
    sound = (vectors * np.maximum(values, 0.05)) @ vectors.T
    lower = np.linalg.cholesky(sound)
    return np.asarray(np.linalg.inv(lower) / size)


def rms_of(table: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Return the RMS of each channel (channels,) of a table (folds, channels, samples) where it is good; 0 of none."""
    squares = np.where(good, table, 0.0) ** 2
    return np.asarray(np.sqrt(squares.sum(axis=(0, 2)) / np.maximum(good.sum(axis=(0, 2)), 1)))


def spread(values: np.ndarray) -> float:
    """Return a robust SD about 0."""
    return SPREAD * float(np.median(np.abs(values))) if values.size else 0.0


def correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Return the correlation of what is known of both; 0 where that is too little, or one of them does not move."""
    both = np.isfinite(first) & np.isfinite(second)
    a, b = first[both], second[both]
    if len(a) < 3 or np.std(a) < 1e-12 or np.std(b) < 1e-12:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def huber_weights(rows: np.ndarray) -> np.ndarray:
    """Return the weights with which outlying rows count."""
    return np.asarray(np.minimum(1.0, HUBER_THRESHOLD / np.maximum(np.abs(rows), 1e-12)))


def huber_losses(rows: Any) -> np.ndarray:
    """Return r^2 of each row, beyond HUBER_THRESHOLD linear."""
    size = np.abs(rows)
    return np.asarray(np.where(size > HUBER_THRESHOLD, 2 * HUBER_THRESHOLD * size - HUBER_THRESHOLD**2, size**2))


def huber(rows: Any) -> float:
    """Return the robust sum of squares."""
    return float(np.sum(huber_losses(rows)))


def null_gain(count: int) -> float:
    """Return the gain in chi2 that chance alone gives the best of `count` in 1 - SURE of sets."""
    return 2 * math.log(max(count, 1) / (1 - SURE))
