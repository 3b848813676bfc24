"""The shape of chi2 along one parameter, all others refitted: what its interval alone does not show."""

from __future__ import annotations

import numpy as np

from rover_pin.errors import OptimisationError
from rover_pin.estimation.covariance import covariance
from rover_pin.estimation.profile import Best, LowerMinimum, Profile, rise
from rover_pin.experiments.wheel_rig.calibrate import Fitted
from rover_pin.experiments.wheel_rig.fit import RigFit

REACH = (0.4, 0.75, 1.0, 1.35)
"""Points on each side, as multiples of the distance to that end of the 95 % interval."""


def profiles(fit: RigFit, fitted: tuple[Fitted, ...]) -> tuple[Profile, ...]:
    """Return the profile of every free parameter, from a third beyond one end of its interval to beyond the other."""
    best = Best(fit.u, fit.chi2, covariance(fit.problem, fit.u))
    return tuple(_profile(fit, best, index, one) for index, one in enumerate(fitted))


def _profile(fit: RigFit, best: Best, index: int, one: Fitted) -> Profile:
    axis = fit.problem.space.axes[index]
    centre = float(best.u[index])
    points = {centre: 0.0}
    for end in (one.low, one.high):
        guess = best.u
        for x in _outwards(centre, axis.coordinate.u(end), (axis.low, axis.high)):
            try:
                z, guess = rise(fit.problem, best, index, x, guess)
            except (OptimisationError, LowerMinimum):
                z = float("nan")
            points[x] = z**2
    xs = sorted(points)
    return Profile(one.name, one.unit, tuple(float(axis.coordinate.value(x)) for x in xs), tuple(points[x] for x in xs))


def _outwards(centre: float, end: float, bounds: tuple[float, float]) -> list[float]:
    """Return points of one side, the nearest first, none beyond a bound."""
    xs = np.clip([centre + share * (end - centre) for share in REACH], *bounds)
    return [float(x) for x in dict.fromkeys(xs) if x != centre]
