"""What is on no list, drafted as an effect: the draft is tried like a candidate, and says what it makes of the data."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from rover_pin.discrepancy.answer import score_line
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.cross_validation import held_out_losses
from rover_pin.discrepancy.held_out import ChannelScore, held_out
from rover_pin.discrepancy.refit import Progress, Refit
from rover_pin.discrepancy.search import attempted
from rover_pin.estimation.fit import Fit


class Drafted(NamedTuple):
    """The text of an effect file made of what a model leaves, and its effect as candidates."""

    text: str
    candidates: tuple[Candidate, ...]


@dataclass(frozen=True, eq=False)
class Draft:
    """A drafted effect as it was tried: every uncertain number refitted with it, every fold predicted by the others."""

    text: str = field(repr=False)
    refit: Refit | None = None
    "None where it promises nothing"
    scores: tuple[ChannelScore, ...] = ()
    command: str = ""
    "the command line that tries it again"
    unpredicted: tuple[str, ...] = ()
    "folds that no fit to the others predicts with it, of one that else were accepted"

    @property
    def accepted(self) -> bool:
        """Whether it gains more than chance, and predicts every fold that it has not seen, all in all better."""
        return self.refit is not None and self.refit.accepted and not self.unpredicted

    @property
    def sentence(self) -> str:
        """How it did, in a sentence."""
        if self.refit is None:
            return "the draft promises nothing when it is tried"
        gain = f"chi2 falls by {self.refit.gain:.3g} (chance: {self.refit.threshold:.3g})"
        folds = f"on folds left out by {self.refit.held_out:.3g}"
        if self.refit.loses:
            folds = "a fold left out that is predicted without it is lost, and nothing compared"
        if self.unpredicted:
            folds += f", but {', '.join(self.unpredicted)} left out is predicted by nobody"
        return f"tried, {gain}, {folds}{'' if self.accepted else '; it does not hold up'}"

    def lines(self) -> list[str]:
        """Return lines for a reader."""
        again = [f"try it again: {self.command}"] if self.command else []
        return [self.sentence, *(score_line(score) for score in self.scores), *again]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        gains = {} if self.refit is None else {"gain": self.refit.gain, "threshold": self.refit.threshold}
        held_out_gain = {} if self.refit is None else {"held_out_gain": self.refit.held_out}
        rows = [score.as_dict() for score in self.scores]
        return {
            "accepted": self.accepted,
            "said": self.sentence,
            **gains,
            **held_out_gain,
            "held_out": rows,
            "command": self.command,
        }


def tried(drafted: Drafted, fitted: Fit, progress: Progress) -> Draft:
    """Return a draft tried on the fit that leaves what it describes."""
    progress("trying the draft of what is left")
    refits = attempted(fitted, drafted.candidates, progress)
    return draft_of(drafted.text, refits[0] if refits else None)


def draft_of(text: str, refit: Refit | None) -> Draft:
    """Return a draft as its refit has it, with the folds that nobody predicts where it else were accepted."""
    draft = Draft(text, refit)
    return replace(draft, unpredicted=_unpredicted(refit.fit)) if refit is not None and draft.accepted else draft


def _unpredicted(fitted: Fit) -> tuple[str, ...]:
    """Return the folds that a fit to the others does not predict."""
    rows = zip(fitted.task.experiment.folds, held_out_losses(fitted), strict=True)
    return tuple(name for name, loss in rows if math.isnan(loss))


def scored(draft: Draft, before: Fit, seed: int) -> Draft:
    """Return a draft with its errors on folds left out beside those of a fit without."""
    if draft.refit is None:
        return draft
    return replace(draft, scores=held_out(before, draft.refit.fit, draft.refit.fit.task.noise, seed).channels)
