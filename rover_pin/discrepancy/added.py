"""Fits with causes that are added to what was fitted, or with a part of them."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.discrepancy.option import Option, singles
from rover_pin.discrepancy.signature import Signature, signatures
from rover_pin.estimation.fit import Fit, fit
from rover_pin.inference.cause import Cause
from rover_pin.inference.linear_hypothesis import LinearHypothesis

FIRST, LAST = 0.08, 0.02
"""First and last step by which an edge of a stretch of the way is moved [m]; half a second's drive is 0.025 m."""
SMALL = 0.1
"""Share of its first size from which a cause is fitted again, where it did not do better than none."""


def fitted_with(
    estimate: LinearHypothesis, options: Mapping[str, Option], reuse: bool
) -> tuple[tuple[Cause, ...], Fit] | None:
    """Return a set fitted from about a fit of some of it, slopes computed anew or those that are known used."""
    start, u_added = estimate.fit, estimate.posterior.mean[len(estimate.parameters) - len(estimate.extra) :]
    experiment, model = start.task.experiment, start.model
    causes = [cause for cause in estimate.causes if cause.name not in estimate.added]
    numbers, u, slopes = list(start.parameters), list(start.u), dict(start.slopes)
    first = len(numbers)
    for name, size in zip(estimate.added, u_added, strict=True):
        signature = place_edges(start, options[name])
        cause = signature.candidate.cause
        model = experiment.with_values(cause.on(model), signature.start_numbers(float(size)))
        for released in [number for number in numbers if number.name in cause.amplitudes]:
            at = numbers.index(released)
            numbers.pop(at), u.pop(at), slopes.pop(released.name)
            first -= 1
        numbers += cause.parameters
        u += [number.u(experiment.value(model, number.name)) for number in cause.parameters]
        causes.append(replace(cause, name=name))
    try:
        fitted = fit(start.task, model, numbers, np.array(u), slopes, reuse)
        if fitted.chi2 > start.chi2:
            small = [x * SMALL if at >= first and not numbers[at].log else x for at, x in enumerate(u)]
            attempt = fit(start.task, model, numbers, np.array(small), slopes, reuse)
            fitted = min(fitted, attempt, key=lambda ending: ending.chi2)
    except OptimisationError:
        return None
    return tuple(causes), fitted


def place_edges(start: Fit, option: Option) -> Signature:
    """Return a cause with a place on the way where moving neither of its edges gains; others as they are.

    Which stretch of the way differs is not found by following slopes: an edge acts only where something passes it.
    """
    signature, step, gain = option.signature, FIRST, -math.inf
    while step > LAST and (neighbours := start.task.experiment.neighbours(signature.candidate, step)):
        rows = signatures(start, [*neighbours, *([signature.candidate] if gain == -math.inf else [])])
        gains = singles(start, rows)
        best = int(np.argmax(gains))
        if gains[best] > gain:
            signature, gain = rows[best], gains[best]
        else:
            step /= 2
    return signature


def part_of(base: Fit, whole: LinearHypothesis, part: frozenset[str]) -> tuple[tuple[Cause, ...], Fit | None]:
    """Return some causes of a set fitted from where the set is best; None where no fit ends."""
    causes = tuple(cause for cause in whole.causes if cause.name in part)
    added = [parameter for cause in causes for parameter in cause.parameters]
    others = [number for number in base.parameters if number.name not in {parameter.name for parameter in added}]
    numbers, model = (*others, *added), base.model
    for cause in causes:
        model = cause.on(model)
    u = np.array([number.u(whole.fit.value(number.name)) for number in numbers])
    slopes = {number.name: whole.fit.slopes[number.name] for number in whole.fit.parameters if number in numbers}
    try:
        return causes, fit(base.task, model, numbers, u, slopes)
    except OptimisationError:
        return causes, None
