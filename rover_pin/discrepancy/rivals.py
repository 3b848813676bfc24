"""Curves as rivals of the whole: where one predicts what was left out better, the model does not describe the data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out import LOSES, ChannelScore, losses
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import Baseline


def error_ratio(scores: Sequence[ChannelScore], curve: Sequence[Baseline]) -> float:
    """Return the geometric mean over channels of a curve's held-out error over the model's; NaN where one is lost.

    An error below the noise counts as the noise: nothing predicts better than that.
    """
    errors = {baseline.channel: baseline.error for baseline in curve}
    logs = [
        math.log(max(errors[score.name], score.floor) / max(score.after, score.floor))
        for score in scores
        if score.name in errors and math.isfinite(score.after)
    ]
    return math.exp(sum(logs) / len(logs)) if len(logs) == len(scores) and logs else math.nan


def against_rivals(verdict: Verdict, baselines: Sequence[Baseline]) -> Verdict:
    """Return a verdict beside its rivals: one that predicts better over all channels is said first.

    Source: Draper and Smith, Applied Regression Analysis (1998), on lack of fit against a model that is free of form.
    """
    kinds = dict.fromkeys((baseline.curve, baseline.given) for baseline in baselines)
    ratios = {
        f"a {curve} of {given}": error_ratio(verdict.scores, [one for one in baselines if one.curve == curve])
        for curve, given in kinds
    }
    better = {words: ratio for words, ratio in ratios.items() if ratio < LOSES}
    beside = replace(
        verdict, baselines=tuple(baselines), cautions=(*verdict.cautions, *losses(verdict.scores, baselines))
    )
    if not better:
        return beside
    words = min(better, key=lambda name: better[name])
    first = f"{words} predicts what was left out with {better[words]:.2f} times this model's errors"
    sentence = f"{first[0].upper()}{first[1:]}. {verdict.sentence}"
    return replace(beside, answer=Answer.INADEQUATE, rival=first, sentence=sentence)
