"""Held-out errors: every fold is predicted by a fit to all other folds, and the error of this prediction is reported.

A fold is a group of samples that cross-validation holds out together, such as a run or all samples with one slip. A
sample is a measured value of one channel that is compared with the prediction; in a drive log each sample is the mean
over a short time. "Before" and "after" mean: without and with the causes that the search for missing effects added to
the model.
"""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.base.public import brief
from rover_pin.estimation.fit import STRETCH_BLOCKS, Fit, fit
from rover_pin.estimation.least_squares import Task
from rover_pin.estimation.noise import Noise, rms_of
from rover_pin.estimation.profile import CONFIDENCE
from rover_pin.estimation.residual import huber, huber_losses
from rover_pin.estimation.wording import Change, format_value

BOOTSTRAP_DRAWS = 2000
"""Number of resampled data sets in the bootstrap of an interval. With 2000, the ends of a 95 % interval vary by about
0.06 SD from seed to seed; more would only cost time."""
MAX_DRAWN_STRETCHES = 2_000_000
"""Maximum number of stretches that the bootstrap draws at once; they take 50 MB of memory."""
REFIT_SIZE_SD = 3.0
"""Prior SD of an effect's size in the fit without one fold, in default sizes; the prior has its mean at the size fitted
to all folds.

Without this prior, a size that the other folds hardly determine would grow without limit. Three default sizes are wide
enough not to affect a size that the other folds do determine."""


class LevelError(NamedTuple):
    """RMS error of one channel in one held-out fold, before and after causes were added to the model, in the channel's
    unit.

    `level` is the name of the fold (group of samples left out together).
    """

    level: str
    before: float
    after: float


@brief
class ChannelScore(NamedTuple):
    """Held-out RMS error of one channel, before and after causes were added to the model, in the channel's unit, with
    the 95 % interval of the relative change.
    """

    name: str
    unit: str
    floor: float
    """RMS of the noise in the unit of the channel: the smallest error that a model can reach"""
    before: float
    after: float
    change: float
    """relative change of the error by the added causes: after / before - 1; negative if the error decreases"""
    low: float
    """lower end of the 95 % interval of the change"""
    high: float
    """upper end of the 95 % interval of the change. The bootstrap for this interval resamples whole folds, or stretches
    of successive samples of runs"""
    levels: tuple[LevelError, ...] = ()
    """error of this channel in every fold"""
    of: str = "runs"
    """name of the groups of samples that the bootstrap resamples: "runs" for stretches of runs, "folds" for
    whole folds"""
    lost: tuple[str, ...] = ()
    """names of the folds that a fit to the other folds cannot predict, before or after causes were added; the errors of
    these folds and of the channel are NaN"""
    joint_low: float = math.nan
    """lower end of the interval of the change if the intervals of all channels together have a confidence of 95 %
    (Bonferroni's bound): above 0, the channel is worse although many channels were compared"""

    @property
    def worded(self) -> Change:
        """The change of the error, with its claim in words."""
        return Change(self.before, self.after, self.low, self.high, self.floor, self.of)

    @property
    def claim(self) -> str:
        """The claim that the errors support, in words, for example "better" or "not compared"."""
        if self.lost:
            return f"{', '.join(self.lost)} left out is not predicted: not compared"
        return self.worded.claim

    @property
    def line(self) -> str:
        """The errors as one line of a report. If nothing was added to the model, the line states only one error."""
        change, noise = self.worded, f"noise {format_value(self.floor, self.unit)}"
        before = format_value(self.before, self.unit)
        if change.none:
            return f"held-out {self.name}: RMSE {before}, {noise}"
        after = format_value(self.after, self.unit, self.before)
        return f"held-out {self.name}: RMSE {before} -> {after} ({change.text}, {noise}): {self.claim}"

    def times(self, error: float) -> float:
        """Return an error of this channel as a multiple of its noise."""
        return error / max(self.floor, 1e-300)

    def as_dict(self) -> dict[str, Any]:
        """Return the score as plain values for verdict.json."""
        return self._asdict() | {"said": self.claim, "levels": [level_error._asdict() for level_error in self.levels]}


class RunScore(NamedTuple):
    """Held-out error of one fold (such as a run) for all channels together, before and after causes were added to the
    model.

    The error is the robust chi2 divided by the number of compared values; 1 means that the residual is as large as the
    noise.
    """

    run: str
    blocks: int
    """number of compared values"""
    before: float
    after: float
    low: float
    """lower end of the 95 % interval of the relative change, after / before - 1"""
    high: float
    """upper end of the 95 % interval of the change. The bootstrap for this interval resamples stretches of successive
    samples of the fold"""

    @property
    def worded(self) -> Change:
        """The change of the error, with its claim in words."""
        return Change(self.before, self.after, self.low, self.high, 1.0, "stretches")


class HeldOut(NamedTuple):
    """Held-out errors before and after causes were added to the model, by channel and by fold."""

    channels: tuple[ChannelScore, ...]
    runs: tuple[RunScore, ...]


def held_out(before: Fit, after: Fit, noise: Noise, seed: int) -> HeldOut:
    """Return the held-out errors of two fits, by channel and by fold, with bootstrap intervals of the change.

    Parameters
    ----------
    before, after : Fit
        Fits of the base model and of the kept model.
    noise : Noise
        Noise that weights the residuals and that the errors are compared with. The refits without one fold use the
        noises of the two fits instead, which may be larger.
    seed : int
        Seed of the random numbers for the bootstrap.
    """
    # If nothing was added, both sides are the same fit, which is refitted only once.
    first = held_out_residual(before)
    pair = (first, first if after is before else held_out_residual(after))
    random = np.random.default_rng(seed)
    experiment = after.task.experiment
    good, scores, floor = noise.good, [], noise.lower_bound(experiment.floor())
    resampled = "runs" if experiment.is_timed else "folds"
    for row, name in enumerate(experiment.channels):
        squares = [np.where(good, residual, 0.0)[:, row] ** 2 for residual in pair]
        # Neighbouring samples in time are correlated, so timed runs are resampled in stretches of samples. Folds
        # without an order in time are resampled as a whole.
        has_data = np.full(len(good), True) if experiment.is_timed else good[:, row].any(axis=1)
        measured = [side_squares[has_data] for side_squares in squares]
        sums = [_stretch_sums(side).ravel() if experiment.is_timed else side.sum(axis=1) for side in measured]
        # Power 0.5: sums of squares become the ratio of RMS errors.
        low, high, joint_low = _change_interval(np.array(sums), 0.5, random, len(experiment.channels))
        was, now = (float(np.sqrt(side_squares.sum() / max(int(good[:, row].sum()), 1))) for side_squares in squares)
        # A fold without this channel has no error (NaN), not an error of 0.
        count = good[:, row].sum(axis=1)
        presence = np.where(count > 0, 1.0, np.nan)
        errors = [presence * np.sqrt(side_squares.sum(axis=1) / np.maximum(count, 1)) for side_squares in squares]
        rows = zip(experiment.folds, *(side_errors.tolist() for side_errors in errors), strict=True)
        levels = tuple(LevelError(*row) for row in rows)
        # A fold without a prediction makes the error of the whole channel NaN; the report names the fold.
        gone = np.isnan(np.array(squares)).any(axis=(0, 2))
        lost = tuple(fold for fold, is_gone in zip(experiment.folds, gone, strict=True) if is_gone)
        unit, change = experiment.unit(name), now / max(was, 1e-300) - 1
        interval = change, low, high
        scores.append(
            ChannelScore(name, unit, float(floor[row]), was, now, *interval, levels, resampled, lost, joint_low)
        )
    # The error of a fold adds the losses of whitened residuals, so that all channels of the fold can be added.
    losses = np.zeros((2, *noise.good.shape))
    for side, residual in enumerate(pair):
        losses[side][noise.good] = huber_losses(noise.white(residual))
    run_scores = []
    for fold, run in enumerate(experiment.folds):
        count = max(int(noise.good[fold].sum()), 1)
        sums = losses[:, fold].sum(axis=1)
        # Power 1: the error of a run is a chi2 already, not an RMS.
        low, high, _ = _change_interval(_stretch_sums(sums), 1.0, random)
        was, now = (float(total) / count for total in sums.sum(axis=1))
        run_scores.append(RunScore(run, count, was, now, low, high))
    return HeldOut(tuple(scores), tuple(run_scores))


def _change_interval(
    sums: np.ndarray, power: float, random: np.random.Generator, comparisons: int = 1
) -> tuple[float, float, float]:
    """Return the 95 % interval of the relative change (after / before)^power - 1, by a bootstrap that resamples
    stretches, and the lower end of the wider interval for several `comparisons` of which all hold with 95 %.

    `sums` (2, stretches) are the sums of the squared residuals of each stretch before and after causes were added. Both
    rows are resampled together, so that the errors are compared on common stretches.
    """
    # The same stretches are drawn for both sides, so that their common scatter cancels in the ratio. A long run has
    # thousands of stretches, so that only some of the resampled data sets are held in memory at once.
    count, totals = max(MAX_DRAWN_STRETCHES // sums.shape[1], 1), []
    for first in range(0, BOOTSTRAP_DRAWS, count):
        draws = random.integers(0, sums.shape[1], (min(count, BOOTSTRAP_DRAWS - first), sums.shape[1]))
        totals.append(sums[:, draws].sum(axis=2))
    before, after = np.concatenate(totals, axis=1)
    # Bonferroni's bound: the probability of an error is divided by the number of comparisons.
    tail = 0.5 - 0.5 * CONFIDENCE
    changes = (after / np.maximum(before, 1e-300)) ** power - 1
    low, high, joint_low = np.quantile(changes, [tail, 1.0 - tail, tail / comparisons])
    return float(low), float(high), float(joint_low)


def _stretch_sums(values: np.ndarray) -> np.ndarray:
    """Return the sums of `values` over stretches of STRETCH_BLOCKS successive samples along the last axis."""
    return np.add.reduceat(values, np.arange(0, values.shape[-1], STRETCH_BLOCKS), axis=-1)


def lost_folds(scores: Sequence[ChannelScore], reason: str) -> tuple[str, ...]:
    """Return one sentence for each fold that cannot be predicted by a fit to the other folds; `reason` states in words
    why the prediction fails.
    """
    lost = dict.fromkeys(name for score in scores for name in score.lost)
    return tuple(f"{name} left out is not predicted by the others: {reason}; no error is averaged" for name in lost)


def taken_share(scores: Sequence[ChannelScore]) -> float:
    """Return the fraction of the base model's held-out error that the added causes remove, from 0 to 1.

    The error is the mean square above the noise, summed over all channels in units of each channel's noise variance.
    The fraction is 0 if at least one fold is not predicted, or if no channel has an error above the noise.
    """
    # Errors below the noise count as 0, so that noise alone cannot be "removed".
    before, after = (
        sum(max(score.times(error) ** 2 - 1.0, 0.0) for score, error in zip(scores, errors, strict=True))
        for errors in ([score.before for score in scores], [score.after for score in scores])
    )
    if not math.isfinite(before + after) or before <= 0.0:
        return 0.0
    return min(max(1.0 - after / before, 0.0), 1.0)


def together(runs: Sequence[RunScore]) -> tuple[float, float]:
    """Return the held-out robust chi2 of all folds together, divided by the number of compared values: before and after
    causes were added to the model.
    """
    blocks = np.array([run_score.blocks for run_score in runs])
    before, after = (
        float(blocks @ [run_score[column] for run_score in runs]) / max(int(blocks.sum()), 1) for column in (2, 3)
    )
    return before, after


def fold_errors(fitted: Fit) -> dict[str, float]:
    """Return a mapping from the name of each channel to its held-out RMSE, in the channel's unit.

    Each fold (group of samples left out together) is predicted by a refit of `fitted` to the other folds.
    """
    rms = rms_of(held_out_residual(fitted), fitted.task.noise.good)
    return dict(zip(fitted.task.experiment.channels, rms.tolist(), strict=True))


def fall_of(before: np.ndarray, after: np.ndarray) -> float:
    """Return the decrease of the held-out chi2 from a first model (`before`) to a second model (`after`), summed over
    folds.

    `before` and `after` (folds,) hold the chi2 of each held-out fold. Only folds that the first model predicts count.
    The result is NaN if the second model does not predict one of these folds, because the remaining folds alone would
    not be a fair comparison.
    """
    return float((before - after)[~np.isnan(before)].sum())


def losses_of(fitted: Fit) -> np.ndarray:
    """Return the robust chi2 of every held-out fold (folds,), each predicted by a refit to the other folds; NaN for a
    fold that cannot be predicted.
    """
    rows, owner = fitted.task.noise.white(held_out_residual(fitted)), fitted.task.noise.fold
    return np.array([huber(rows[owner == fold]) for fold in range(len(fitted.predicted))])


def held_out_residual(fitted: Fit) -> np.ndarray:
    """Return the held-out residual (folds, channels, samples): each fold minus its prediction by a refit to the other
    folds.

    It is NaN for a fold whose refit does not converge.
    """
    # Each fold takes its residual from the refit that did not use it.
    residual = fitted.residual.copy()
    for fold, fold_fit in enumerate(fold_fits(fitted)):
        residual[fold] = np.nan if fold_fit is None else fold_fit.missed[fold]
    return residual


def fold_fits(fitted: Fit) -> Iterator[Fit | None]:
    """Yield for each fold a refit to all other folds, or None if this refit does not converge.

    The refits start from the fit to all folds and reuse its derivatives of the prediction by the parameters. A fold
    without data needs no refit and yields the fit to all folds.
    """
    noise = fitted.task.noise
    parameters, start, slopes = [], [], {}
    for parameter, u in zip(fitted.parameters, fitted.u, strict=True):
        slope = fitted.slopes[parameter.name]
        if parameter.prior:
            parameters.append(parameter)
            start.append(u)
            slopes[parameter.name] = slope
        else:
            # The size of an effect has no prior, so it gets a weak one around its value in the whole fit.
            scale = REFIT_SIZE_SD * parameter.scale
            parameters.append(dataclasses.replace(parameter, origin=parameter.value(u), scale=scale, prior=True))
            start.append(0.0)
            slopes[parameter.name] = slope * REFIT_SIZE_SD
    for fold in range(len(fitted.predicted)):
        if not noise.good[fold].any():
            yield fitted
            continue
        good = noise.good.copy()
        good[fold] = False
        task = Task(fitted.task.experiment, dataclasses.replace(noise, good=good))
        try:
            yield fit(task, fitted.model, tuple(parameters), np.array(start), slopes, reuse=True)
        except OptimisationError:
            yield None
