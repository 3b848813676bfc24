"""The verdict on one free parameter: found, held at its prior, or not identified by the data."""

from __future__ import annotations

import math

import numpy as np

from rover_pin.estimation.problem import Problem
from rover_pin.estimation.profile import Best, Interval
from rover_pin.identification.identifiability import REMEDY, measured_channels
from rover_pin.identification.result import Estimate, Verdict

OWN_SHARE = 0.5
"""A parameter with a prior is found where the data give at least this share of its information, 1 / SD^2."""


def judge(problem: Problem, best: Best, index: int, interval: Interval, misfit: float) -> Estimate:
    """Return the estimate of one free parameter from its profile interval, of a problem widened by `misfit`."""
    axis = problem.space.axes[index]
    verdict, reason = _verdict(problem, best, index, interval)
    if verdict is Verdict.FOUND and misfit > 1:
        reason += ", if what the model misses does not move it"
    value = float(problem.space.values(best.u)[index])
    ends = np.clip([axis.coordinate.value(end) for end in interval[:2]], axis.quantity.low, axis.quantity.high)
    return Estimate(
        name=axis.name,
        unit=axis.quantity.unit,
        value=math.nan if verdict is Verdict.NOT_IDENTIFIABLE else value,
        sd=math.sqrt(best.covariance[index, index]) * float(problem.space.slopes(best.u)[index]),
        low=float(ends[0]),
        high=float(ends[1]),
        verdict=verdict,
        reason=reason,
    )


def _verdict(problem: Problem, best: Best, index: int, interval: Interval) -> tuple[Verdict, str]:
    axis = problem.space.axes[index]
    from_here = measured_channels(problem)
    prior, closed = problem.priors.get(axis.name), interval.closed_low and interval.closed_high
    if prior is not None:
        sd = math.sqrt(best.covariance[index, index]) * float(problem.space.slopes(best.u)[index])
        share = 1 - (sd / prior.sd) ** 2
        if share < OWN_SHARE:
            return (
                Verdict.HELD_AT_PRIOR,
                f"held at prior: {from_here} give {max(share, 0.0):.0%} of what is known of it",
            )
    elif problem.priors and closed and (share := data_share(problem, best, index)) < OWN_SHARE:
        why = f"its interval would be {math.sqrt(share):.0%} as wide were {' and '.join(problem.priors)} exact"
        return Verdict.HELD_AT_PRIOR, f"set by the prior of {' and '.join(problem.priors)}: {why}"
    wide = interval.high - interval.low > axis.coordinate.widest
    pinned = [
        problem.space.names[parameter_index]
        for parameter_index in interval.pinned
        if problem.space.names[parameter_index] != axis.name
    ]
    if closed and not wide and not pinned:
        return Verdict.FOUND, f"found{_given(problem, axis.name)}"
    why = "the 95 % interval is too wide to call it found"
    if pinned:
        why = f"the 95 % interval ends where {' and '.join(pinned)} meets its own bound, not where the data end it"
    if not closed:
        ends = [end for end, closed in (("lower", interval.closed_low), ("upper", interval.closed_high)) if not closed]
        why = f"the 95 % interval is open at its {' and '.join(ends)} bound"
    return Verdict.NOT_IDENTIFIABLE, f"not identifiable from {from_here}: {why}; {REMEDY[axis.name]}"


def data_share(problem: Problem, best: Best, index: int) -> float:
    """Return the share of a parameter's variance that is left where those with priors are known exactly, in [0, 1].

    1 / SD^2 is then the squared length of what the columns of the parameters without priors leave of its column.
    """
    jacobian = problem.data_jacobian(best.u)
    free = [at for at, name in enumerate(problem.space.names) if at != index and name not in problem.priors]
    column, others = jacobian[:, index], jacobian[:, free]
    residual = column - others @ np.linalg.lstsq(others, column, rcond=1e-10)[0]
    return 1.0 / max(float(residual @ residual * best.covariance[index, index]), 1.0)


def _given(problem: Problem, name: str) -> str:
    others = [prior_name for prior_name in problem.priors if prior_name != name]
    return f", given the prior of {' and '.join(others)}" if others else ""
