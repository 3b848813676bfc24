"""Curves as rivals of the whole: where one predicts what was left out better, the model does not describe the data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.stats import t as student

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import LOSES, ChannelScore, losses
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.wording import format_value

Side = Literal["before", "after"]
FEWEST = 2
"""Folds from which they scatter at all."""


def error_ratio(scores: Sequence[ChannelScore], curve: Sequence[Baseline], side: Side = "after") -> tuple[float, float]:
    """Return a curve's held-out error over the model's, geometric mean over channels and folds, and its 95 % bound.

    An error below the noise counts as the noise: nothing predicts better than that. The upper bound is by Student's t
    of what folds scatter. NaN where a fold is lost, or they are fewer than FEWEST.
    """
    by_fold = {baseline.channel: baseline.by_fold for baseline in curve}
    rows = [
        [
            math.log(max(error, score.floor) / max(getattr(level, side), score.floor))
            for error, level in zip(by_fold.get(score.name, ()), score.levels, strict=False)
        ]
        for score in scores
    ]
    if min(map(len, rows), default=0) < FEWEST or any(score.lost for score in scores):
        return math.nan, math.nan
    table = np.array(rows)
    folds = np.nanmean(table, axis=0)[np.isfinite(table).any(axis=0)]
    reach = float(student.ppf(0.975, len(folds) - 1) * np.std(folds, ddof=1) / math.sqrt(len(folds)))
    return math.exp(folds.mean()), math.exp(folds.mean() + reach)


def _words(baseline: Baseline) -> str:
    return f"a {baseline.curve} of {baseline.given}"


def _errors(scores: Sequence[ChannelScore], curve: Sequence[Baseline]) -> str:
    """Return, in words, a curve's held-out errors against those of the model that is kept."""
    kept = {score.name: score.after for score in scores}
    pairs = [(row, format_value(kept[row.channel], row.unit)) for row in curve]
    return ", ".join(f"{row.channel} {format_value(row.error, row.unit)} against {error}" for row, error in pairs)


def against_rivals(verdict: Verdict, baselines: Sequence[Baseline], to_beat: bool = False) -> Verdict:
    """Return a verdict beside its rivals: one that predicts better, beyond what folds scatter, is said first.

    Of one that is `to_beat`, what a user has already, it is enough that it predicts better than the base model and not
    worse than what is kept. Channels that no curve predicts do not count.
    """
    scores = [score for score in verdict.scores if score.name in {baseline.channel for baseline in baselines}]
    curves = {words: [row for row in baselines if _words(row) == words] for words in map(_words, baselines)}
    ratios = {words: error_ratio(scores, curve)[0] for words, curve in curves.items()}
    ahead = [words for words, curve in curves.items() if _is_better(scores, curve, "after")]
    if to_beat:
        ahead += [words for words, curve in curves.items() if ratios[words] < 1 and _is_better(scores, curve, "before")]
    beside = replace(verdict, baselines=tuple(baselines), cautions=(*verdict.cautions, *losses(scores, baselines)))
    if not ahead:
        return beside
    words = min(ahead, key=lambda name: ratios[name])
    errors = _errors(scores, curves[words])
    first = f"{words} predicts what was left out with {ratios[words]:.2f} times this model's errors ({errors})"
    answer = verdict.answer if verdict.answer is Answer.NONE_FITS else Answer.INADEQUATE
    return replace(beside, answer=answer, rival=first, sentence=f"{first[0].upper()}{first[1:]}. {verdict.sentence}")


def _is_better(scores: Sequence[ChannelScore], curve: Sequence[Baseline], side: Side) -> bool:
    """Return whether a curve predicts better, beyond what folds scatter, than the model before or after."""
    ratio, high = error_ratio(scores, curve, side)
    return ratio < LOSES and high < 1.0
