"""Rivals of a model: where one predicts a channel better that was left out, the model does not describe the data."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.profile import SURE
from rover_pin.estimation.wording import format_value

LOSES = 0.95
"""Share of the model's held-out error below which a rival's is better. Why: less is seen in no table (assumed)."""


def is_better(error: float, floor: float, of_model: float) -> bool:
    """Return whether an error is less than the model's; one below the noise counts as the noise."""
    return max(error, floor) < LOSES * of_model


def is_sure(score: ChannelScore, rival: Baseline) -> bool:
    """Return whether a rival is better beyond what folds scatter: Student's t of ln of both errors, 95 %, two-sided."""
    both = zip(rival.by_fold, (level.after for level in score.levels), strict=False)
    ratios = np.log([max(error, score.floor) / max(after, score.floor) for error, after in both])
    ratios = ratios[~np.isnan(ratios)]
    if len(ratios) < 2:
        return False
    reach = student.ppf(0.5 + 0.5 * SURE, len(ratios) - 1) * np.std(ratios, ddof=1) / math.sqrt(len(ratios))
    return bool(ratios.mean() + reach < 0.0)


def losses(scores: Sequence[ChannelScore], rivals: Sequence[Baseline], surely: bool = False) -> tuple[str, ...]:
    """Return where the best of the rivals predicts what was not fitted better than the model, a sentence a channel."""
    sentences = []
    for score in scores:
        of_channel = (rival for rival in rivals if rival.channel == score.name)
        better = (rival for rival in of_channel if is_better(rival.error, score.floor, score.after))
        sure = (rival for rival in better if not surely or is_sure(score, rival))
        best = min(sure, key=lambda rival: rival.error, default=None)
        if best is not None:
            errors = f"{format_value(best.error, score.unit)} against {format_value(score.after, score.unit)}"
            sentences.append(f"held out, {score.name} is predicted better by a {best.curve} of {best.given} ({errors})")
    return tuple(sentences)


def against_rivals(verdict: Verdict, rivals: Sequence[Baseline], same_inputs: bool = True) -> Verdict:
    """Return a verdict beside its rivals: where one predicts any channel better, that is said first, with both errors.

    The best of several curves is chosen by these errors: it must be better beyond what folds scatter. Rivals that are
    given other inputs than the model are cautions alone.
    """
    lost = losses(verdict.scores, rivals)
    beside = replace(verdict, baselines=tuple(rivals), cautions=(*verdict.cautions, *lost))
    several = len({rival.curve for rival in rivals}) > 1
    first = "; ".join(losses(verdict.scores, rivals, surely=several)) if same_inputs else ""
    if not first:
        return beside
    answer = verdict.answer if verdict.answer is Answer.NONE_FITS else Answer.INADEQUATE
    return replace(beside, answer=answer, rival=first, sentence=f"{first[0].upper()}{first[1:]}. {verdict.sentence}")
