"""Errors on data that were not fitted: every fold predicted from the others."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.public import brief
from rover_pin.discrepancy.fold_refits import held_out_residual
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import STRETCH, Fit
from rover_pin.estimation.noise import Noise, huber_losses, rms_of
from rover_pin.estimation.profile import SURE
from rover_pin.estimation.wording import Change

DRAWS = 2000
"""Resamplings of the bootstrap."""


class LevelError(NamedTuple):
    """The RMS error of one channel on one held-out level, in the channel's unit."""

    level: str
    before: float
    after: float


@brief
class ChannelScore(NamedTuple):
    """The held-out error of one channel before and after, in the channel's unit."""

    name: str
    unit: str
    floor: float
    "RMS of the noise: what no model can beat"
    before: float
    after: float
    change: float
    "after / before - 1"
    low: float
    high: float
    "ends of the 95 % interval of the change, levels or stretches of runs resampled"
    levels: tuple[LevelError, ...] = ()
    "of every fold"
    of: str = "runs"
    "what is resampled: runs, or stretches of them, or whole folds"
    lost: tuple[str, ...] = ()
    "folds that the fit to the others does not predict, before or after: errors there, and of the channel, are NaN"

    @property
    def worded(self) -> Change:
        """The change in words."""
        return Change(self.before, self.after, self.low, self.high, self.floor, self.of)

    @property
    def claim(self) -> str:
        """What may be claimed."""
        if self.lost:
            return f"{', '.join(self.lost)} left out is not predicted: not compared"
        return self.worded.claim

    def times(self, error: float) -> float:
        """Return an error of this channel in times its noise."""
        return error / max(self.floor, 1e-300)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return self._asdict() | {"said": self.claim, "levels": [level_error._asdict() for level_error in self.levels]}


def lost_folds(scores: Sequence[ChannelScore], why: str) -> tuple[str, ...]:
    """Return which folds no fit to the others predicts, one sentence each."""
    lost = dict.fromkeys(name for score in scores for name in score.lost)
    return tuple(f"{name} left out is not predicted by the others: {why}; no error is averaged" for name in lost)


def taken_share(scores: Sequence[ChannelScore]) -> float:
    """Return the share of held-out squares beyond the noise, in its variance, that is gone; 0 if one is lost."""
    before, after = (
        sum(max(score.times(error) ** 2 - 1.0, 0.0) for score, error in zip(scores, errors, strict=True))
        for errors in ([score.before for score in scores], [score.after for score in scores])
    )
    if not math.isfinite(before + after) or before <= 0.0:
        return 0.0
    return min(max(1.0 - after / before, 0.0), 1.0)


class RunScore(NamedTuple):
    """One run as the fits to the others predict it: robust chi2 a compared block, where 1 is the noise."""

    run: str
    blocks: int
    before: float
    after: float
    low: float
    high: float
    "ends of the 95 % interval of after / before - 1, stretches of the run resampled"

    @property
    def worded(self) -> Change:
        """The change in words."""
        return Change(self.before, self.after, self.low, self.high, 1.0, "stretches")


class HeldOut(NamedTuple):
    """Errors on runs that were not fitted, before and after: by channel and by run."""

    channels: tuple[ChannelScore, ...]
    runs: tuple[RunScore, ...]


def held_out(before: Fit, after: Fit, noise: Noise, seed: int) -> HeldOut:
    """Return the errors of every run as a fit to the others predicts it, with block bootstraps of the paired change.

    Runs are judged by `noise`; the fits descend in their own, which may be wider.
    """
    first = held_out_residual(before)
    pair = (first, first if after is before else held_out_residual(after))
    random = np.random.default_rng(seed)
    experiment = after.task.experiment
    return HeldOut(_by_channel(experiment, noise, pair, random), _by_run(experiment, noise, pair, random))


def together(runs: Sequence[RunScore]) -> tuple[float, float]:
    """Return chi2 a compared block of all runs, before and after."""
    blocks = np.array([run_score.blocks for run_score in runs])
    before, after = (float(blocks @ [run_score[at] for run_score in runs]) / max(int(blocks.sum()), 1) for at in (2, 3))
    return before, after


Pair = tuple[np.ndarray, np.ndarray]


def _by_channel(
    experiment: Experiment, noise: Noise, pair: Pair, random: np.random.Generator
) -> tuple[ChannelScore, ...]:
    good, scores, floor = noise.good, [], noise.lower_bound(experiment.floor())
    for row, name in enumerate(experiment.channels):
        squares = [np.where(good, residual, 0.0)[:, row] ** 2 for residual in pair]
        has_data = np.full(len(good), True) if experiment.is_timed else good[:, row].any(axis=1)
        measured = [side_squares[has_data] for side_squares in squares]
        sums = [_sum_stretches(side).ravel() if experiment.is_timed else side.sum(axis=1) for side in measured]
        low, high = _change(np.array(sums), 0.5, random)
        was, now = (float(np.sqrt(side_squares.sum() / max(int(good[:, row].sum()), 1))) for side_squares in squares)
        unit, change = experiment.unit(name), now / max(was, 1e-300) - 1
        levels, of = _levels(experiment, noise.good[:, row], squares), "runs" if experiment.is_timed else "folds"
        gone = np.isnan(np.array(squares)).any(axis=(0, 2))
        lost = tuple(name for name, is_gone in zip(experiment.folds, gone, strict=True) if is_gone)
        scores.append(ChannelScore(name, unit, float(floor[row]), was, now, change, low, high, levels, of, lost))
    return tuple(scores)


def fold_errors(fitted: Fit) -> dict[str, float]:
    """Return the RMSE of each channel, in its unit, every fold as the fits to the others predict it."""
    rms = rms_of(held_out_residual(fitted), fitted.task.noise.good)
    return dict(zip(fitted.task.experiment.channels, rms.tolist(), strict=True))


def _levels(experiment: Experiment, good: np.ndarray, squares: Sequence[np.ndarray]) -> tuple[LevelError, ...]:
    count = good.sum(axis=1)
    presence = np.where(count > 0, 1.0, np.nan)  # a fold without this channel has no error, not an error of 0
    errors = [
        (presence * np.sqrt(side_squares.sum(axis=1) / np.maximum(count, 1))).tolist() for side_squares in squares
    ]
    return tuple(LevelError(*row) for row in zip(experiment.folds, *errors, strict=True))


def _by_run(experiment: Experiment, noise: Noise, pair: Pair, random: np.random.Generator) -> tuple[RunScore, ...]:
    losses = np.zeros((2, *noise.good.shape))
    for side, residual in enumerate(pair):
        losses[side][noise.good] = huber_losses(noise.white(residual))
    scores = []
    for at, run in enumerate(experiment.folds):
        count = max(int(noise.good[at].sum()), 1)
        sums = losses[:, at].sum(axis=1)
        low, high = _change(_sum_stretches(sums), 1.0, random)
        was, now = (float(total) / count for total in sums.sum(axis=1))
        scores.append(RunScore(run, count, was, now, low, high))
    return tuple(scores)


def _change(sums: np.ndarray, power: float, random: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % interval of (after / before)^power - 1 of sums over stretches (2, stretches)."""
    draws = random.integers(0, sums.shape[1], (DRAWS, sums.shape[1]))
    before, after = sums[:, draws].sum(axis=2)
    low, high = np.quantile((after / np.maximum(before, 1e-300)) ** power - 1, [0.5 - 0.5 * SURE, 0.5 + 0.5 * SURE])
    return float(low), float(high)


def _sum_stretches(values: np.ndarray) -> np.ndarray:
    """Return sums over stretches of the last axis."""
    starts = range(0, values.shape[-1], STRETCH)
    return np.stack([values[..., start : start + STRETCH].sum(axis=-1) for start in starts], axis=-1)
