"""Fitted parameters with their 95 % intervals, and the profile of chi2 along the parameters of an added effect."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation import wording
from rover_pin.estimation.fit import Fit, fit
from rover_pin.estimation.profile import CLEAR_SDS, NORMAL_95, Profile

MAX_DEVIATION = 5.0
"""Largest deviation of a fitted parameter from its declared value, in declared SDs, that is accepted.

With a larger deviation the fit contradicts the declaration, and the base model is called inadequate. The limit is wide
because declared SDs are rough (assumed)."""
PROFILE_POINTS = (-1.5, -1.0, -0.5, 0.5, 1.0, 1.5)
"""Points at which a profile of chi2 is computed: distances from the optimum, in units of half the width of the 95 %
interval. Points at 1 and -1 lie at the ends of the interval, and points at 1.5 and -1.5 show whether chi2 keeps rising
beyond the interval."""
BOUND_TOLERANCE = 1e-6
"""Maximum distance from a bound (in u) of a parameter that counts as at its bound; it only covers rounding."""


MIN_NARROWING = 2.0
"""Smallest narrowing of a parameter's prior interval by the data at which the parameter counts as determined by them.

With a smaller factor, the interval mainly repeats the assumed or declared value, so that the value is no measurement.
The limit is assumed: at a factor of 2, the data contribute three quarters of the information on the parameter."""


class Number(NamedTuple):
    """A fitted parameter of a model with its 95 % interval [SI], as reports and verdict.json show it."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    drift: float
    """deviation of the fitted value from the declared or assumed value, in prior SDs; NaN for a parameter without a
    prior"""
    closed: bool = True
    """whether the data limit both ends of the interval; if not, at least one end is a bound of the parameter"""
    at_bound: bool = False
    """whether the fitted value lies at a bound of the parameter"""
    prior: str = ""
    """declared or assumed value with its SD, in words; empty for a parameter without a prior"""
    covered: float = 0.0
    """Length of the interval divided by the length of the parameter's allowed range, both in the coordinate u [-]: near
    0 for a parameter that the data determine well, 1 if the interval covers the whole range, and 0 for an unbounded
    parameter. From MAX_COVERED_SHARE on, the interval is not compared with other measurements."""
    declared: bool = False
    """whether the prior came with the data; if not, the prior is assumed"""
    source: str = ""
    """origin of the declared or assumed value, in words"""
    narrowed: float = math.inf
    """length of the 95 % interval of the prior (within the bounds) divided by the length of the fitted interval, both
    in the coordinate u [-]; infinite for a parameter without a prior"""

    @property
    def is_determined(self) -> bool:
        """Whether the data determine the parameter: they limit both ends of its interval, and narrow its prior at least
        MIN_NARROWING times.
        """
        return self.closed and self.narrowed >= MIN_NARROWING

    @property
    def note(self) -> str:
        """Remark on the interval: "at its bound" if the value lies at a bound, "not determined by these data" if the
        data do not limit both ends or hardly narrow the prior, otherwise empty.
        """
        return "at its bound" if self.at_bound else "" if self.is_determined else "not determined by these data"

    @property
    def interval(self) -> str:
        """Value with its 95 % interval and unit, as text."""
        return wording.interval(self.value, self.low, self.high, self.unit)

    @property
    def text(self) -> str:
        """The parameter as one line of a report: name, value with interval, remark, and the deviation from the prior if
        this deviation exceeds CLEAR_SDS.
        """
        line = f"{self.name} = {self.interval}"
        line += f", {self.note}" if self.note else ""
        return line if not abs(self.drift) > CLEAR_SDS else f"{line}, {self.away}"

    @property
    def away(self) -> str:
        """Deviation of the fitted value from the declared or assumed one, in words."""
        return f"{self.drift:+.1f} SD from what was {'declared' if self.declared else 'assumed'}"

    def as_dict(self) -> dict[str, Any]:
        """Return the parameter as plain values for JSON."""
        return {**self._asdict(), "is_determined": self.is_determined, "note": self.note}


def assumed_lines(numbers: Sequence[Number]) -> list[str]:
    """Return texts that list the assumed priors of parameters, one text for each source; declared priors are not
    listed.
    """
    by_source: dict[str, list[str]] = {}
    for number in numbers:
        if number.prior and not number.declared:
            by_source.setdefault(number.source, []).append(f"{number.name} {number.prior}")
    return [f"{source or 'assumed'}: {', '.join(names)}" for source, names in by_source.items()]


def implausible(fitted: Fit) -> tuple[str, ...]:
    """Return the parameters whose fitted values contradict their declared values, each as a text with name and
    deviation.

    A fitted value contradicts the declared value if it deviates by more than MAX_DEVIATION declared SDs. Assumed values
    cannot be contradicted.
    """
    rows = zip(fitted.parameters, fitted.u, strict=True)
    return tuple(
        f"{parameter.name} {u:+.1f} SD"
        for parameter, u in rows
        if parameter.prior and parameter.declared and abs(u) > MAX_DEVIATION
    )


def profiles(fitted: Fit, names: tuple[str, ...]) -> tuple[Profile, ...]:
    """Return the profile of chi2 along each of the named parameters, which shows how sharply the data determine it.

    A profile is the rise of chi2 above its minimum at several values of one parameter, while all other parameters are
    fitted again. The rise is divided by the noise's inflation and by a misfit above 1, so that 3.84 is the rise at the
    end of a 95 % interval. The refits start from the linear model and use the derivatives of the fit. The rise is NaN
    if a refit does not converge.
    """
    unit_of, spread, found = fitted.task.experiment.quantity, fitted.covariance, []
    for name in names:
        at = [parameter.name for parameter in fitted.parameters].index(name)
        parameter = fitted.parameters[at]
        # Half the width of the interval, from the SD that also counts the scatter between runs.
        half = NORMAL_95 * float(fitted.spread[at])
        reach = np.clip([fitted.u[at] + share * half for share in PROFILE_POINTS], *parameter.bounds)
        points = {float(fitted.u[at]): 0.0}
        # Points beyond a bound are clipped onto it and coincide; each point is refitted once.
        others = tuple(free_parameter for i, free_parameter in enumerate(fitted.parameters) if i != at)
        for u in dict.fromkeys(map(float, reach)):
            if u in points:
                continue
            # The refit starts where the linear model expects the minimum of the other parameters.
            start = np.delete(fitted.u + spread[:, at] / spread[at, at] * (u - fitted.u[at]), at)
            fixed_model = fitted.task.experiment.with_values(fitted.model, {name: parameter.value(u)})
            try:
                refitted = fit(fitted.task, fixed_model, others, start, fitted.slopes, reuse=True)
            except OptimisationError:
                points[u] = math.nan
                continue
            # The held parameter is no longer part of the refit, so that its own prior is added here.
            prior = u**2 if parameter.prior else 0.0
            inflation = fitted.task.noise.inflation * max(fitted.misfit, 1.0)
            points[u] = (refitted.chi2 + prior - fitted.chi2) / inflation
        us = sorted(points)
        unit = unit_of(fitted.model, name).unit
        found.append(Profile(name, unit, tuple(parameter.value(u) for u in us), tuple(points[u] for u in us)))
    return tuple(found)
