"""The shape of chi2 along the numbers of what was added, all others fitted again."""

from __future__ import annotations

import numpy as np

from rover_pin.estimation.fit import Fit, fit
from rover_pin.estimation.profile import NORMAL_95, Profile

SHARES = (-1.5, -1.0, -0.5, 0.5, 1.0, 1.5)
"""Points of a profile, as shares of half the 95 % interval."""


def profiles(fitted: Fit, names: tuple[str, ...]) -> tuple[Profile, ...]:
    """Return the profiles of these parameters: rise of chi2 over the noise's inflation and a misfit above 1.

    The others descend from where a linear model puts them, with the slopes of the fit.
    """
    return tuple(_profile(fitted, [one.name for one in fitted.parameters].index(name)) for name in names)


def _profile(fitted: Fit, at: int) -> Profile:
    one, spread = fitted.parameters[at], fitted.covariance
    half = NORMAL_95 * float(fitted.spread[at])
    reach = np.clip([fitted.u[at] + share * half for share in SHARES], *one.bounds)
    points = {float(fitted.u[at]): 0.0}
    for u in dict.fromkeys(map(float, reach)):
        if u not in points:
            points[u] = _rise(fitted, at, u, spread[:, at] / spread[at, at])
    us = sorted(points)
    unit = fitted.task.experiment.quantity(fitted.model, one.name).unit
    return Profile(one.name, unit, tuple(one.value(u) for u in us), tuple(points[u] for u in us))


def _rise(fitted: Fit, at: int, u: float, direction: np.ndarray) -> float:
    """Return how far chi2 rises where one parameter is held at u."""
    one = fitted.parameters[at]
    start = np.delete(fitted.u + direction * (u - fitted.u[at]), at)
    others = tuple(each for i, each in enumerate(fitted.parameters) if i != at)
    held = fitted.task.experiment.with_values(fitted.model, {one.name: one.value(u)})
    found = fit(fitted.task, held, others, start, fitted.slopes, reuse=True)
    prior = u**2 if one.prior else 0.0
    return (found.chi2 + prior - fitted.chi2) / (fitted.task.noise.inflation * max(fitted.misfit, 1.0))
