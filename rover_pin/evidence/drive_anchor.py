"""The declared numbers as a second start: an effect that a fit had to absorb leaves its optimum far from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.evidence.drive_candidates import Candidate
from rover_pin.evidence.drive_fit import DriveFit, at, slopes_at
from rover_pin.evidence.drive_screen import Scored, score, signatures

BENT = 3.0
"""SDs from what was declared from which a number counts as bent: chance takes one of twenty so far in 5 % of logs."""


class Anchor(NamedTuple):
    """A model with all uncertain numbers as declared, and the candidates scored there, the most promising first."""

    start: DriveFit
    scored: tuple[Scored, ...]


def anchor(fitted: DriveFit, candidates: Sequence[Candidate]) -> Anchor:
    """Return the declared numbers as a start for refits of these candidates."""
    start = as_declared(fitted)
    return Anchor(start, tuple(score(start, signatures(start, candidates))))


def is_bent(fitted: DriveFit) -> bool:
    """Return whether a number had to leave what is declared of it, as where the model lacks something that acts."""
    return any(one.prior and abs(u) > BENT for one, u in zip(fitted.parameters, fitted.u, strict=True))


def as_declared(fitted: DriveFit) -> DriveFit:
    """Return the model of a fit with every number that has a prior at its mean; sizes of effects stay."""
    bench, parameters = fitted.task.bench, fitted.parameters
    u = np.array([0.0 if one.prior else x for one, x in zip(parameters, fitted.u, strict=True)])
    model = at(fitted.model, parameters, u)

    def driven() -> dict[str, np.ndarray]:
        slopes = slopes_at(fitted.task, model, parameters, u)
        return {"predicted": bench.predict([model])[0], "slopes": np.array([slopes[one.name] for one in parameters])}

    found = bench.memory.kept((bench.identity, "as declared", model, parameters, u), driven)
    slopes = dict(zip([one.name for one in parameters], found["slopes"], strict=True))
    return DriveFit(fitted.task, model, parameters, u, found["predicted"], slopes)
