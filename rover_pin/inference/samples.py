"""All compared values of an experiment as one vector, with the properties on which the covariance of their errors
depends.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.experiment import Experiment

MIN_INPUT_RANGE = 1e-9
"""Minimum range of an input (a set value such as slip or load) that varies. With a smaller range, the input counts as
constant. A constant input is not used, because nothing can be learnt as a function of it. The value is far above
rounding and far below every change of a setting that a user makes on purpose."""


@brief
@dataclass(frozen=True, eq=False)
class Samples:
    """All n compared values of an experiment, channel after channel, with the properties that determine the covariance
    of their errors.

    A fold is a group of samples that cross-validation holds out together, such as a run. A campaign is a group of folds
    that were measured with one set-up. A block contains the samples of one channel in one campaign.
    """

    value: np.ndarray
    """measured value of each sample (n,), in the unit of its channel"""
    sd: np.ndarray
    """declared SD of the noise of each sample (n,)"""
    fold: np.ndarray
    """index of the fold of each sample (n,)"""
    inputs: np.ndarray
    """set values at each sample (n, inputs), each divided by its range"""
    turn: np.ndarray | None
    """position of each sample in the order of measurement (n,); None if it is not known"""
    blocks: tuple[np.ndarray, ...] = field(repr=False)
    """indices of the samples of each block (one channel in one campaign)"""
    channel: np.ndarray = field(repr=False)
    """index of the channel of each sample (n,)"""
    good: np.ndarray = field(repr=False)
    """mask of the compared samples (channels, folds, samples)"""

    def row_of(self, table: np.ndarray) -> np.ndarray:
        """Return the compared samples of a table (..., folds, channels, samples) as a vector (..., n), in the order of
        this object.
        """
        return np.asarray(np.swapaxes(table, -3, -2)[..., self.good])

    def table_of(self, row: np.ndarray) -> np.ndarray:
        """Return a vector (n,) of compared samples as a table (folds, channels, samples), with NaN for samples that are
        not compared.
        """
        table = np.full(self.good.shape, np.nan)
        table[self.good] = row
        return np.swapaxes(table, 0, 1)

    @property
    def repeats(self) -> bool:
        """Whether at least one fold has several samples of a channel. An error that all samples of a fold share can be
        distinguished from the noise of single samples only then.
        """
        return len(self.value) > sum(len(np.unique(self.fold[block])) for block in self.blocks)

    @cached_property
    def noise(self) -> np.ndarray:
        """RMS of the declared noise SDs in each block (blocks,), in the unit of the block's channel."""
        return np.array([np.sqrt(np.mean(self.sd[block] ** 2)) for block in self.blocks])

    @cached_property
    def spread(self) -> np.ndarray:
        """SD of the measured values in each block (blocks,), raised to at least the noise of the block. The prior size
        of a smooth discrepancy is proportional to this SD.
        """
        return np.maximum([self.value[block].std() for block in self.blocks], self.noise)

    @cached_property
    def distances(self) -> tuple[np.ndarray, ...]:
        """Squared distances (m, m) between the scaled inputs of the m samples of each block."""
        rows = [self.inputs[block] for block in self.blocks]
        return tuple(((x[:, None] - x[None]) ** 2).sum(axis=-1) for x in rows)


def samples_of(experiment: Experiment, sd: np.ndarray, inputs: np.ndarray) -> Samples:
    """Return all compared samples of an experiment as vectors; measured values that are NaN are omitted.

    Parameters
    ----------
    experiment : Experiment
        Measured values, folds and campaigns.
    sd : array (folds, channels, samples), or one that broadcasts to it
        Declared SD of the noise.
    inputs : array (folds, samples, inputs)
        Set values at each sample, such as slip; a discrepancy is assumed to be a smooth function of them.
    """
    observed = np.asarray(experiment.observed)
    # The channel becomes the first axis, so that the samples of a channel lie next to each other in the vectors.
    good = np.swapaxes(np.isfinite(observed), 0, 1)
    place = np.broadcast_to(np.arange(observed.shape[0])[:, None, None], observed.shape)
    spread_inputs = np.broadcast_to(np.moveaxis(inputs, 2, 0)[:, :, None], (inputs.shape[2], *observed.shape))
    rows = np.swapaxes(spread_inputs, 1, 2)[:, good]
    # All tables are flattened with the same mask, so that entry i of every vector belongs to the same sample.
    turns = experiment.turns()
    order = None if turns is None else np.swapaxes(np.broadcast_to(turns[:, None], observed.shape), 0, 1)[good]
    channel = np.broadcast_to(np.arange(observed.shape[1])[:, None, None], good.shape)[good]
    fold, campaign = np.swapaxes(place, 0, 1)[good], experiment.campaigns
    return Samples(
        np.swapaxes(observed, 0, 1)[good],
        np.swapaxes(sd, 0, 1)[good],
        fold,
        scale_inputs(rows.T, rows.T)[0],
        order,
        tuple(
            np.flatnonzero((channel == at) & (campaign[fold] == of))
            for of in np.unique(campaign)
            for at in np.unique(channel[campaign[fold] == of])
        ),
        channel,
        good,
    )


def scale_inputs(inputs: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the set values `inputs` (n, inputs) and `others` (m, inputs) on a common scale, so that one correlation
    length suits all of them.

    Both are shifted and divided by the range of `inputs`, so that `inputs` lie between 0 and 1. An input that is
    constant in `inputs` but not in `others` is divided by the range of both together. An input that is constant in both
    is omitted.
    """
    both = np.concatenate([inputs, others])
    # An input that is new in `others` still needs a range; it is taken from both together.
    ranges = np.where(np.ptp(inputs, axis=0) > MIN_INPUT_RANGE, np.ptp(inputs, axis=0), np.ptp(both, axis=0))
    varied = ranges > MIN_INPUT_RANGE
    scaled = (both[:, varied] - inputs[:, varied].min(axis=0)) / ranges[varied]
    return scaled[: len(inputs)], scaled[len(inputs) :]
