"""What a fit found, and what it could not tell."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.public import brief
from rover_pin.contact import Soil
from rover_pin.estimation.wording import in_words, spread
from rover_pin.measurements.channel import Evidence


class Verdict(Enum):
    """What may be said of a free parameter."""

    FOUND = "found"
    HELD_AT_PRIOR = "held at prior"
    NOT_IDENTIFIABLE = "not identifiable"
    DEPENDS = "depends on"


@brief
class Estimate(NamedTuple):
    """One free parameter, in SI."""

    name: str
    unit: str
    value: float
    "best value; NaN where the data do not tell it"
    sd: float
    "standard deviation from the local covariance, priors included"
    low: float
    "lower end of the 95 % profile interval, or the parameter's bound where the data do not close it"
    high: float
    "upper end"
    verdict: Verdict
    reason: str
    "a sentence"
    depends_on: tuple[str, ...] = ()
    "the held numbers that move it out of its interval within their ranges"
    measured: tuple[str, ...] = ()
    "those of them whose range is a measurement's or was declared, not assumed"

    @property
    def verdict_text(self) -> str:
        """The verdict in words, with the names of what it depends on."""
        words = {name: name for name in self.depends_on}
        return " ".join((self.verdict.value, describe_dependence(words, self.measured))).rstrip()


def describe_dependence(words: Mapping[str, str], measured: Sequence[str]) -> str:
    """Return what a number depends on, name -> words: those that were assumed, then those that were measured."""
    parts = []
    for kind, is_measured in (("assumed", False), ("measured", True)):
        names = [text for name, text in words.items() if (name in measured) == is_measured]
        parts += [f"the {kind} {' and '.join(names)}"] if names else []
    return " and ".join(parts)


Change = Mapping[str, float] | Callable[[], Evidence | Sequence[Evidence]]
"""Numbers of wheel and soil, or the data worked out again."""


class Held(NamedTuple):
    """A number that a fit holds, in SI."""

    name: str
    unit: str
    value: float
    source: str
    "where the value is from"
    low: float
    "lower end of the range in which it may be wrong, 95 %"
    high: float
    doubt: str
    "where the range is from"
    ends: tuple[Change, Change] = (MappingProxyType({}), MappingProxyType({}))
    "what changes at either end"
    measured: bool = False
    "whether the range is a measurement's, or declared"


class Assumed(NamedTuple):
    """A number that was held, and what the free ones become at the ends of its range."""

    fixed: Held
    refitted: Mapping[str, tuple[float, float]]
    "free name -> values refitted at either end, NaN where nothing fits; empty where it moves no prediction"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values; SI units."""
        row = {name: value for name, value in self.fixed._asdict().items() if name != "ends"}
        return {**row, "moves": {name: list(ends) for name, ends in self.refitted.items()}}

    def line(self, units: Mapping[str, str]) -> str:
        """Return the number, its source, its range and what that moves, as text; `units` are those of the free."""
        fixed = self.fixed
        text = f"{fixed.name} = {with_unit((fixed.value,), fixed.unit)} ({fixed.source})"
        if fixed.low == fixed.high:
            return f"{text}: {fixed.doubt}"
        text += f", {with_unit((fixed.low, fixed.high), fixed.unit)} ({fixed.doubt})"
        moves = [f"{name} {with_unit(ends, units[name])}" for name, ends in self.refitted.items()]
        return f"{text}: {'; '.join(moves) or 'does not enter these data'}"


class ChannelFit(NamedTuple):
    """How well one channel of one data set is met."""

    name: str
    unit: str
    points: int
    rmse: float
    "root of the mean squared residual, in the channel's unit"
    chi2: float
    "sum of squared residuals in standard deviations"
    set: str = ""
    "the name of the data set, where there are several"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values; the set where there are several."""
        row = self._asdict()
        return row if self.set else {name: value for name, value in row.items() if name != "set"}

    def line(self) -> str:
        """Return how well it is met, as text."""
        rmse, whose = f"{self.rmse:.3g} {self.unit}".rstrip(), f"{self.set}: " if self.set else ""
        return f"{whose}{self.name}: RMSE {rmse} over {self.points} points, chi2 {self.chi2:.4g}"


class Starts(NamedTuple):
    """How the starts of a fit ended."""

    tried: int
    converged: int
    agreed: int
    "ended at the lowest chi2, within 0.01"
    others: tuple[tuple[float, dict[str, float]], ...]
    "chi2 and values of the other minima"


@brief
@dataclass(frozen=True, eq=False)
class Identification:
    """The result of `identify`.

    `soil` is the best fit, with held parameters as given: it reproduces the data, and says nothing about a parameter
    whose verdict is not found. `singular_values` are of the data's Jacobian (no priors) in SDs of the data per spread
    of the starts: 1 / s is the SD along the direction in the same row of `directions`.
    """

    estimates: tuple[Estimate, ...]
    correlation: np.ndarray = field(repr=False)
    singular_values: np.ndarray = field(repr=False)
    directions: np.ndarray = field(repr=False)
    channels: tuple[ChannelFit, ...]
    chi2: float
    "of the data and the priors"
    freedom: int
    misfit: float
    "factor by which SDs and intervals are widened, 1 where the model meets the data within their noise"
    starts: Starts
    soil: Soil
    fixed: tuple[Assumed, ...] = ()
    "what was not free, as `with_held` found it; empty where it was not asked"

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of a free parameter."""
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise ParameterError(f"'{name}' was not free: {closest(name, [estimate.name for estimate in self.estimates])}")

    @property
    def identified(self) -> tuple[str, ...]:
        """Names of the parameters that the data tell."""
        return tuple(estimate.name for estimate in self.estimates if estimate.verdict is Verdict.FOUND)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain values, for JSON; SI units."""
        rows = {
            estimate.name: {
                "value": estimate.value,
                "sd": estimate.sd,
                "low": estimate.low,
                "high": estimate.high,
                "unit": estimate.unit,
                "verdict": estimate.verdict_text,
                "reason": estimate.reason,
                "depends_on": list(estimate.depends_on),
            }
            for estimate in self.estimates
        }
        return {
            "parameters": rows,
            "correlation": self.correlation.tolist(),
            "singular_values": self.singular_values.tolist(),
            "chi2": self.chi2,
            "freedom": self.freedom,
            "misfit": self.misfit,
            "channels": [channel.as_dict() for channel in self.channels],
            "held": [assumed.as_dict() for assumed in self.fixed],
        }

    def report(self) -> str:
        """Return the whole result as text; angles in degrees."""
        lines = [_line(estimate) for estimate in self.estimates]
        lines += [f"chi2 = {self.chi2:.4g} at {self.freedom} degrees of freedom"]
        if self.misfit > 1:
            lines += [
                f"the model misses the data by more than their noise: SDs and intervals are widened {self.misfit:.3g} "
                "times, and hold only if the missing effect does not move the parameters"
            ]
        lines += [f"  {channel.line()}" for channel in self.channels]
        lines += [f"weakest combination: {self._weakest()}", *self._strong_correlations(), self._starts()]
        return "\n".join([*lines, *self._held()])

    def _held(self) -> list[str]:
        units = {estimate.name: estimate.unit for estimate in self.estimates}
        head = (
            ["held, each with its source and 95 % range, and what the free ones become at the ends of that:"]
            if self.fixed
            else []
        )
        return [*head, *(f"  {assumed.line(units)}" for assumed in self.fixed)]

    def _weakest(self) -> str:
        names = [estimate.name for estimate in self.estimates]
        parts = [f"{share:+.2f} {name}" for share, name in zip(self.directions[-1], names, strict=True)]
        return f"{' '.join(parts)}, singular value {self.singular_values[-1]:.3g}"

    def _strong_correlations(self) -> list[str]:
        names = [estimate.name for estimate in self.estimates]
        pairs = [(i, j) for i in range(len(names)) for j in range(i) if abs(self.correlation[i, j]) > 0.95]
        return [f"correlation of {names[j]} and {names[i]}: {self.correlation[i, j]:.4f}" for i, j in pairs]

    def _starts(self) -> str:
        text = f"{self.starts.agreed} of {self.starts.tried} starts agree"
        for chi2, values in self.starts.others:
            text += f"; another minimum at chi2 = {chi2:.4g}: " + ", ".join(f"{n} = {v:.4g}" for n, v in values.items())
        return text


def _line(estimate: Estimate) -> str:
    factor, unit = _in_report(estimate.unit)
    value, sd, low, high = (factor * x for x in (estimate.value, estimate.sd, estimate.low, estimate.high))
    interval = f"95 % in [{low:.4g}, {high:.4g}]"
    if estimate.verdict is Verdict.NOT_IDENTIFIABLE:
        return f"{estimate.name}: {interval} {unit}: {estimate.reason}"
    return f"{estimate.name} = {value:.4g}{spread(sd, value)} {unit}, {interval}: {estimate.reason}"


def with_unit(values: Sequence[float], unit: str) -> str:
    """Return a number, or the ends of a range, in the unit of a report."""
    factor, name = _in_report(unit)
    texts = [f"{factor * value:.4g}" if math.isfinite(value) else "no fit" for value in values]
    return f"{' to '.join(texts)} {name}".rstrip()


def _in_report(unit: str) -> tuple[float, str]:
    """Return the factor to, and the name of, the unit of a report: SI, but degrees."""
    return in_words(unit) if unit == "rad" else (1.0, unit)
