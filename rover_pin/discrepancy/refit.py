"""A model with one more candidate, fitted: what it gains, what it must, and which cannot be distinguished."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import COLOURED
from rover_pin.estimation.parameter import Parameter

ODDS = 9.2
"""Candidates within this of the best, in units of the noise, cannot be distinguished: 2 ln 100, odds of 1 in 100."""
HALF = 0.5
"""Share of the best's net gain from which better predictions of what was not fitted make a rival."""

Progress = Callable[[str], None]
Threshold = Callable[..., float]
"""What chance alone gains with a candidate; `inflation`, a keyword, says by how much more than with white noise."""


@dataclass(frozen=True, eq=False)
class Refit:
    """A model with one more candidate, fitted."""

    candidate: Candidate
    fit: Fit = field(repr=False)
    gain: float
    "fall of chi2 from the model without"
    threshold: float
    "what chance alone would gain"
    held_out: float
    "how much better every fold is predicted from the others: in chi2 where fits are exact, else in `seen_again`; NaN \
where it loses one that the model without predicts"
    unit: float = COLOURED
    "by how much chi2 by chance exceeds that of white noise here: what gains are counted in"

    @property
    def name(self) -> str:
        """Name of the candidate."""
        return self.candidate.name

    @property
    def net(self) -> float:
        """Gain minus threshold."""
        return self.gain - self.threshold

    @property
    def loses(self) -> bool:
        """Whether a fit with it loses a fold left out that the model without predicts: then nothing is compared."""
        return math.isnan(self.held_out)

    @property
    def accepted(self) -> bool:
        """Whether it gains more than chance and predicts runs that it has not seen better."""
        return self.net > 0 and self.held_out > 0


def joined(base: Fit, candidate: Candidate, model: Any) -> tuple[tuple[Parameter, ...], np.ndarray]:
    """Return the base's numbers and the candidate's, and where the fit starts; freed numbers lose their prior."""
    unconstrained_names = [] if candidate.effect is not None else list(candidate.amplitudes)
    old = [
        dataclasses.replace(parameter, prior=False) if parameter.name in unconstrained_names else parameter
        for parameter in base.parameters
    ]
    candidate_parameters = () if candidate.effect is None else candidate.parameters
    start = [parameter.u(base.task.experiment.value(model, parameter.name)) for parameter in candidate_parameters]
    return (*old, *candidate_parameters), np.concatenate([base.u, start])


def rescale_thresholds(refits: tuple[Refit, ...], threshold: Threshold) -> tuple[Refit, ...]:
    """Return the refits with thresholds in units of what the best one leaves, if that is more than declared noise."""
    if not refits or refits[0].fit.task.experiment.noise() is None:
        return refits
    unit = max(refits[0].fit.task.noise.inflation, min(refit.fit.misfit for refit in refits))
    wider = [
        dataclasses.replace(refit, threshold=threshold(refit.candidate, inflation=unit), unit=unit) for refit in refits
    ]
    return tuple(sorted(wider, key=lambda refit: -refit.net))


def best_of_each(refits: Sequence[Refit]) -> tuple[Refit, ...]:
    """Return the best refit of each candidate, the best first: from two starts there are two."""
    best: dict[str, Refit] = {}
    for refit in sorted(refits, key=lambda refit: -refit.net):
        best.setdefault(refit.name, refit)
    return tuple(best.values())


def indistinguishable_refits(refits: Sequence[Refit]) -> tuple[Refit, ...]:
    """Return the candidates that the data cannot tell from the best, the best first; empty where none is accepted."""
    accepted = [refit for refit in refits if refit.accepted]
    if not accepted:
        return ()
    best = accepted[0]
    enough = max(0.0, best.net - ODDS * best.unit)
    better = [refit for refit in accepted if refit.held_out > best.held_out and refit.net > HALF * best.net]
    rivals = [refit for refit in refits if refit is not best and (refit.net > enough or refit in better)]
    distinct = {_what(best): best}
    for refit in rivals:
        distinct.setdefault(_what(refit), refit)
    return tuple(distinct.values())


def _what(refit: Refit) -> tuple[str, bool]:
    """Return what counts as one rival: a kind that is sought all over the ground, wherever it is, else a name."""
    place_searched = refit.candidate.place_searched
    return (refit.candidate.kind if place_searched else refit.name), place_searched
