"""The compared samples of an experiment in one row, with all that says how their errors hang together."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rover_pin.base.public import brief
from rover_pin.estimation.experiment import Experiment

SAME_INPUT = 1e-9
"""Range below which an input is the same everywhere, so that nothing can be a function of it."""


@brief
@dataclass(frozen=True, eq=False)
class Samples:
    """What was measured, channel after channel: value, SD, fold, turn and scaled inputs of each sample (n, ...)."""

    value: np.ndarray
    sd: np.ndarray
    fold: np.ndarray
    inputs: np.ndarray
    "what was set (n, inputs), each over its range"
    turn: np.ndarray | None
    "at which turn each was measured; None where that is not known"
    blocks: tuple[np.ndarray, ...] = field(repr=False)
    "where the samples of each channel of each campaign stand in the row"
    channel: np.ndarray = field(repr=False)
    "of each sample (n,)"
    good: np.ndarray = field(repr=False)
    "which samples (channels, folds, samples) are compared"

    def row_of(self, table: np.ndarray) -> np.ndarray:
        """Return a table (..., folds, channels, samples) as rows (..., n)."""
        return np.asarray(np.swapaxes(table, -3, -2)[..., self.good])

    def table_of(self, row: np.ndarray) -> np.ndarray:
        """Return a row (n,) as a table (folds, channels, samples), NaN where nothing is compared."""
        table = np.full(self.good.shape, np.nan)
        table[self.good] = row
        return np.swapaxes(table, 0, 1)

    @property
    def repeats(self) -> bool:
        """Whether folds have several samples of a channel, so that what they share shows."""
        return len(self.value) > sum(len(np.unique(self.fold[block])) for block in self.blocks)

    @cached_property
    def noise(self) -> np.ndarray:
        """RMS of the declared SDs of each block (blocks,)."""
        return np.array([np.sqrt(np.mean(self.sd[block] ** 2)) for block in self.blocks])

    @cached_property
    def spread(self) -> np.ndarray:
        """SD of what was measured in each block (blocks,), no less than its noise."""
        return np.maximum([self.value[block].std() for block in self.blocks], self.noise)

    @cached_property
    def distances(self) -> tuple[np.ndarray, ...]:
        """The squared distances (m, m) of the inputs of each block's samples."""
        rows = [self.inputs[block] for block in self.blocks]
        return tuple(((x[:, None] - x[None]) ** 2).sum(axis=-1) for x in rows)


def samples_of(experiment: Experiment, sd: np.ndarray, inputs: np.ndarray) -> Samples:
    """Return the compared samples of an experiment, of declared `sd` (folds, channels, samples).

    `inputs` (folds, samples, inputs) are what was set.
    """
    observed = np.asarray(experiment.observed)
    good = np.swapaxes(np.isfinite(observed), 0, 1)
    place = np.broadcast_to(np.arange(observed.shape[0])[:, None, None], observed.shape)
    spread_inputs = np.broadcast_to(np.moveaxis(inputs, 2, 0)[:, :, None], (inputs.shape[2], *observed.shape))
    rows = np.swapaxes(spread_inputs, 1, 2)[:, good]
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
    """Return inputs (n, inputs), each over its range, and others (m, inputs) over the same ranges.

    Those that only change from the ones to the others are over the range of both, those that never change left out.
    """
    both = np.concatenate([inputs, others])
    ranges = np.where(np.ptp(inputs, axis=0) > SAME_INPUT, np.ptp(inputs, axis=0), np.ptp(both, axis=0))
    varied = ranges > SAME_INPUT
    scaled = (both[:, varied] - inputs[:, varied].min(axis=0)) / ranges[varied]
    return scaled[: len(inputs)], scaled[len(inputs) :]
