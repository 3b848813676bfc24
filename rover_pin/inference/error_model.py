"""Covariance of the errors (measured minus predicted values): sensor noise, scatter between folds, drift, and a smooth
discrepancy or an error in the form of the causes' laws.

The errors of a block (one channel in one campaign) have the covariance

    C = s^2 diag(sd^2) + t^2 N^2 [same fold] + d^2 N^2 exp(-|turns apart| / memory)
        + a^2 Y^2 exp(-|x - x'|^2 / 2 l^2) + e^2 sum_j g_j g_j' exp(-|x - x'|^2 / 2 l^2)

with sd the declared noise of each sample, N its RMS over the block, Y the SD of the measured values, x the inputs
divided by their range, and g_j the contribution of cause j to the prediction. The unknown factors are called scales:

- s: factor on the declared noise.
- t: error that all samples of a fold share, for example because the sand was prepared anew.
- d: noise that drifts over the turns (the order of the measurements), if that order mixes the folds.
- a: smooth discrepancy, a function of the inputs that no cause explains.
- e: error of form: a cause's law is right in size but wrong in shape.
- l: correlation length of a and e, in ranges of the inputs.

Each scale has a normal prior on its logarithm. Source: Kennedy and O'Hagan, J. Roy. Stat. Soc. B 63 (2001) 425;
Brynjarsdottir and O'Hagan, Inverse Probl. 30 (2014).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.inference.samples import Samples


class Scale(NamedTuple):
    """Prior of one scale (unknown factor) of the error model: the logarithm of the scale is normally distributed.

    `median` is the median of the scale, and `sd` the SD of its logarithm.
    """

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
"""Prior of each unknown scale of the errors, as median and SD of its logarithm, by letter.

The scale s (noise) is relative to the declared noise; t (error that a fold shares) and d (drift) are relative to the
noise; a (smooth discrepancy) is relative to the SD of the channel's values; e (error of form) is relative to the
contribution of the causes' laws; l (correlation length) is relative to the range of each input. A scale far from its
median lowers the probability of a hypothesis. The values are assumed: declared SDs are right to 15 %, shared errors and
drift are smaller than the noise, a discrepancy is about 5 % of the signal, and a law is about 10 % wrong."""
DRIFT_MEMORY = 0.15
"""Correlation length of drifting noise along the order of measurement, as a fraction of the whole sequence of samples.
Slower drift would look like a physical law, faster drift like noise. The value is assumed: drift changes its direction
a few times during the measurements."""


class Discrepancy(Enum):
    """Kind of difference between model and data that remains in a hypothesis in addition to noise.

    NONE: only noise remains. FORM: the law of a cause is right in size but wrong in shape. SMOOTH: a smooth function of
    the inputs (such as slip) remains that no cause explains.
    """

    NONE = "nothing"
    FORM = "an error of form"
    SMOOTH = "a smooth discrepancy"


class Settings(NamedTuple):
    """Properties of m samples that determine the covariance of a discrepancy between them.

    `inputs` (m, inputs) are the set values such as slip or load, divided by their range. `added` (causes, m) is the
    contribution of each cause to the prediction of each sample.
    """

    inputs: np.ndarray
    added: np.ndarray


class VarianceComponent(NamedTuple):
    """One term of the covariance of the errors in a block of m samples: the square of a scale times `matrix` (m, m).

    `scale` is the index of this scale in eta, the vector of the logarithms of the scales.
    """

    scale: int
    matrix: np.ndarray


@brief
@dataclass(frozen=True, eq=False)
class ErrorModel:
    """Covariance of the errors of all samples, as a function of eta: the logarithms of the unknown sizes (scales) of
    noise, drift and discrepancy.

    The active scales depend on the samples (an error that a fold shares needs repeats, drift needs a known order of
    measurement) and on the kind of discrepancy. `evidence.py` estimates eta from the residual.
    """

    samples: Samples
    discrepancy: Discrepancy
    added: Sequence[np.ndarray] = ()
    """contribution of each cause to the prediction, one array (n,) for each cause; needed for an error of form only"""
    inflation: np.ndarray | None = None
    """factor on the noise variance of each sample (n,), above 1 for an outlier; None if there is no outlier"""
    scales: tuple[tuple[str, int], ...] = field(init=False)
    """letter (key of PRIORS) of each active scale and index of its block (samples of one channel in one campaign), in
    the order of eta; the index is -1 for a scale that all blocks share"""

    def __post_init__(self) -> None:
        # A shared error and a drift can be told apart from noise only if a fold has several samples of a channel.
        shared = ["t", *(["d"] if self.samples.turn is not None else [])]
        letters = ["s", *(shared if self.samples.repeats else [])]
        letters += ["a"] if self.discrepancy is Discrepancy.SMOOTH else []
        block_scales = [(letter, at) for at in range(len(self.samples.blocks)) for letter in letters]
        # The correlation length l is always the last scale; `with_slopes` relies on this order.
        common = {Discrepancy.NONE: (), Discrepancy.FORM: ("e", "l"), Discrepancy.SMOOTH: ("l",)}[self.discrepancy]
        object.__setattr__(self, "scales", (*block_scales, *((letter, -1) for letter in common)))

    @property
    def median(self) -> np.ndarray:
        """Prior mean of eta (scales,): the logarithm of the prior median of each active scale."""
        return np.log([PRIORS[letter].median for letter, _ in self.scales])

    @property
    def sd(self) -> np.ndarray:
        """Prior SD of eta (scales,), the logarithms of the active scales."""
        return np.array([PRIORS[letter].sd for letter, _ in self.scales])

    def scales_like(self, source_model: ErrorModel, eta: np.ndarray) -> np.ndarray:
        """Return start values (scales,) for eta, the logarithms of the scales, from the values `eta` of another error
        model.

        A scale that both models have takes the value of the other model (`source_model`); every other scale starts from
        its prior median.
        """
        eta_by_scale = dict(zip(source_model.scales, eta, strict=True))
        return np.array(
            [eta_by_scale.get(scale, median) for scale, median in zip(self.scales, self.median, strict=True)]
        )

    def covariance(self, eta: np.ndarray, at: int) -> np.ndarray:
        """Return the covariance (m, m) of the errors of the m samples in the block with index `at`, for scales with the
        logarithms `eta` (scales,).
        """
        return self.with_slopes(eta, at)[0]

    def with_slopes(self, eta: np.ndarray, at: int) -> tuple[np.ndarray, dict[int, np.ndarray]]:
        """Return the covariance (m, m) of the errors in the block with index `at`, and its derivatives by the
        logarithms of the scales.

        The derivatives are a dictionary: the key is the index of the scale in `eta` (scales,), the value an array (m,
        m). Scales that do not act on this block are not included.
        """
        # Every scale except the correlation length enters as its square, so the derivative by its logarithm is twice
        # its summand.
        total, slopes = np.zeros((len(self.samples.blocks[at]),) * 2), {}
        for component in self._components[at]:
            part = math.exp(2.0 * eta[component.scale]) * component.matrix
            total += part
            slopes[component.scale] = 2.0 * part
        if self.discrepancy is not Discrepancy.NONE:
            smooth = self.smooth_part(eta, at)
            total += smooth
            slopes[self.scales.index(self._smooth_scale(at))] = 2.0 * smooth
            # The correlation length is always the last scale: d exp(-D / 2 l^2) / d ln l = exp(-D / 2 l^2) D / l^2.
            slopes[len(self.scales) - 1] = smooth * self.samples.distances[at] / math.exp(eta[-1]) ** 2
        return total, slopes

    def smooth_part(self, eta: np.ndarray, at: int) -> np.ndarray:
        """Return the contribution of the discrepancy to the covariance (m, m) of the errors in the block with index
        `at`; zeros if the model has no discrepancy.
        """
        added = self._added_of(at)
        return self._smooth(eta, at, (added, added), self.samples.distances[at])

    def smooth_between(self, eta: np.ndarray, at: int, first: Settings, second: Settings) -> np.ndarray:
        """Return the covariance (m, k) of the discrepancy between m samples and k other samples of the block with index
        `at`.

        `first` and `second` are the settings of these samples. The covariance serves to predict the discrepancy of a
        measurement that has not been made yet.
        """
        # Squared distances between the inputs of the two groups of samples.
        distances = ((first.inputs[:, None] - second.inputs[None]) ** 2).sum(axis=-1)
        return self._smooth(eta, at, (first.added, second.added), distances)

    def settings_of(self, at: int, inputs: np.ndarray) -> Settings:
        """Return the settings (inputs and contributions of the causes) of the samples in the block with index `at`.

        `inputs` (n, inputs) are the set values of all n samples, divided by their range.
        """
        return Settings(inputs[self.samples.blocks[at]], self._added_of(at))

    def _smooth_scale(self, at: int) -> tuple[str, int]:
        """Return the letter and the block index of the scale that gives the size of the discrepancy in the block with
        index `at`.

        This is "a" with index `at` for a smooth discrepancy. For an error of form it is "e" with index -1, because all
        blocks share this scale.
        """
        return ("a", at) if self.discrepancy is Discrepancy.SMOOTH else ("e", -1)

    def _added_of(self, at: int) -> np.ndarray:
        """Return the contribution of each cause (causes, m) to the prediction of the m samples in the block with index
        `at`; without an error of form, the array has no rows.
        """
        block = self.samples.blocks[at]
        return np.array([row[block] for row in self.added]).reshape(-1, len(block))

    def _smooth(
        self, eta: np.ndarray, at: int, added: tuple[np.ndarray, np.ndarray], distances: np.ndarray
    ) -> np.ndarray:
        """Return the covariance (m, k) of the discrepancy between m samples and k other samples of the block with index
        `at`.

        `added` holds the contributions of the causes to both groups of samples, (causes, m) and (causes, k), and
        `distances` (m, k) the squared distances between their inputs.
        """
        if self.discrepancy is Discrepancy.NONE:
            return np.zeros(distances.shape)
        square = math.exp(2.0 * eta[self.scales.index(self._smooth_scale(at))])
        is_smooth = self.discrepancy is Discrepancy.SMOOTH
        # A smooth discrepancy scales with the signal of the channel, an error of form with the contributions of the
        # causes.
        amplitude = self.samples.spread[at] ** 2 if is_smooth else added[0].T @ added[1]
        return np.asarray(square * amplitude * np.exp(-0.5 * distances / math.exp(eta[-1]) ** 2))

    @cached_property
    def _components(self) -> tuple[tuple[VarianceComponent, ...], ...]:
        """Terms of each block's covariance for noise (scale s), an error that a fold shares (t) and drift (d).

        Their matrices do not depend on eta, so that they are computed only once for the whole search for eta.
        """
        components = []
        for at, block in enumerate(self.samples.blocks):
            noise, fold = self.samples.noise[at], self.samples.fold[block]
            inflation = 1.0 if self.inflation is None else self.inflation[block]
            # Only the terms whose scale is active in this model are kept below.
            matrices = {"s": np.diag(self.samples.sd[block] ** 2 * inflation)}
            matrices["t"] = noise**2 * (fold[:, None] == fold[None])
            if self.samples.turn is not None:
                turn = self.samples.turn[block]
                memory = DRIFT_MEMORY * max(float(np.ptp(self.samples.turn)), 1.0)
                matrices["d"] = noise**2 * np.exp(-np.abs(turn[:, None] - turn[None]) / memory)
            components.append(
                tuple(
                    VarianceComponent(self.scales.index((letter, at)), matrix)
                    for letter, matrix in matrices.items()
                    if (letter, at) in self.scales
                )
            )
        return tuple(components)
