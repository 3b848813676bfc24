"""How errors hang together: the sensors' noise, smooth discrepancy, scatter of folds, drift, a law's own form error.

The error of channel c has the covariance
    C_c = s_c^2 diag(sd^2) + t_c^2 n_c^2 [same fold] + d_c^2 n_c^2 exp(-|turns apart| / memory)
        + a_c^2 Y_c^2 exp(-|x - x'|^2 / 2 l^2) + e^2 sum_j g_j g_j' exp(-|x - x'|^2 / 2 l^2)
with n_c the declared noise, Y_c the spread of what was measured, x what was set over its range, and g_j what law j
adds. Folds scatter as beds prepared anew do; noise drifts over the turns, where the order of runs mixes folds. Each of
s, t, d, a, e, l has a prior on its logarithm; a and l act where the discrepancy is smooth, e and l where a law's form
is off.
Source: Kennedy and O'Hagan, J. Roy. Stat. Soc. B 63 (2001) 425; Brynjarsdottir and O'Hagan, Inverse Probl. 30 (2014).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.inference.samples import Samples


class Scale(NamedTuple):
    """Prior of the logarithm of a scale of the error model."""

    median: float
    sd: float


PRIORS = {
    "s": Scale(1.0, 0.15),
    "t": Scale(0.3, 1.0),
    "d": Scale(0.3, 1.0),
    "a": Scale(0.05, 0.8),
    "e": Scale(0.1, 0.5),
    "l": Scale(0.5, 0.5),
}
"""Noise over that declared; scatter of folds and drift over the noise; smooth discrepancy over the channel's spread;
form error over what a law adds; length of both over the range of each input (assumed: declared SDs hold to 15 %)."""
MEMORY = 0.15
"""Memory of drift over the length of the campaign. Why: drift turns a few times in a campaign (assumed)."""


class Discrepancy(Enum):
    """What the laws of a hypothesis leave besides noise."""

    NONE = "nothing"
    FORM = "an error of form"
    SMOOTH = "a smooth discrepancy"


class Settings(NamedTuple):
    """Where a channel is or may be measured: inputs (m, inputs), each over its range, what each law adds (laws, m)."""

    inputs: np.ndarray
    added: np.ndarray


class Term(NamedTuple):
    """One variance component of a channel: its scale and the matrix that the square of the scale multiplies."""

    scale: int
    matrix: np.ndarray


@brief
@dataclass(frozen=True, eq=False)
class ErrorModel:
    """The scales that act, and the covariance of every channel as a function of their logarithms eta."""

    samples: Samples
    discrepancy: Discrepancy
    added: Sequence[np.ndarray] = ()
    "what each law adds (n,), for its form error"
    inflation: np.ndarray | None = None
    "by how much the variance of each sample (n,) is raised, as a stray's"
    scales: tuple[tuple[str, int], ...] = field(init=False)
    "letter and channel of each scale; -1 for those that all share"

    def __post_init__(self) -> None:
        shared = ["t", *(["d"] if self.samples.turn is not None else [])]
        letters = ["s", *(shared if self.samples.repeats else [])]
        letters += ["a"] if self.discrepancy is Discrepancy.SMOOTH else []
        block_scales = [(letter, at) for at in range(len(self.samples.blocks)) for letter in letters]
        common = {Discrepancy.NONE: (), Discrepancy.FORM: ("e", "l"), Discrepancy.SMOOTH: ("l",)}[self.discrepancy]
        object.__setattr__(self, "scales", (*block_scales, *((letter, -1) for letter in common)))

    @property
    def median(self) -> np.ndarray:
        """Logarithm of the prior median of each scale."""
        return np.log([PRIORS[letter].median for letter, _ in self.scales])

    @property
    def sd(self) -> np.ndarray:
        """Prior SD of the logarithm of each scale."""
        return np.array([PRIORS[letter].sd for letter, _ in self.scales])

    def scales_like(self, source_model: ErrorModel, eta: np.ndarray) -> np.ndarray:
        """Return the scales of another error model where both have them, else their medians, as logarithms."""
        eta_by_scale = dict(zip(source_model.scales, eta, strict=True))
        return np.array(
            [eta_by_scale.get(scale, median) for scale, median in zip(self.scales, self.median, strict=True)]
        )

    def covariance(self, eta: np.ndarray, at: int) -> np.ndarray:
        """Return the covariance (m, m) of one channel."""
        return self.with_slopes(eta, at)[0]

    def with_slopes(self, eta: np.ndarray, at: int) -> tuple[np.ndarray, dict[int, np.ndarray]]:
        """Return the covariance of one channel, and its derivative by each scale's logarithm that acts on it."""
        total, slopes = np.zeros((len(self.samples.blocks[at]),) * 2), {}
        for term in self._terms[at]:
            part = math.exp(2.0 * eta[term.scale]) * term.matrix
            total += part
            slopes[term.scale] = 2.0 * part
        if self.discrepancy is not Discrepancy.NONE:
            smooth = self.smooth_part(eta, at)
            total += smooth
            slopes[self.scales.index(self._smooth_scale(at))] = 2.0 * smooth
            slopes[len(self.scales) - 1] = smooth * self.samples.distances[at] / math.exp(eta[-1]) ** 2
        return total, slopes

    def smooth_part(self, eta: np.ndarray, at: int) -> np.ndarray:
        """Return the covariance (m, m) of a channel's discrepancy, smooth or of form."""
        added = self._added_of(at)
        return self._smooth(eta, at, (added, added), self.samples.distances[at])

    def smooth_between(self, eta: np.ndarray, at: int, first: Settings, second: Settings) -> np.ndarray:
        """Return the covariance (m, k) of a channel's discrepancy at m settings with that at k others."""
        distances = ((first.inputs[:, None] - second.inputs[None]) ** 2).sum(axis=-1)
        return self._smooth(eta, at, (first.added, second.added), distances)

    def settings_of(self, at: int, inputs: np.ndarray) -> Settings:
        """Return the settings of a channel's samples, `inputs` (n, inputs) those of all."""
        return Settings(inputs[self.samples.blocks[at]], self._added_of(at))

    def _smooth_scale(self, at: int) -> tuple[str, int]:
        return ("a", at) if self.discrepancy is Discrepancy.SMOOTH else ("e", -1)

    def _added_of(self, at: int) -> np.ndarray:
        """Return what each law adds to a channel (laws, m); without a form error none is listed."""
        block = self.samples.blocks[at]
        return np.array([row[block] for row in self.added]).reshape(-1, len(block))

    def _smooth(
        self, eta: np.ndarray, at: int, added: tuple[np.ndarray, np.ndarray], distances: np.ndarray
    ) -> np.ndarray:
        if self.discrepancy is Discrepancy.NONE:
            return np.zeros(distances.shape)
        square = math.exp(2.0 * eta[self.scales.index(self._smooth_scale(at))])
        is_smooth = self.discrepancy is Discrepancy.SMOOTH
        amplitude = self.samples.spread[at] ** 2 if is_smooth else added[0].T @ added[1]
        return np.asarray(square * amplitude * np.exp(-0.5 * distances / math.exp(eta[-1]) ** 2))

    @cached_property
    def _terms(self) -> tuple[tuple[Term, ...], ...]:
        return tuple(tuple(self._terms_of(at)) for at in range(len(self.samples.blocks)))

    def _terms_of(self, at: int) -> Iterator[Term]:
        block, noise = self.samples.blocks[at], self.samples.noise[at]
        inflation = 1.0 if self.inflation is None else self.inflation[block]
        fold = self.samples.fold[block]
        matrices = {"s": np.diag(self.samples.sd[block] ** 2 * inflation)}
        matrices["t"] = noise**2 * (fold[:, None] == fold[None])
        if self.samples.turn is not None:
            turn = self.samples.turn[block]
            memory = MEMORY * max(float(np.ptp(self.samples.turn)), 1.0)
            matrices["d"] = noise**2 * np.exp(-np.abs(turn[:, None] - turn[None]) / memory)
        for letter, matrix in matrices.items():
            if (letter, at) in self.scales:
                yield Term(self.scales.index((letter, at)), matrix)
