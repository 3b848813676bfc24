"""A candidate as it may be added to a fit: at the place and of the size at which it promises most."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.signature import Signature
from rover_pin.estimation.fit import Fit
from rover_pin.inference.cause import Cause
from rover_pin.inference.expansion import Expansion
from rover_pin.inference.explore import SHOWN
from rover_pin.inference.linear_hypothesis import linear_hypothesis


@dataclass(frozen=True, eq=False)
class Option:
    """A cause as it may be added: how it moves the rows, and how much more probable all its places are than this."""

    signature: Signature
    column: np.ndarray = field(repr=False)
    "of the whitened rows (n,), by u of its size"
    log_places: float = 0.0

    @property
    def candidate(self) -> Candidate:
        """What it is."""
        return self.signature.candidate

    @property
    def size(self) -> Cause:
        """The cause with the one size that its signature moves."""
        whole, moved = self.candidate.cause, self.signature.moved
        number = next(parameter for parameter in whole.parameters if parameter.name == moved)
        return replace(
            whole, parameters=(replace(number, log=False, low=-math.inf, high=math.inf),) if number.log else (number,)
        )


def options(start: Fit, rows: Sequence[Signature]) -> list[Option]:
    """Return the candidates that move what was measured, each as it promises most: at its best place and size."""
    shown = [row for row in rows if np.linalg.norm(start.task.noise.white(row.shift)) > SHOWN * row.share]
    gains = singles(start, shown)
    best: dict[str, tuple[Signature, float]] = {}
    for row, gain in zip(shown, gains, strict=True):
        if row.candidate.name not in best or gain > best[row.candidate.name][1]:
            best[row.candidate.name] = row, gain
    by_kind: dict[str, list[tuple[Signature, float]]] = {}
    for row, gain in best.values():
        by_kind.setdefault(row.candidate.anywhere, []).append((row, gain))
    return [_option(start, of_kind) for of_kind in by_kind.values()]


def _option(start: Fit, of_kind: Sequence[tuple[Signature, float]]) -> Option:
    gains = np.array([gain for _, gain in of_kind])
    leader, gain = max(of_kind, key=lambda pair: pair[1])
    places = float(logsumexp(gains)) - gain - math.log(len(gains))
    return Option(leader, -start.task.noise.white(leader.column), places)


def singles(start: Fit, rows: Sequence[Signature]) -> np.ndarray:
    """Return the logarithm of the evidence of each signature alone beside what was fitted."""
    if not rows:
        return np.zeros(0)
    table = [Option(row, -start.task.noise.white(row.column)) for row in rows]
    expansion = Expansion(start, np.array([option.column for option in table]).T)
    return np.array(
        [
            linear_hypothesis((option.size,), expansion, (at,), (option.size,)).log_evidence
            for at, option in enumerate(table)
        ]
    )
