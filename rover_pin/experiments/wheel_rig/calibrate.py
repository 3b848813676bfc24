"""The base model first: its uncertain constants fitted, so that a wrong one does not pass for a missing effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2 as chi2_law

from rover_pin.errors import OptimisationError
from rover_pin.estimation.covariance import covariance
from rover_pin.estimation.problem import Prior
from rover_pin.estimation.profile import NORMAL_95, Best, LowerMinimum, interval
from rover_pin.estimation.wording import Against, against
from rover_pin.experiments.wheel_rig.data import Independent, RigSet
from rover_pin.experiments.wheel_rig.fit import RigEvidence, RigFit, RigProblem, fit_from, rig_space, spread_starts
from rover_pin.experiments.wheel_rig.model import ASKEW, RigModel
from rover_pin.identification.identifiability import SAME_LOAD
from rover_pin.measurements.channel import DrawbarPull, Sinkage, Torque

STARTS = 6
SURPRISE = 1e-3
"""A chi2 less probable than this by the stated noise means that a remainder is there."""

UNSURE = 0.1
"""Relative uncertainty that is granted to an independent measurement that states none."""

TURNS = 3
"""Lower minima found by profiles that are followed."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What stays the same for all models compared: data, nuisance parameters with priors, seed."""

    data: RigSet
    free: tuple[str, ...]
    priors: Mapping[str, Prior] = field(default_factory=lambda: MappingProxyType({}))
    seed: int = 0

    def evidence(self, model: RigModel, speeds: np.ndarray | None) -> RigEvidence:
        """Return the set as a model predicts it at these speeds [runs, 2]."""
        return RigEvidence(self.data.rig, model, speeds)

    def problem(self, model: RigModel, extra: tuple[str, ...] = ()) -> RigProblem:
        """Return the fit of the nuisance parameters and the `extra` ones of a model."""
        evidence = self.evidence(model, self.data.speeds)
        return RigProblem(evidence, rig_space(model, (*self.free, *extra)), self.priors)


def nuisances(data: RigSet, model: RigModel) -> tuple[tuple[str, ...], dict[str, Prior]]:
    """Return which soil constants are uncertain, and what is assumed of those that these channels tell only in part.

    k and phi where a force was measured, k_1 where the sinkage was, with no prior; the exit ratio with SD 0.1; where
    loads differ n with SD 0.3 and c with 300 Pa or its own size.
    """
    kinds, soil = {type(channel) for channel in data.rig.channels}, model.soil
    free: list[str] = []
    priors: dict[str, Prior] = {}
    if kinds & {DrawbarPull, Torque}:
        free += ["k", "phi"]
    if Sinkage in kinds:
        free += ["k_1"]
    free += ["exit_ratio"]
    priors["exit_ratio"] = Prior(float(soil.exit_ratio), 0.1)
    if np.max(data.rig.load) >= SAME_LOAD * np.min(data.rig.load):
        free += ["n", "c"]
        priors |= {"n": Prior(float(soil.n), 0.3), "c": Prior(float(soil.c), max(300.0, float(soil.c)))}
    return tuple(free), priors


def calibrate(setting: Setting, model: RigModel) -> RigFit:
    """Return the model with its nuisance parameters, and its effects' own sizes, fitted from several starts."""
    problem = setting.problem(model, own_sizes(model))
    return fit_from(problem, spread_starts(problem, STARTS, setting.seed))


def own_sizes(model: RigModel) -> tuple[str, ...]:
    """Return the sizes of the effects that a model already has, but for what it starts from."""
    own = [effect for effect in model.effects if effect not in ASKEW]
    return tuple(f"{type(effect).__name__}.{name}" for effect in own for name in effect.neutral)


def settled(fit: RigFit) -> RigFit:
    """Return the fit with SDs widened to its own misfit: parameters and intervals for a model that is not perfect."""
    widen = float(np.sqrt(max(fit.misfit, 1.0))) if remains(fit) else 1.0
    return fit_from(fit.problem.widened(widen), [fit.u])


def remains(fit: RigFit, surprise: float = SURPRISE) -> bool:
    """Return whether chi2 is less probable than `surprise` by the stated noise."""
    freedom = max(fit.problem.freedom, 1)
    return bool(fit.chi2 * fit.problem.widen**2 > chi2_law.isf(surprise, freedom))


class Fitted(NamedTuple):
    """One fitted parameter with its 95 % profile interval [SI]."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    closed: bool
    "whether the data close both ends"
    prior: str
    "what was assumed of it, in words"
    covered: float = 0.0
    "share of what is allowed of it, in the coordinate of the fit, that the interval covers"

    @property
    def at_bound(self) -> bool:
        """Whether the value lies on an end that is its bound."""
        return not self.closed and min(self.value - self.low, self.high - self.value) <= 1e-6 * (self.high - self.low)


def parameters(fit: RigFit) -> tuple[RigFit, tuple[Fitted, ...]]:
    """Return the intervals of all free parameters, and the fit at the lowest minimum that they met."""
    for _ in range(TURNS):
        try:
            return fit, tuple(_fitted(fit, index) for index in range(len(fit.u)))
        except LowerMinimum as lower:
            fit = fit_from(fit.problem, [lower.u])
    return fit, tuple(_local(fit, index) for index in range(len(fit.u)))


def _fitted(fit: RigFit, index: int) -> Fitted:
    best = Best(fit.u, fit.chi2, covariance(fit.problem, fit.u))
    try:
        ends = interval(fit.problem, best, index)
    except OptimisationError:
        return _local(fit, index)
    return _named(fit, index, ends.low, ends.high, ends.closed_low and ends.closed_high)


def _local(fit: RigFit, index: int) -> Fitted:
    axis = fit.problem.space.axes[index]
    half = NORMAL_95 * float(np.sqrt(covariance(fit.problem, fit.u)[index, index]))
    low, high = max(fit.u[index] - half, axis.low), min(fit.u[index] + half, axis.high)
    return _named(fit, index, low, high, low > axis.low and high < axis.high)


def _named(fit: RigFit, index: int, low: float, high: float, closed: bool) -> Fitted:
    axis = fit.problem.space.axes[index]
    prior = fit.problem.priors.get(axis.name)
    said = f"{prior.mean:.3g} +- {prior.sd:.2g}" if prior else ""
    value = float(fit.problem.space.values(fit.u)[index])
    ends = np.clip([axis.coordinate.value(low), axis.coordinate.value(high)], axis.about.low, axis.about.high)
    covered = float((high - low) / (axis.high - axis.low))
    return Fitted(axis.name, axis.about.unit, value, float(ends[0]), float(ends[1]), closed, said, covered)


class Flag(NamedTuple):
    """A fitted constant against an independent measurement of it [SI]."""

    name: str
    unit: str
    fitted: tuple[float, float, float]
    "value, and the ends of its 95 % interval"
    independent: Independent
    says: Against

    @property
    def agrees(self) -> bool:
        """Whether the two meet, and the interval says anything at all."""
        return self.says is Against.AGREES

    @property
    def ratio(self) -> float:
        """Fitted over independent value, the middle of its range."""
        return self.fitted[0] / ((self.independent.low + self.independent.high) / 2)


def flags(data: RigSet, fit: RigFit, fitted: tuple[Fitted, ...]) -> tuple[Flag, ...]:
    """Return every fitted constant that is known from elsewhere, and whether the two agree.

    They agree where the 95 % interval meets the independent range, which is granted 10 % on both sides; an interval
    that covers nearly all that is allowed says nothing.
    """
    soil, b = fit.model.soil, float(fit.model.wheel.b)
    rows = {one.name: (one.value, one.low, one.high) for one in fitted}
    covered = {one.name: one.covered for one in fitted}
    if "k_1" in rows:
        rows["K_eff"] = tuple((value + soil.k_2 * b) / b**soil.n for value in rows["k_1"])
        covered["K_eff"] = covered["k_1"]
    found = []
    for known in data.independent(float(soil.n)):
        if known.name in rows:
            granted = known.low * (1 - UNSURE), known.high * (1 + UNSURE)
            says = against(rows[known.name][1:], granted, covered[known.name])
            found.append(Flag(known.name, known.unit, rows[known.name], known, says))
    return tuple(found)
