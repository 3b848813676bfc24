"""What is on no list, drafted as an effect: it is weighed like a candidate, and says what it makes of the data."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

from rover_pin.discrepancy.answer import score_line
from rover_pin.discrepancy.fold_refits import fall_of, losses_of
from rover_pin.discrepancy.held_out_errors import ChannelScore, held_out
from rover_pin.estimation.fit import Fit


@dataclass(frozen=True, eq=False)
class Draft:
    """A drafted effect as it was tried: every uncertain number refitted with it, every fold predicted by the others."""

    text: str = field(repr=False)
    fit: Fit | None = field(default=None, repr=False)
    "None where no fit with it ends"
    log_odds: float = -math.inf
    "logarithm of its evidence over that of the model without"
    held_out_gain: float = math.nan
    "by how much chi2 of folds left out falls; NaN where it loses one that the model without predicts"
    unpredicted: tuple[str, ...] = ()
    "folds that no fit to the others predicts with it"
    scores: tuple[ChannelScore, ...] = ()
    command: str = ""
    "the command line that tries it again"

    @property
    def accepted(self) -> bool:
        """Whether the data are more probable with it, and it predicts every fold that it has not seen, better."""
        return self.log_odds > 0 and self.held_out_gain > 0 and not self.unpredicted

    @property
    def sentence(self) -> str:
        """How it did, in a sentence."""
        if self.fit is None:
            return "the draft promises nothing when it is tried"
        odds = f"the data are {math.exp(min(self.log_odds, 50.0)):.3g} times as probable with it"
        folds = f"chi2 of folds left out falls by {self.held_out_gain:.3g}"
        if math.isnan(self.held_out_gain):
            folds = "a fold left out that is predicted without it is lost, and nothing compared"
        if self.unpredicted:
            folds += f", but {', '.join(self.unpredicted)} left out is predicted by nobody"
        return f"tried, {odds}, {folds}{'' if self.accepted else '; it does not hold up'}"

    def lines(self) -> list[str]:
        """Return lines for a reader."""
        again = [f"try it again: {self.command}"] if self.command else []
        return [self.sentence, *(score_line(score) for score in self.scores), *again]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "accepted": self.accepted,
            "said": self.sentence,
            "log_odds": self.log_odds,
            "held_out_gain": self.held_out_gain,
            "held_out": [score.as_dict() for score in self.scores],
            "command": self.command,
        }


def draft_of(text: str, before: Fit, after: Fit | None, log_odds: float) -> Draft:
    """Return a draft by the fit with it, in the noise of the one without."""
    if after is None:
        return Draft(text)
    after = replace(after, task=before.task)
    was, now = losses_of(before), losses_of(after)
    names = zip(after.task.experiment.folds, now, strict=True)
    return Draft(text, after, log_odds, fall_of(was, now), tuple(name for name, loss in names if math.isnan(loss)))


def score_draft(draft: Draft, before: Fit, seed: int) -> Draft:
    """Return a draft with its errors on folds left out beside those of a fit without."""
    if draft.fit is None:
        return draft
    return replace(draft, scores=held_out(before, draft.fit, draft.fit.task.noise, seed).channels)
