"""The one calculus of every choice: how much more likely a reading makes what was recorded than chance does.

Two signals x and y that a reading relates by y = b x, b > 0, with n independent samples and the correlation rho (about
zero) have the Bayes factor (1 - rho^2)^(-n/2) n^(-1/2) 2 Phi(z), z = rho (n / (1 - rho^2))^(1/2), against unrelated
ones (Wagenmakers 2007, by BIC; the last factor for the sign). What b should be, from units and physics, counts by its
density over that of a b of any size. Samples that follow one another are fewer: n (1 - a_x a_y) / (1 + a_x a_y), with
the autocorrelations a of neighbours (Bartlett 1946). Logarithms of such factors and of priors add up; a choice's
confidence is the share of all readings that agree on it.
"""

import math
from typing import Any

import numpy as np
from scipy.special import log_ndtr

SURE = 0.95
"""Share of the readings that must agree on a choice; below it the user is asked."""
NONE_FITS = math.log(0.05)
"""Log prior of no reading being right, by which the best must be better than chance too."""
RANGE = 2.0 * math.log(1e4)
"""Logarithm of the range of a scale of any size."""
RARE = 0.1
"""Share of scales that lie four times as far off as usual: much slip, hard scrub."""


def relation(dot: Any, y: Any, x: Any, n: Any, prior: tuple[float, float] | None, free: Any = False) -> np.ndarray:
    """Return the log Bayes factor of y = b x by the sizes of both, their product, and n independent samples.

    `prior` is the logarithm of the b that physics and units expect, and its spread; of `free` ones any b will do.
    """
    rho, n = _correlation(dot, y, x), np.maximum(n, 1.0)
    error = np.sqrt((1.0 - rho**2) / n)
    factor = -0.5 * n * np.log(1.0 - rho**2) - 0.5 * np.log(n) + sense(dot, y, x, n)
    if prior is not None:
        positive = np.maximum(rho, 1e-3)
        log_scale = np.log(np.maximum(positive * y / np.maximum(x, 1e-300), 1e-300))
        factor += np.where(free | (rho <= 0.0), 0.0, _log_density_ratio(log_scale, error / positive, *prior))
    return np.asarray(np.where((x > 0.0) & (y > 0.0), factor, 0.0))


def sense(dot: Any, y: Any, x: Any, n: Any) -> np.ndarray:
    """Return the log Bayes factor of a b above 0 against one of either sign, related they be."""
    rho = _correlation(dot, y, x)
    factor = math.log(2.0) + log_ndtr(rho * np.sqrt(np.maximum(n, 1.0) / (1.0 - rho**2)))
    return np.asarray(np.where((x > 0.0) & (y > 0.0), factor, 0.0))


def scale_evidence(y: Any, x: Any, n: Any, prior: tuple[float, float], free: Any = False) -> np.ndarray:
    """Return the log Bayes factor of the ratio of two sizes that are related, by what physics and units expect."""
    log_scale = np.log(np.maximum(y, 1e-300) / np.maximum(x, 1e-300))
    expected = _log_density_ratio(np.asarray(log_scale), 1.0 / np.sqrt(np.maximum(n, 1.0)), *prior)
    return np.where(free | (np.minimum(x, y) <= 0.0), 0.0, expected)


def _correlation(dot: Any, y: Any, x: Any) -> np.ndarray:
    return np.asarray(np.clip(dot / np.maximum(y * x, 1e-300), -0.9999, 0.9999))


def _log_density_ratio(log_scale: np.ndarray, error: np.ndarray, middle: float, sd: float) -> np.ndarray:
    """Return the log of the density of a measured scale where it should be `about`, over that of any size."""
    density = np.zeros_like(log_scale)
    for share, spread in ((1.0 - RARE, sd), (RARE, 4.0 * sd)):
        wide = np.hypot(spread, error)
        density += share * np.exp(-0.5 * ((log_scale - middle) / wide) ** 2) / (wide * math.sqrt(2.0 * math.pi))
    return np.asarray(np.log(RANGE * np.maximum(density, 1e-200)))


def independent(x: np.ndarray, y: np.ndarray) -> float:
    """Return how many independent samples two series hold together."""
    product = _neighbours(x) * _neighbours(y)
    return max(2.0, len(x) * (1.0 - product) / (1.0 + product))


def _neighbours(x: np.ndarray) -> float:
    size = float(np.sum(np.abs(x) ** 2))
    return float(np.clip(np.real(np.sum(x[1:] * np.conj(x[:-1]))) / size, 0.0, 1.0)) if size > 0.0 else 0.0


def shares(logs: np.ndarray, none_fits: float = NONE_FITS) -> np.ndarray:
    """Return the probabilities of readings with these logarithms of prior times likelihood, none of them beside."""
    top = max(float(np.max(logs, initial=-np.inf)), none_fits, -1e6)
    weights = np.exp(logs - top)
    return np.asarray(weights / max(weights.sum() + math.exp(none_fits - top), 1e-300))


def mean_known(rows: Any) -> np.ndarray:
    """Return the mean over rows, (rows, samples), of what is known of each sample; NaN where nothing is."""
    return np.asarray(np.ma.masked_invalid(rows).mean(axis=0).filled(np.nan))
