"""The fitted numbers of a model with their 95 % intervals, and the shape of chi2 along those of what was added."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation import wording
from rover_pin.estimation.fit import Fit, fit
from rover_pin.estimation.profile import CLEAR, NORMAL_95, Profile

AWAY = 5.0
"""Prior SDs beyond which a number has left what is declared of it. Why: declared SDs are rough (assumed)."""
SHARES = (-1.5, -1.0, -0.5, 0.5, 1.0, 1.5)
"""Points of a profile about an optimum, as shares of half the 95 % interval."""
AT_BOUND = 1e-6
"""A number this near to a bound, in u, stands at it."""


class Number(NamedTuple):
    """One fitted number of a model with its 95 % interval [SI]."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    drift: float
    "distance from what was declared or assumed, in its SDs; NaN where nothing was"
    closed: bool = True
    "whether the data close both ends of the interval"
    at_bound: bool = False
    prior: str = ""
    "what was declared or assumed of it, in words"
    covered: float = 0.0
    "share of what is allowed of it, in u, that the interval covers; 0 where that is unbounded"
    declared: bool = False
    "whether what was known of it came with the data; else it is assumed"
    source: str = ""
    "who declared or assumed it"

    @property
    def note(self) -> str:
        """What is to be known of it besides."""
        return "at its bound" if self.at_bound else "" if self.closed else "not closed by the data"

    @property
    def interval(self) -> str:
        """Its value with its 95 % interval, in words."""
        return wording.interval(self.value, self.low, self.high, self.unit)

    @property
    def text(self) -> str:
        """One line for a reader."""
        line = f"{self.name} = {self.interval}"
        line += f", {self.note}" if self.note else ""
        return line if not abs(self.drift) > CLEAR else f"{line}, {self.away}"

    @property
    def away(self) -> str:
        """How far it ended from what was known of it beforehand, in words."""
        return f"{self.drift:+.1f} SD from what was {'declared' if self.declared else 'assumed'}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {**self._asdict(), "note": self.note}


def assumed_lines(numbers: Sequence[Number]) -> list[str]:
    """Return what was assumed of numbers before they were fitted, a line for each source."""
    by_source: dict[str, list[str]] = {}
    for number in numbers:
        if number.prior and not number.declared:
            by_source.setdefault(number.source, []).append(f"{number.name} {number.prior}")
    return [f"{source or 'assumed'}: {', '.join(names)}" for source, names in by_source.items()]


def implausible(fitted: Fit) -> tuple[str, ...]:
    """Return the numbers that had to leave what is declared of them; what is assumed contradicts nobody."""
    rows = zip(fitted.parameters, fitted.u, strict=True)
    return tuple(
        f"{parameter.name} {u:+.1f} SD"
        for parameter, u in rows
        if parameter.prior and parameter.declared and abs(u) > AWAY
    )


def profiles(fitted: Fit, names: tuple[str, ...]) -> tuple[Profile, ...]:
    """Return the profiles of these parameters: rise of chi2 over the noise's inflation and a misfit above 1.

    The others descend from where a linear model puts them, with the slopes of the fit; NaN where they do not settle.
    """
    return tuple(_profile(fitted, [parameter.name for parameter in fitted.parameters].index(name)) for name in names)


def _profile(fitted: Fit, at: int) -> Profile:
    parameter, spread = fitted.parameters[at], fitted.covariance
    half = NORMAL_95 * float(fitted.spread[at])
    reach = np.clip([fitted.u[at] + share * half for share in SHARES], *parameter.bounds)
    points = {float(fitted.u[at]): 0.0}
    for u in dict.fromkeys(map(float, reach)):
        if u not in points:
            points[u] = _rise(fitted, at, u, spread[:, at] / spread[at, at])
    us = sorted(points)
    unit = fitted.task.experiment.quantity(fitted.model, parameter.name).unit
    return Profile(parameter.name, unit, tuple(parameter.value(u) for u in us), tuple(points[u] for u in us))


def _rise(fitted: Fit, at: int, u: float, direction: np.ndarray) -> float:
    """Return how far chi2 rises where one parameter is held at u; NaN where the others do not settle."""
    parameter = fitted.parameters[at]
    start = np.delete(fitted.u + direction * (u - fitted.u[at]), at)
    others = tuple(free_parameter for i, free_parameter in enumerate(fitted.parameters) if i != at)
    fixed_model = fitted.task.experiment.with_values(fitted.model, {parameter.name: parameter.value(u)})
    try:
        refitted = fit(fitted.task, fixed_model, others, start, fitted.slopes, reuse=True)
    except OptimisationError:
        return math.nan
    prior = u**2 if parameter.prior else 0.0
    return (refitted.chi2 + prior - fitted.chi2) / (fitted.task.noise.inflation * max(fitted.misfit, 1.0))
