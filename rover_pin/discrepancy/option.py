"""A candidate as it may be added to a fit: at the place and of the size at which it promises most."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.signature import Signature
from rover_pin.estimation.fit import Fit
from rover_pin.inference.cause import SIZE_SD, Cause
from rover_pin.inference.expansion import Expansion
from rover_pin.inference.explore import SHOWN
from rover_pin.inference.linear_hypothesis import LinearHypothesis, linear_hypothesis


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
        cause, name = self.candidate.cause, self.signature.moved
        number = next(parameter for parameter in cause.parameters if parameter.name == name)
        anywhere = replace(number, log=False, low=-math.inf, high=math.inf)
        return replace(cause, parameters=(anywhere if number.log else number,))


def options(start: Fit, rows: Sequence[Signature], is_optimum: bool = True) -> list[Option]:
    """Return the candidates that move what was measured, each as it promises most: at its best place and size."""
    visible = [option for option in _list_options(start, rows) if np.linalg.norm(option.column) > SHOWN * SIZE_SD]
    gains = [hypothesis.log_evidence for hypothesis in alone(start, visible, is_optimum)]
    best: dict[str, tuple[Option, float]] = {}
    for option, gain in zip(visible, gains, strict=True):
        name = option.candidate.name
        if name not in best or gain > best[name][1]:
            best[name] = option, gain
    by_kind: dict[str, list[tuple[Option, float]]] = {}
    for option, gain in best.values():
        by_kind.setdefault(option.candidate.anywhere, []).append((option, gain))
    return [_at_its_best_place(of_kind) for of_kind in by_kind.values()]


def _at_its_best_place(of_kind: Sequence[tuple[Option, float]]) -> Option:
    gains = np.array([gain for _, gain in of_kind])
    option, gain = max(of_kind, key=lambda pair: pair[1])
    return replace(option, log_places=float(logsumexp(gains)) - gain - math.log(len(gains)))


def _list_options(start: Fit, rows: Sequence[Signature]) -> list[Option]:
    return [Option(row, -start.task.noise.white(row.column)) for row in rows]


def alone(start: Fit, listed: Sequence[Option], is_optimum: bool = True) -> list[LinearHypothesis]:
    """Return each option alone beside what was fitted."""
    if not listed:
        return []
    expansion = Expansion(start, np.array([option.column for option in listed]).T, is_optimum)
    return [linear_hypothesis((option.size,), expansion, (at,), (option.size,)) for at, option in enumerate(listed)]


def singles(start: Fit, rows: Sequence[Signature]) -> np.ndarray:
    """Return the logarithm of the evidence of each signature alone beside what was fitted."""
    return np.array([hypothesis.log_evidence for hypothesis in alone(start, _list_options(start, rows))])
