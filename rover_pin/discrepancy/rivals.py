"""Curves as rivals of the whole: where one predicts what was left out better, the model does not describe the data."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import LOSES, ChannelScore, losses
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.wording import format_value

FEWEST = 2
"""Folds from which they scatter at all."""


def error_ratio(scores: Sequence[ChannelScore], curve: Sequence[Baseline]) -> tuple[float, float]:
    """Return a curve's held-out error over the model's, geometric mean over channels and folds, and its 95 % bound.

    An error below the noise counts as the noise: nothing predicts better than that. The upper bound is by Student's t
    of what folds scatter. NaN where a fold is lost, or they are fewer than FEWEST.
    """
    by_fold = {baseline.channel: baseline.by_fold for baseline in curve}
    rows = [
        [
            math.log(max(error, score.floor) / max(level.after, score.floor))
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


def _errors(scores: Sequence[ChannelScore], baselines: Sequence[Baseline]) -> Iterator[tuple[str, str]]:
    """Yield each curve and, in words, its held-out error against the model's in a channel."""
    of_model = {score.name: score.after for score in scores}
    for row in (baseline for baseline in baselines if baseline.channel in of_model):
        error, reference = format_value(row.error, row.unit), format_value(of_model[row.channel], row.unit)
        yield _words(row), f"{row.channel} {error} against {reference}"


def against_rivals(verdict: Verdict, baselines: Sequence[Baseline]) -> Verdict:
    """Return a verdict beside its rivals: one that predicts better, beyond what folds scatter, is said first.

    Channels that no curve predicts do not count.
    """
    scores = [score for score in verdict.scores if score.name in {baseline.channel for baseline in baselines}]
    ratios = {
        words: error_ratio(scores, [row for row in baselines if _words(row) == words])
        for words in dict.fromkeys(map(_words, baselines))
    }
    better = {words: ratio for words, (ratio, high) in ratios.items() if ratio < LOSES and high < 1.0}
    beside = replace(verdict, baselines=tuple(baselines), cautions=(*verdict.cautions, *losses(scores, baselines)))
    if not better:
        return beside
    words = min(better, key=lambda name: better[name])
    errors_text = ", ".join(errors for curve, errors in _errors(scores, baselines) if curve == words)
    first = f"{words} predicts what was left out with {better[words]:.2f} times this model's errors ({errors_text})"
    return with_rival(beside, first)


def with_rival(verdict: Verdict, first: str) -> Verdict:
    """Return a verdict that says first which rival predicts better: the base model does not describe the data."""
    answer = verdict.answer if verdict.answer is Answer.NONE_FITS else Answer.INADEQUATE
    return replace(verdict, answer=answer, rival=first, sentence=f"{first[0].upper()}{first[1:]}. {verdict.sentence}")
