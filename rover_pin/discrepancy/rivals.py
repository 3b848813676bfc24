"""Compare a model with rivals that know no physics: if a rival predicts held-out data better, the model is inadequate.

A rival is a plain curve through the measured points (a mean, a quadratic, a Gaussian process), or odometry.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.profile import CONFIDENCE
from rover_pin.estimation.wording import format_value

RIVAL_RATIO = 0.95
"""Maximum ratio of a better rival's held-out error to the model's error. The value is assumed: a difference of less
than 5 % is not visible in any table and shows little about the model."""


def is_better(error: float, floor: float, model_error: float) -> bool:
    """Return whether a rival curve (a curve without physics) has a smaller error than the model.

    An error of the curve below the noise counts as the noise.

    Parameters
    ----------
    error, model_error : float
        Held-out RMSE of the curve and of the model, in the unit of the channel.
    floor : float
        Noise of the channel, in the unit of the errors.
    """
    return max(error, floor) < RIVAL_RATIO * model_error


def is_sure(score: ChannelScore, rival: Baseline) -> bool:
    """Return whether a rival curve (a curve without physics) predicts a channel significantly better than the model.

    The test is Student's t test of ln(curve's error / model's error) over the folds (groups of samples left out
    together), two-sided at 95 %.
    """
    # Errors below the noise count as the noise on both sides, because a difference below the noise is chance.
    both = zip(rival.by_fold, (level.after for level in score.levels), strict=False)
    ratios = np.log([max(error, score.floor) / max(after, score.floor) for error, after in both])
    ratios = ratios[~np.isnan(ratios)]
    if len(ratios) < 2:
        return False
    # Upper end of the interval of the mean log ratio; below 0 the curve is significantly better.
    reach = student.ppf(0.5 + 0.5 * CONFIDENCE, len(ratios) - 1) * np.std(ratios, ddof=1) / math.sqrt(len(ratios))
    return bool(ratios.mean() + reach < 0.0)


def losses(scores: Sequence[ChannelScore], rivals: Sequence[Baseline], surely: bool = False) -> tuple[str, ...]:
    """Return one sentence for each channel that a rival curve (a curve without physics) predicts better than the model.

    Parameters
    ----------
    scores : sequence of ChannelScore
        Held-out errors of the model.
    rivals : sequence of Baseline
        Held-out errors of the curves.
    surely : bool
        Whether a curve must also be significantly better, compared with the scatter between folds (`is_sure`).
    """
    sentences = []
    for score in scores:
        # Of several better curves only the best one is named.
        better = [
            rival
            for rival in rivals
            if rival.channel == score.name
            and is_better(rival.error, score.floor, score.after)
            and (not surely or is_sure(score, rival))
        ]
        if better:
            best = min(better, key=lambda rival: rival.error)
            errors = f"{format_value(best.error, score.unit)} against {format_value(score.after, score.unit)}"
            sentences.append(
                f"the held-out {score.name} is predicted better by a {best.curve} of {best.given} ({errors})"
            )
    return tuple(sentences)


def against_rivals(verdict: Verdict, rivals: Sequence[Baseline], same_inputs: bool = True) -> Verdict:
    """Compare the model of a verdict with rival curves (curves without physics), and return the verdict with their
    errors.

    If a curve predicts a channel better, the answer becomes INADEQUATE (an answer NONE_FITS is kept), and the verdict's
    sentence starts with this comparison. `same_inputs` states whether the curves use the inputs of the model. If they
    do not, a better curve is only a caution: odometry, for example, reads the measured wheel rates.
    """
    # Every better curve is a caution; whether it also changes the answer is decided below.
    cautions = losses(verdict.scores, rivals)
    compared = replace(verdict, baselines=tuple(rivals), cautions=(*verdict.cautions, *cautions))
    if not same_inputs:
        return compared
    # The best of several curves is chosen by the errors that are compared here, so that it is smaller by chance. It
    # must therefore be better by more than the folds scatter.
    several = len({rival.curve for rival in rivals}) > 1
    first = "; ".join(losses(verdict.scores, rivals, surely=several))
    if not first:
        return compared
    answer = verdict.answer if verdict.answer is Answer.NONE_FITS else Answer.INADEQUATE
    return replace(compared, answer=answer, rival=first, sentence=f"{first[0].upper()}{first[1:]}. {verdict.sentence}")
