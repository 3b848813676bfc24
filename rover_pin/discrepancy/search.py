"""The search for what a drive model lacks: calibrate, learn the noise, screen, refit, add, and look again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from rover_pin.discrepancy.anchor import anchor, is_bent
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.compare import Fee, Refit, alike, refit
from rover_pin.discrepancy.screen import Scored, Signature, fee_of, saturated, score, signatures, with_noise
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit, Task, fit
from rover_pin.estimation.noise import COLOURED, first_noise
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.residual import residual

MOST = 3
"""Effects that are added at most."""
LEARNT = 2
"""How often noise and base are fitted in turn."""
LEAST = 1e-6
"""Least SD of a channel's blocks [its unit]: one that never moves has no noise of its own."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Round:
    """One look for something missing: all candidates scored, the plausible ones refitted."""

    scored: tuple[Scored, ...] = field(repr=False)
    refits: tuple[Refit, ...]

    @property
    def alike(self) -> tuple[Refit, ...]:
        """The candidates that the data cannot tell from the best; empty where none is accepted."""
        return alike(self.refits)


@dataclass(frozen=True, eq=False)
class Search:
    """The calibrated base model, and one round for each effect that was added, then the last that found none."""

    base: Fit
    rounds: tuple[Round, ...]
    known: tuple[Signature, ...] = field(repr=False)
    "how each candidate moves the base model"

    @property
    def found(self) -> tuple[Refit, ...]:
        """What was added, in turn."""
        return tuple(each.alike[0] for each in self.rounds if each.alike)

    @property
    def last(self) -> Fit:
        """The fit with everything that was added."""
        return self.found[-1].fit if self.found else self.base

    @property
    def count(self) -> int:
        """How many candidates were tried."""
        return len(self.rounds[0].scored) if self.rounds else 0


def calibrated(experiment: Experiment, model: Any, numbers: Sequence[Parameter]) -> Fit:
    """Return the model with its uncertain numbers fitted, the noise as declared, or taken as large as what is left."""
    declared = experiment.noise()
    if declared is not None:
        return again(fit(Task(experiment, declared), model, numbers))
    least = np.full(len(experiment.channels), LEAST)
    left = residual(experiment.observed, experiment.predict([model])[0])
    base = fit(Task(experiment, first_noise(left, least)), model, numbers)
    return again(with_noise(base, base.residual, least))


def again(base: Fit) -> Fit:
    """Return the fit taken up where it was, as after a change of the noise."""
    return fit(base.task, base.model, base.parameters, base.u, base.slopes)


def search(base: Fit, tried: Sequence[Candidate], progress: Progress) -> Search:
    """Return what the calibrated model lacks of the candidates that are tried."""
    progress(f"score test of {len(tried)} candidates")
    known = signatures(base, tried)
    least = np.full(base.predicted.shape[1], LEAST)
    for _ in range(LEARNT if base.task.experiment.noise() is None else 0):
        base = again(with_noise(base, saturated(base, known), least))
    rounds: list[Round] = []
    here = base
    while len(rounds) <= MOST:
        rounds.append(_round(here, known, tried, tuple(rounds), progress))
        if not rounds[-1].alike:
            break
        here = rounds[-1].alike[0].fit
    return Search(base, tuple(rounds), tuple(known))


def _round(
    here: Fit, known: Sequence[Signature], tried: Sequence[Candidate], before: Sequence[Round], progress: Progress
) -> Round:
    added = {each.alike[0].candidate.kind for each in before}
    left = [each for each in known if each.candidate.kind not in added]
    scored = score(here, left)
    declared = None
    if is_bent(here):
        progress("the numbers had to leave what is declared: scoring every candidate at the declared ones too")
        declared = anchor(here, [each.candidate for each in left])
    return Round(
        tuple(scored), refit(here, scored, fee_after(before, len(tried), here.task.noise.inflation), progress, declared)
    )


def fee_after(before: Sequence[Round], count: int, inflation: float = COLOURED) -> Fee:
    """Return what each of `count` candidates must gain once these rounds have added theirs."""
    return partial(fee_of, count=count, taken=sum(each.alike[0].gain for each in before), inflation=inflation)
