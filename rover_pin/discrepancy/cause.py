"""What may be missing from a model, or wrong with the measuring, as a hypothesis has it: numbers with priors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.candidate import Candidate
from rover_pin.estimation.parameter import Parameter

SIZE_SD = 2.0
"""Prior SD of a size, in the default sizes of its effect (assumed)."""


@dataclass(frozen=True, eq=False)
class Cause:
    """One cause: how a model gets it, and its numbers, of which `sizes` vanish where it does not act."""

    name: str
    on: Callable[[Any], Any]
    parameters: tuple[Parameter, ...]
    sizes: frozenset[str]
    candidate: Candidate | None = None
    "the effect, where it is one"


def cause_of(candidate: Candidate) -> Cause:
    """Return an effect as a cause: sizes of SD SIZE_SD, shapes as published or within their doubt."""
    sizes = tuple(
        replace(parameter, scale=SIZE_SD * parameter.scale, prior=True, source="assumed: default sizes")
        for parameter in map(candidate.size, candidate.amplitudes)
    )
    shapes = tuple(
        candidate.diffuse_shape(name) if _is_of_unknown_order(candidate, name) else candidate.shape(name)
        for name in candidate.shapes
    )
    return Cause(candidate.name, candidate.on, (*sizes, *shapes), frozenset(candidate.amplitudes), candidate)


def _is_of_unknown_order(candidate: Candidate, name: str) -> bool:
    return quantities(candidate.effect)[name.rpartition(".")[2]].log_sd > 0.0


def reading_error(name: str, parameter: Parameter) -> Cause:
    """Return an error of the measuring that a model has already, at none, as a cause."""
    return Cause(name, lambda model: model, (parameter,), frozenset({name}))
