"""A drafted effect: an effect file that the search for missing effects writes for a residual that no known effect
explains, and the trial fit with this effect.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any

from rover_pin.discrepancy.held_out_errors import ChannelScore, fall_of, held_out, losses_of
from rover_pin.estimation.fit import Fit

MAX_LOG_ODDS = 50.0
"""Largest logarithm of odds that a sentence states, for the odds of a model with the drafted effect against the model
without it. Larger odds are stated as e^50, which is 5e21; a larger number would not help a reader."""


@dataclass(frozen=True, eq=False)
class Draft:
    """A drafted effect and its trial: the text of an effect file, a fit of all parameters with the effect, and the
    held-out errors of this fit.
    """

    text: str = field(repr=False)
    """text of the effect file"""
    fit: Fit | None = field(default=None, repr=False)
    """fit with the drafted effect; None if no fit converged"""
    log_odds: float = -math.inf
    """log evidence of the model with the drafted effect minus log evidence of the model without it [nats]"""
    held_out_gain: float = math.nan
    """decrease of the held-out chi2 by the drafted effect; NaN if the model with the effect fails to predict a fold
    (group of samples left out together) that the model without the effect predicts"""
    unpredicted: tuple[str, ...] = ()
    """names of the folds that the model with the drafted effect cannot predict after a fit to the other folds"""
    scores: tuple[ChannelScore, ...] = ()
    command: str = ""
    """command line that repeats the trial"""

    @property
    def accepted(self) -> bool:
        """Whether the drafted effect makes the data more probable, predicts every held-out fold, and lowers the
        held-out chi2.
        """
        return self.log_odds > 0 and self.held_out_gain > 0 and not self.unpredicted

    @property
    def sentence(self) -> str:
        """Result of the trial as a sentence."""
        if self.fit is None:
            return "the draft was tried, but no fit with it converged"
        odds = f"the data are {math.exp(min(self.log_odds, MAX_LOG_ODDS)):.3g} times as probable with the draft"
        folds = f"the held-out chi2 falls by {self.held_out_gain:.3g}"
        if math.isnan(self.held_out_gain):
            folds = "held-out errors are not compared, because a fold that is predicted without it is lost"
        if self.unpredicted:
            folds += f", but no fit to the other folds predicts {', '.join(self.unpredicted)}"
        return f"tried: {odds}, {folds}{'' if self.accepted else '; the draft is not accepted'}"

    def lines(self) -> list[str]:
        """Return the lines about the drafted effect for the summary of a verdict."""
        again = [f"try it again: {self.command}"] if self.command else []
        return [self.sentence, *(score.line for score in self.scores), *again]

    def as_dict(self) -> dict[str, Any]:
        """Return the result of the trial as plain values for verdict.json."""
        return {
            "accepted": self.accepted,
            "said": self.sentence,
            "log_odds": self.log_odds,
            "held_out_gain": self.held_out_gain,
            "held_out": [score.as_dict() for score in self.scores],
            "command": self.command,
        }


def draft_of(text: str, before: Fit, after: Fit | None, log_odds: float) -> Draft:
    """Return a drafted effect with the result of its trial fit.

    Parameters
    ----------
    text : str
        Text of the effect file.
    before, after : Fit, Fit or None
        Fits of the model without and with the drafted effect; `after` is None if no fit with the effect converged.
    log_odds : float
        Log evidence with the drafted effect minus log evidence without it [nats].
    """
    if after is None:
        return Draft(text)
    # Both fits are judged by the same noise, because their chi2 could not be compared otherwise.
    after = replace(after, task=before.task)
    before_losses, after_losses = losses_of(before), losses_of(after)
    # A fold that the model with the effect cannot predict speaks against the effect, whatever its other errors are.
    names = zip(after.task.experiment.folds, after_losses, strict=True)
    unpredicted = tuple(name for name, loss in names if math.isnan(loss))
    return Draft(text, after, log_odds, fall_of(before_losses, after_losses), unpredicted)


def score_draft(draft: Draft, before: Fit, seed: int) -> Draft:
    """Return the drafted effect with its scores: the held-out error of each channel, compared with the error without
    the effect.

    `before` is the fit of the model without the drafted effect, and `seed` starts the random numbers of the bootstrap
    intervals.
    """
    if draft.fit is None:
        return draft
    return replace(draft, scores=held_out(before, draft.fit, draft.fit.task.noise, seed).channels)
