"""What data cannot tell of a soil: refusals before a fit, with what would tell it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from rover_pin.base.errors import ParameterError
from rover_pin.estimation.covariance import own_share
from rover_pin.estimation.problem import Problem
from rover_pin.measurements.channel import Evidence

REMEDY = {
    "r": "a ruler tells it",
    "b": "a ruler tells it",
    "c": "drawbar pull and torque at two loads or more, one at least 1.5 times the other, tell it",
    "phi": "a direct shear test, or drawbar pull and torque at two loads or more with slips up to 1, tell it",
    "k": "a direct shear test, or drawbar pull of a wheel whose radius is many k at slips from 0.02 to 1, tells it",
    "k_1": "sinkage under a known load tells k_1 + k_2 b, and wheels or plates of two widths part the two",
    "k_2": "sinkage under a known load tells k_1 + k_2 b, and wheels or plates of two widths part the two",
    "n": "sinkage under two loads or more tells it",
    "theta_1": "a sinkage measurement tells it, by Eq (5)",
    "theta_2": "stress sensors in the rim, or drawbar pull and torque near slip 0, tell it",
    "exit_ratio": "drawbar pull, torque and sinkage at three loads tell it",
}
"""Which measurement would tell a parameter."""

SAME_LOAD = 1.5
"""Loads within this ratio count as one: they move the share of c in the strength too little."""

INVISIBLE = 1e-3
"""A parameter that moves no prediction by this many SDs over the spread of the starts is not in the data."""

MIN_OWN_SHARE = 1e-5
"""A parameter whose effect is reproduced by others to this share is not distinguished from them."""

MAX_LISTED_PARAMETERS = 2
"""Parameters up to which a refusal lists what the data tell instead."""


def refuse_untold(problem: Problem, starts: Sequence[np.ndarray]) -> None:
    """Refuse a free parameter that these channels cannot tell, whatever their noise; one with a prior may stay.

    Raises
    ------
    ParameterError
        The parameter, why, and which measurement would tell it.
    """
    free = [name for name in problem.space.names if name not in problem.priors]
    sets = cast(Sequence[Evidence], problem.data)
    for name in free:
        _refuse_kind(name, sets)
    _refuse_pairs(free, sets)
    _refuse_numerically(problem, starts)


def advice(name: str) -> str:
    """Return the end of a refusal: what would tell the parameter, or how to keep it."""
    return f"{REMEDY[name]}; or state a prior for it, or leave it out of `free`."


def _refuse_kind(name: str, data: Sequence[Evidence]) -> None:
    if not any(name in evidence.tells for evidence in data):
        data_kinds = " and ".join(sorted({evidence.data_kind for evidence in data}))
        identifiable = sorted(frozenset().union(*(evidence.tells for evidence in data)))
        hint = f", which tells {', '.join(identifiable)} only" if 0 < len(identifiable) <= MAX_LISTED_PARAMETERS else ""
        raise ParameterError(f"{name} is not identifiable from {data_kinds}{hint}: {advice(name)}")


def _refuse_pairs(free: Sequence[str], data: Sequence[Evidence]) -> None:
    loads = np.concatenate([evidence.loads for evidence in data])
    if {"c", "phi"} <= set(free) and (loads.size == 0 or loads.max() < SAME_LOAD * loads.min()):
        reason = f"all runs carry about {np.median(loads):.3g} N" if loads.size else "no load is known"
        raise ParameterError(f"c and phi are not identifiable together from one load ({reason}): {advice('c')}")
    widths = {float(evidence.wheel.b) for evidence in data}
    if {"k_1", "k_2"} <= set(free) and len(widths) == 1:
        raise ParameterError(
            f"k_1 and k_2 are not identifiable together from one wheel width ({widths.pop():g} m): {advice('k_1')}"
        )


def _refuse_numerically(problem: Problem, starts: Sequence[np.ndarray]) -> None:
    """Refuse by the Jacobian, where it says the same at every start."""
    spread = np.array([axis.coordinate.spread for axis in problem.space.axes])
    jacobians = [matrix for u in starts if np.isfinite(matrix := problem.evaluate(u)[1] * spread).all()]
    for index, name in enumerate(problem.space.names):
        if not jacobians or name in problem.priors:
            continue
        if max(np.abs(jacobian[:, index]).max() for jacobian in jacobians) < INVISIBLE:
            raise ParameterError(
                f"{name} is not identifiable: it moves nothing in {measured_channels(problem)}; {advice(name)}"
            )
        if max(own_share(jacobian, index) for jacobian in jacobians) < MIN_OWN_SHARE:
            raise ParameterError(
                f"{name} is not identifiable from {measured_channels(problem)}: other free parameters do the same; "
                f"{advice(name)}"
            )


def measured_channels(problem: Problem) -> str:
    """Return the names of the measured channels, as a sentence says them."""
    return " and ".join(dict.fromkeys(channel.name for evidence in problem.data for channel in evidence.channels))
