"""How much an effect does: what the model predicts of the data with it, and with it alone set to nothing."""

from typing import Any, NamedTuple

import numpy as np

from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.report.words import Labels, brief

SMALL = 1.0
"""SDs of its noise below which what an effect does to a channel is not worth a word."""
MAX_DESCRIBED_CHANNELS = 3
"""Channels that are said."""


class Size(NamedTuple):
    """What an effect does to one channel where it does most [the channel's unit]."""

    channel: str
    unit: str
    fold: str
    with_it: float
    without: float
    in_noise: float

    def describe(self, labels: Labels) -> str:
        """One clause for a reader."""
        by = abs(self.with_it - self.without)
        share = f", {by / abs(self.without):.0%}" if abs(self.without) > by else ""
        more = "more" if self.with_it > self.without else "less"
        return (
            f"{labels.channel(self.channel)} is {brief(self.with_it, self.unit)} instead of "
            f"{brief(self.without, self.unit)}, {brief(by, self.unit)} {more}{share}, at {labels.fold(self.fold)}"
        )


def without(experiment: Experiment, model: Any, owner: str) -> Any:
    """Return the model with one of its effects at its neutral values."""
    effect = experiment.records(model)[owner]
    return experiment.replaced(model, owner, effect.replace(**effect.neutral))


def channel_changes(fitted: Fit, owner: str) -> list[Size]:
    """Return what an effect of a fitted model does to each channel, the most in SDs of its noise first."""
    experiment = fitted.task.experiment
    bare = without(experiment, fitted.model, owner)
    predicted = experiment.predict([fitted.model, bare])
    difference = np.where(np.isfinite(experiment.observed), predicted[0] - predicted[1], 0.0)
    changes = []
    for at, channel in enumerate(experiment.channels):
        noise = max(float(fitted.task.noise.floor[at]), 1e-300)
        fold, sample = np.unravel_index(int(np.argmax(np.abs(difference[:, at]))), difference[:, at].shape)
        with_it, bare_value = (float(side[fold, at, sample]) for side in predicted)
        by = abs(with_it - bare_value) / noise
        changes.append(Size(channel, experiment.unit(channel), experiment.folds[fold], with_it, bare_value, by))
    return sorted(changes, key=lambda size: -size.in_noise)


def practical(fitted: Fit, owner: str, labels: Labels) -> str:
    """Return in one sentence what an effect does to the channels where it does most; empty where to none."""
    clauses = [
        size.describe(labels)
        for size in channel_changes(fitted, owner)[:MAX_DESCRIBED_CHANNELS]
        if size.in_noise >= SMALL
    ]
    return f"With it {'; '.join(clauses)}." if clauses else ""
