"""Effects that undeclared numbers of the model can imitate, so that the data cannot show them at their usual size.

With the whitened columns A of all uncertain numbers and of an effect's size (derivatives of the residuals per prior
SD), the joint posterior has the precision I + A'A / c, where c is the inflation of the noise. The SD of the size
follows from the inverse. If the undeclared numbers were known, only the declared numbers would be uncertain, and the SD
would be smaller. The error of an input of known SD, such as an estimated terrain, counts as an undeclared number.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rover_pin.discrepancy.signature import Option
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import Noise
from rover_pin.estimation.parameter import Parameter, posterior_covariance
from rover_pin.estimation.profile import CLEAR_SDS, MAJORITY
from rover_pin.estimation.random_effects.random_field import random_effects_filter
from rover_pin.estimation.wording import MAX_LISTED, format_value
from rover_pin.inference.cause import SIZE_SD

MAX_SD_RATIO = 0.9
"""Largest ratio of the SD of a cause's size after the fit to its SD before the fit (its prior SD). Above this ratio, no
detectable size is stated, because it would follow from the prior and not from the data: at the ratio 0.9, the prior
still contributes 81 % of the information on the size (the variance decreases from 1 to 0.81)."""


class Imitator(NamedTuple):
    """An undeclared number that can imitate an effect: its fitted value without the effect, and with the effect."""

    name: str
    """name of the number, or of the input whose error imitates the effect"""
    without: float
    """fitted value without the effect [SI]; NaN for the error of an input"""
    with_effect: float
    """expected value if the effect acts with the size of the `Equivalent` [SI]; NaN for the error of an input"""
    unit: str

    @property
    def text(self) -> str:
        """The imitator in words, with both values if it is a number."""
        if np.isnan(self.without):
            return self.name
        without = format_value(self.without, self.unit)
        return f"{self.name} = {without} alone, or {format_value(self.with_effect, self.unit, self.without)} with it"


class Equivalent(NamedTuple):
    """An effect that may act up to a size, because undeclared numbers of the model can imitate it.

    The data do not show the effect at its usual size, but would show it if the undeclared numbers were known.
    """

    name: str
    """name of the candidate"""
    parameter: str
    """name of its size"""
    size: float
    """smallest size that the data would show at 3 SD, as a deviation from the size at which the effect vanishes [SI]"""
    if_known: float
    """the same size if the undeclared numbers were known [SI]"""
    unit: str
    imitators: tuple[Imitator, ...]
    has_information: bool
    """whether the data narrow the prior of the size noticeably (MAX_SD_RATIO)"""

    @property
    def sentence(self) -> str:
        """The equivalent as a sentence: the size that may act unseen, and the numbers that imitate it."""
        size = format_value(self.size, self.unit)
        imitated = "; ".join(imitator.text for imitator in self.imitators)
        return (
            f"{self.name} may act unseen up to {self.parameter.rpartition('.')[2]} = {size}, because undeclared inputs "
            f"imitate it ({imitated}); if they were declared, the data would show it from "
            f"{format_value(self.if_known, self.unit, self.size)}"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the equivalent as plain values for verdict.json."""
        return {**self._asdict(), "imitators": [imitator._asdict() for imitator in self.imitators]}


def equivalents(fitted: Fit, options: Sequence[Option], named: Sequence[str] = ()) -> tuple[Equivalent, ...]:
    """Return the effects that undeclared numbers can imitate, the effect with the largest loss of precision first.

    An effect is returned if its smallest detectable size (CLEAR_SDS posterior SDs) exceeds its usual size, and would
    not exceed it if the undeclared numbers were known.

    Parameters
    ----------
    fitted : Fit
        Fit of the kept model.
    options : sequence of Option
        The candidates, each at its best place.
    named : sequence of str
        Names of the causes that the kept model contains already.
    """
    noise, parameters = fitted.task.noise, fitted.parameters
    is_known = np.array([parameter.declared or not parameter.prior for parameter in parameters], dtype=bool)
    columns = noise.white(np.array([fitted.slopes[parameter.name] for parameter in parameters]))
    exact = _without_known_errors(noise)
    exact_columns = exact.white(np.array([fitted.slopes[parameter.name] for parameter in parameters]))
    rows = []
    for option in options:
        # A freed number is no effect: whether its declaration holds is another question.
        if option.candidate.released or option.candidate.name in named or option.size.parameters[0].log:
            continue
        number, column = option.size.parameters[0], option.signature.column
        covariance = posterior_covariance(np.vstack([columns, noise.white(column)]), noise.inflation)
        sd, ratio = float(np.sqrt(covariance[-1, -1])), CLEAR_SDS * SIZE_SD
        known = posterior_covariance(np.vstack([exact_columns[is_known], exact.white(column)]), exact.inflation)
        sd_if_known = float(np.sqrt(known[-1, -1]))
        if not (np.isfinite(sd) and ratio * sd > 1.0 >= ratio * sd_if_known):
            continue
        # The error of an input imitates the effect by the part of the SD that vanishes if this input alone is exact.
        if_exact = posterior_covariance(np.vstack([exact_columns, exact.white(column)]), exact.inflation)
        inputs = _imitating_inputs(noise, 1.0 - float(if_exact[-1, -1]) / sd**2)
        size = CLEAR_SDS * sd
        rows.append(
            (
                sd / sd_if_known,
                Equivalent(
                    option.candidate.name,
                    number.name,
                    abs(size * number.scale),
                    abs(CLEAR_SDS * sd_if_known * number.scale),
                    _unit_of(fitted, option),
                    (*_imitating_numbers(fitted, covariance, ~is_known, size), *inputs),
                    sd < MAX_SD_RATIO,
                ),
            )
        )
    return tuple(row for _, row in sorted(rows, key=lambda pair: -pair[0]))


def _without_known_errors(noise: Noise) -> Noise:
    """Return the noise without the random effects whose SDs are known, as if the inputs that they change were exact."""
    effects = noise.random_effects
    if effects is None or not any(row.kind.is_known for row in effects.learnt):
        return noise
    plain = dataclasses.replace(noise, random_effects=None)
    learnt = tuple(row._replace(sd=0.0) if row.kind.is_known else row for row in effects.learnt)
    columns = plain.white(effects.field.moved).T
    return dataclasses.replace(noise, random_effects=random_effects_filter(effects.field, columns, noise.good, learnt))


def _imitating_inputs(noise: Noise, share: float) -> list[Imitator]:
    """Return the inputs of known SD as imitators, if their errors make up the fraction `share` of the variance of the
    size, and this fraction is the larger part.
    """
    effects = noise.random_effects
    if effects is None or share <= MAJORITY:
        return []
    return [Imitator(row.kind.name, np.nan, np.nan, "") for row in effects.learnt if row.kind.is_known]


def _imitating_numbers(fitted: Fit, covariance: np.ndarray, is_open: np.ndarray, size: float) -> list[Imitator]:
    """Return the undeclared numbers that imitate a size best, the best one first, with their values without the effect
    and with an effect of the size `size` (in prior SDs).

    The number with the largest correlation is always returned, and of the others those whose correlation exceeds
    MAJORITY. `covariance` is the posterior covariance of the parameters, followed by the size.
    """
    shared, variances = covariance[:-1, -1], np.diag(covariance)
    correlation = np.where(is_open, np.abs(shared) / np.sqrt(variances[:-1] * variances[-1]), 0.0)
    order = np.argsort(-correlation)[:MAX_LISTED]
    imitators = []
    for place in (at for at in order if correlation[at] > MAJORITY or (at == order[0] and correlation[at] > 0.0)):
        parameter: Parameter = fitted.parameters[place]
        # With the effect, the number moves along the regression of the posterior.
        u, moved = float(fitted.u[place]), float(fitted.u[place] + shared[place] / variances[-1] * size)
        unit = fitted.task.experiment.quantity(fitted.model, parameter.name).unit
        imitators.append(Imitator(parameter.name, parameter.value(u), parameter.value(moved), unit))
    return imitators


def _unit_of(fitted: Fit, option: Option) -> str:
    """Return the SI unit of the size of a candidate that the model does not contain."""
    experiment = fitted.task.experiment
    return experiment.quantity(option.candidate.on(fitted.model), option.size.parameters[0].name).unit
