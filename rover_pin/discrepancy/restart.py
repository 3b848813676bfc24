"""What is known beforehand as a second start: an effect that a fit had to absorb leaves its optimum far from it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.screen import Scored, score, signatures
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.gauss_newton import at, slopes_at

BENT = 3.0
"""SDs from what was known of a number from which it is bent: chance takes one of twenty so far in 5 % of logs."""


class DeclaredStart(NamedTuple):
    """A model with all uncertain numbers as declared, and the candidates scored there, the most promising first."""

    start: Fit
    scored: tuple[Scored, ...]


def declared_start(fitted: Fit, candidates: Sequence[Candidate]) -> DeclaredStart:
    """Return the declared numbers as a start for refits of these candidates."""
    start = as_declared(fitted)
    return DeclaredStart(start, tuple(score(start, signatures(start, candidates))))


def is_bent(fitted: Fit) -> bool:
    """Return whether a number had to leave what was known beforehand, as where the model lacks something that acts."""
    return any(parameter.prior and abs(u) > BENT for parameter, u in zip(fitted.parameters, fitted.u, strict=True))


def as_declared(fitted: Fit) -> Fit:
    """Return the model of a fit with every number that has a prior at its mean; sizes of effects stay."""
    experiment, parameters = fitted.task.experiment, fitted.parameters
    u = np.array([0.0 if parameter.prior else x for parameter, x in zip(parameters, fitted.u, strict=True)])
    model = at(fitted.task, fitted.model, parameters, u)

    def driven() -> dict[str, np.ndarray]:
        slopes = slopes_at(fitted.task, model, parameters, u)
        return {
            "predicted": experiment.predict([model])[0],
            "slopes": np.array([slopes[parameter.name] for parameter in parameters]),
        }

    cached = experiment.cached_arrays(("as declared", model, parameters, u), driven)
    slopes = dict(zip([parameter.name for parameter in parameters], cached["slopes"], strict=True))
    return Fit(fitted.task, model, parameters, u, cached["predicted"], slopes)
