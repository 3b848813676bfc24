"""Profile likelihood: how far one parameter can move while the others do their best to keep the fit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation.descent import LeastSquares, descend

NORMAL_95 = 1.959964
"""Root of the rise in chi2 that bounds a 95 % interval of one parameter."""

TRIES = 60
JUMP = 0.01
"""A bracket this narrow, relative to its distance, is a jump of chi2, or came from a refit that went astray."""

AT_BOUND = 1e-4
"""A parameter this near to a bound, relative to its range, stands at it."""

CLOSE = 3e-3
"""How near, relative to the interval's half width, an end is found."""


class Best(NamedTuple):
    """A minimum and its local covariance in u."""

    u: np.ndarray
    chi2: float
    covariance: np.ndarray


class Interval(NamedTuple):
    """A 95 % interval in u; an end that chi2 does not close is the parameter's bound.

    `pinned` are the other parameters that stand at a bound of theirs at an end that chi2 closes: without that bound the
    interval would reach further.
    """

    low: float
    high: float
    closed_low: bool
    closed_high: bool
    pinned: tuple[int, ...] = ()


class Profile(NamedTuple):
    """The rise of chi2 above its least, at values of one parameter [SI]; NaN where a refit did not settle."""

    name: str
    unit: str
    values: tuple[float, ...]
    rises: tuple[float, ...]


class LowerMinimum(Exception):
    """A refit found a lower chi2 than the fit: the fit was at another minimum. Internal; `u` is the better point."""

    def __init__(self, u: np.ndarray):
        super().__init__("a profile found a lower minimum")
        self.u = u


def interval(problem: LeastSquares, best: Best, index: int) -> Interval:
    """Return where chi2 has risen by 1.96^2 on both sides, with all other parameters refitted.

    Raises
    ------
    LowerMinimum
        chi2 fell below the fit's on the way.
    OptimisationError
        A refit did not settle.
    """
    (low, closed_low, below), (high, closed_high, above) = (
        _end(problem, best, index, side, NORMAL_95) for side in (-1, 1)
    )
    ends = [u for u, closed in ((below, closed_low), (above, closed_high)) if closed]
    others = [other_index for other_index in range(len(best.u)) if other_index != index]
    pinned = [other_index for other_index in others if any(_at_bound(problem, u, other_index) for u in ends)]
    return Interval(low, high, closed_low, closed_high, tuple(pinned))


def rise(problem: LeastSquares, best: Best, index: int, x: float, guess: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the root of chi2's rise with coordinate `index` at x, refitted, and u; infinite without a prediction."""
    start = guess.copy()
    start[index] = x
    try:
        u, chi2 = descend(problem, start, fixed_index=index)
    except OptimisationError as error:
        if error.status != 0:
            raise
        return np.inf, start
    if chi2 < best.chi2 - 1e-3:
        raise LowerMinimum(u)
    return float(np.sqrt(max(chi2 - best.chi2, 0.0))), u


def _at_bound(problem: LeastSquares, u: np.ndarray, index: int) -> bool:
    low, high = problem.space.low[index], problem.space.high[index]
    tolerance = AT_BOUND * (high - low) if np.isfinite(high - low) else 0.0
    return bool(u[index] <= low + tolerance or u[index] >= high - tolerance)


def _end(problem: LeastSquares, best: Best, index: int, side: int, target: float) -> tuple[float, bool, np.ndarray]:
    """Return one end of the interval, whether chi2 closes it, and u there; a bracketed secant on the rise's root."""
    centre = best.u[index]
    bound = float((problem.space.low, problem.space.high)[side > 0][index])
    sd = float(np.sqrt(best.covariance[index, index]))
    inside, outside, u_inside = (centre, 0.0), None, best.u
    x = _within(centre + side * target * sd, centre, bound)
    for turn in range(TRIES):
        z, u = rise(problem, best, index, x, _follow(problem, best, index, x) if u_inside is best.u else u_inside)
        if abs(z - target) < CLOSE * target:
            return x, True, u
        if z > target:
            outside = (x, z)
        elif x == bound:
            return bound, False, u
        else:
            inside, u_inside = (x, z), u
        if outside is not None and abs(outside[0] - inside[0]) < JUMP * abs(inside[0] - centre):
            z, u = rise(problem, best, index, outside[0], u_inside)
            if z > target:
                return outside[0], True, u
            inside, u_inside, outside = (outside[0], z), u, None
        x = _next(inside, outside, (centre, bound), target, turn)
    raise OptimisationError(
        f"the profile of {problem.space.names[index]} was not followed to its end in {TRIES} refits; "
        "give more starts or free fewer parameters.",
        status=TRIES,
    )


def _next(
    inside: tuple[float, float],
    outside: tuple[float, float] | None,
    limits: tuple[float, float],
    target: float,
    turn: int,
) -> float:
    """Return the next trial: stretch until the target is passed, then secant and middle of the bracket in turn."""
    if outside is None:
        risen = max(inside[1], 0.1 * target)
        stretch = min(1.05 * target / risen, 4.0)
        return _within(limits[0] + stretch * (inside[0] - limits[0]), *limits)
    share = (target - inside[1]) / (outside[1] - inside[1]) if turn % 3 and np.isfinite(outside[1]) else 0.5
    return inside[0] + share * (outside[0] - inside[0])


def _follow(problem: LeastSquares, best: Best, index: int, x: float) -> np.ndarray:
    """Return where the other parameters go, to first order, when one moves to x."""
    along = best.covariance[:, index] / best.covariance[index, index]
    return np.clip(best.u + along * (x - best.u[index]), problem.space.low, problem.space.high)


def _within(x: float, centre: float, bound: float) -> float:
    return float(np.clip(x, min(centre, bound), max(centre, bound)))
