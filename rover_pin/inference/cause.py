"""What may be missing from a model, or wrong with the measuring, as a hypothesis has it: numbers with priors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_pin.estimation.parameter import Parameter

SIZE_SD = 2.0
"""Prior SD of a size in fits, in default sizes (assumed). Why: wider than what takes its place, MEDIAN and SPREAD."""


@dataclass(frozen=True, eq=False)
class Cause:
    """One cause: how a model gets it, and its numbers, of which `amplitudes` vanish where it does not act."""

    name: str
    on: Callable[[Any], Any]
    parameters: tuple[Parameter, ...]
    amplitudes: frozenset[str]
    family: str = ""
    "what causes like it do"
    owner: str = ""
    "the name of the effect in the model; empty where it is none"

    def absent(self, parameters: Sequence[Parameter], u: np.ndarray) -> np.ndarray:
        """Return u of numbers where this cause does not act: its sizes at 0, one on a logarithm at its greatest."""
        none = [number.bounds[1] if number.log else 0.0 for number in parameters]
        return np.where([number.name in self.amplitudes for number in parameters], none, u)


def reading_error(name: str, parameter: Parameter) -> Cause:
    """Return an error of the measuring that a model has already, at none, as a cause."""
    return Cause(name, lambda model: model, (parameter,), frozenset({name}), "rig")
