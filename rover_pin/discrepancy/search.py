"""The search for what a model lacks: calibrate, learn the noise, screen, refit, add, and look again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from rover_pin.base.public import brief
from rover_pin.discrepancy.calibration import again, declared_start, is_bent
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.refit import Progress, Refit, Threshold, indistinguishable_refits
from rover_pin.discrepancy.refit_candidates import refit
from rover_pin.discrepancy.screen import (
    Scored,
    Signature,
    candidate_threshold,
    saturated,
    score,
    signatures,
    with_noise,
    with_random_effects,
)
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import COLOURED
from rover_pin.estimation.random_effects.random_field import RandomField

MOST = 3
"""Effects that are added at most."""
LEARNT = 2
"""How often noise and base are fitted in turn."""


@brief
@dataclass(frozen=True, eq=False)
class Round:
    """One look for something missing: all candidates scored, the plausible ones refitted."""

    scored: tuple[Scored, ...] = field(repr=False)
    refits: tuple[Refit, ...]

    @property
    def indistinguishable(self) -> tuple[Refit, ...]:
        """The candidates that the data cannot tell from the best; empty where none is accepted."""
        return indistinguishable_refits(self.refits)


@brief
@dataclass(frozen=True, eq=False)
class Search:
    """The calibrated base model, and one round for each effect that was added, then the last that found none."""

    base: Fit
    rounds: tuple[Round, ...]
    signatures: tuple[Signature, ...] = field(repr=False)
    "how each candidate moves the base model"
    random_field: RandomField | None = field(default=None, repr=False)
    "what of the experiment differs from fold to fold by chance"

    @property
    def best_refits(self) -> tuple[Refit, ...]:
        """The best of every round that found something, in turn."""
        return self.before(len(self.rounds))

    def before(self, number: int) -> tuple[Refit, ...]:
        """The best of every round before this one that found something."""
        return tuple(step.indistinguishable[0] for step in self.rounds[:number] if step.indistinguishable)

    @property
    def added(self) -> tuple[Candidate, ...]:
        """What was added, in turn."""
        path: tuple[Candidate, ...] = ()
        for best_refit in self.best_refits:
            path = (*path, best_refit.candidate)
        return path

    @property
    def names(self) -> str:
        """What was added, in words; empty where nothing was."""
        return " + ".join(candidate.name for candidate in self.added)

    @property
    def indistinguishable(self) -> tuple[str, ...]:
        """What was added, then what cannot be distinguished from it; empty where nothing was added."""
        *firsts, last = [step.indistinguishable for step in self.rounds if step.indistinguishable] or [()]
        before = [candidate.name for candidate in replace(self, rounds=self.rounds[: len(firsts)]).added]
        ways = [[*before, tied_refit.candidate.name] for tied_refit in last]
        added_names = self.names.split(" + ")
        ways += [
            [*added_names[:at], tied_refit.name, *added_names[at + 1 :]]
            for at, tied_refits in enumerate(firsts)
            for tied_refit in tied_refits[1:]
        ]
        return tuple(" + ".join(way) for way in ways)

    @property
    def last(self) -> Fit:
        """The fit with everything that was added."""
        return self.best_refits[-1].fit if self.best_refits else self.base

    @property
    def count(self) -> int:
        """How many candidates were tried."""
        return len(self.rounds[0].scored) if self.rounds else 0


def _with_residual_noise(
    base: Fit, candidate_signatures: Sequence[Signature], random_field: RandomField | None, least: np.ndarray
) -> Fit:
    """Return the fit with noise, and chance, as large as what nothing explains."""
    unexplained, absorbed = saturated(base, candidate_signatures, random_field)
    noisy = with_noise(base, unexplained, least, absorbed)
    return noisy if random_field is None else with_random_effects(noisy, candidate_signatures, random_field)


def search(base: Fit, tried: Sequence[Candidate], progress: Progress) -> Search:
    """Return what the calibrated model lacks of the candidates that are tried.

    Nothing is looked for where what is left is, over all channels, no more than the error of predictions.
    """
    candidate_signatures = _known(base, tried, progress)
    if base.task.experiment.noise() is None:
        experiment = base.task.experiment
        least, random_field = experiment.least_noise(base.model), experiment.random_field(base.model)
        if is_within_prediction_error(base):
            return Search(
                base, (Round(tuple(score(base, candidate_signatures)), ()),), tuple(candidate_signatures), random_field
            )
        for _ in range(LEARNT):
            base = again(_with_residual_noise(base, candidate_signatures, random_field, least))
        return _rounds(Search(base, (), tuple(candidate_signatures), random_field), tried, progress)
    return _rounds(Search(base, (), tuple(candidate_signatures)), tried, progress)


def is_within_prediction_error(fitted: Fit) -> bool:
    """Return whether all channels together leave no more than the error of predictions."""
    return bool(np.mean((fitted.rms / fitted.task.experiment.least_noise(fitted.model)) ** 2) <= 1.0)


def _known(base: Fit, tried: Sequence[Candidate], progress: Progress) -> list[Signature]:
    progress(f"score test of {len(tried)} candidates")
    return signatures(base, tried)


def _rounds(result: Search, tried: Sequence[Candidate], progress: Progress) -> Search:
    """Return the search with its rounds, until one finds nothing."""
    while len(result.rounds) <= MOST and len(result.best_refits) == len(result.rounds):
        result = replace(result, rounds=(*result.rounds, _round(result, tried, progress)))
    return result


def attempted(current_fit: Fit, tried: Sequence[Candidate], progress: Progress) -> tuple[Refit, ...]:
    """Return a few candidates of any kind refitted on a fit as one round would, the best first."""
    return _round(Search(current_fit, (), tuple(signatures(current_fit, tried))), tried, progress).refits


def _round(result: Search, tried: Sequence[Candidate], progress: Progress) -> Round:
    current_fit, candidate_signatures = result.last, _remaining_signatures(result)
    scored = tuple(score(current_fit, candidate_signatures))
    threshold = threshold_after(result.rounds, len(tried), current_fit.task.noise.inflation)
    declared = None
    if is_bent(current_fit):
        progress("the numbers had to leave what is known beforehand: scoring every candidate there too")
        declared = declared_start(current_fit, [signature.candidate for signature in candidate_signatures])
    return Round(scored, refit(current_fit, scored, threshold, progress, declared))


def _remaining_signatures(result: Search) -> Sequence[Signature]:
    """Return the signatures of what has not been added."""
    added = {candidate.kind for candidate in result.added}
    return [signature for signature in result.signatures if signature.candidate.kind not in added]


def threshold_after(before: Sequence[Round], count: int, inflation: float = COLOURED) -> Threshold:
    """Return what each of `count` candidates must gain once these rounds have added theirs."""
    taken = sum(best_refit.gain for step in before for best_refit in step.indistinguishable[:1])
    return partial(candidate_threshold, count=count, taken=taken, inflation=inflation)
