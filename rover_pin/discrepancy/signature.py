"""Describe each candidate by the change of the prediction that it makes (its signature), and estimate its evidence with
a linear model.

A signature is the change of the prediction of a fitted model when a candidate acts. One prediction for each trial of a
candidate gives all signatures. An option is a candidate at its best place and size, ready to be added to the fit.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import logsumexp

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.estimation.fit import Fit
from rover_pin.inference.cause import SIZE_SD, Cause
from rover_pin.inference.expansion import Expansion
from rover_pin.inference.explore import MIN_VISIBLE_CHANGE
from rover_pin.inference.linear_hypothesis import LinearHypothesis, linear_hypothesis

REDUCED_SIZE = 0.05
"""Fraction of its default size at which a candidate is tried, if the model cannot predict a sample with the candidate
at its whole size (for example because no sinkage carries the load). The value is assumed: small enough that the model
keeps its predictions, and large enough that the change exceeds rounding."""
TRIAL_MULTIPLES = (0.8, 1.2, 1.8, 2.7)
"""Multiples of the default size at which an effect with a threshold is tried. A single size could lie below the
threshold and change nothing. Steps of a factor of 1.5 around the default leave no wide gap."""
MAX_START_SIZE = 3.0
"""Largest deviation of a size from its neutral value at the start of a fit, in default sizes. The linear model can
suggest any size but is wrong far from its fit, and a start that is too far away ends in another minimum."""


@dataclass(frozen=True, eq=False)
class Signature:
    """Change of the prediction (folds, channels, samples) of a fitted model if a candidate acts with given sizes."""

    candidate: Candidate
    amplitudes: dict[str, float]
    """name of a size parameter of the candidate -> its value in the trial [SI]"""
    shift: np.ndarray = field(repr=False)
    """prediction with the candidate minus prediction without it, in the unit of each channel"""
    share: float = 1.0
    """fraction of the candidate's default size at which it was tried: 1, or REDUCED_SIZE"""

    @property
    def column(self) -> np.ndarray:
        """Change of the prediction (folds, channels, samples) per unit of the candidate's coordinate u, where u = 1 is
        a size of SIZE_SD default sizes.
        """
        return self.shift * (SIZE_SD / self.share)

    @property
    def moved(self) -> str:
        """Name of the size that this trial changed, and that the linear model estimates: the first size that differs
        from its neutral value.
        """
        return next(name for name, value in self.amplitudes.items() if value != self._neutral(name))

    def start_numbers(self, u: float) -> dict[str, float]:
        """Return the initial values of the candidate's sizes in a fit, as a mapping from the name of a size to its
        value [SI].

        `u` is the size that the linear model estimates, in SIZE_SD default sizes. A size that is fitted on a logarithm
        starts from the value at which it was tried, because the linear model does not hold for such a size.
        """
        # From the coordinate u to default sizes, limited to the range in which the linear model is useful.
        sizes = min(max(u * SIZE_SD / self.share, -MAX_START_SIZE), MAX_START_SIZE)
        start = {}
        for name, value in self.amplitudes.items():
            size, neutral = self.candidate.size(name), self._neutral(name)
            first = value if size.log else neutral + sizes * (value - neutral)
            if self.candidate.released:
                first = size.value(sizes)
            start[name] = min(max(first, size.low), size.high)
        return start

    def _neutral(self, name: str) -> float:
        """Return the value of the size called `name` at which the candidate does not act; for a freed parameter of the
        model, this is the mean of its prior.
        """
        released = self.candidate.released
        return self.candidate.neutral[name] if released is None else released.origin


def signatures(base: Fit, candidates: Sequence[Candidate]) -> list[Signature]:
    """Return the signatures of all candidates (the changes that they make to the prediction of a fitted model), one for
    each trial of a candidate.

    Parameters
    ----------
    base : Fit
        The fitted model.
    candidates : sequence of Candidate
        Effects that may be missing, and parameters of the model whose declared values may be wrong.
    """
    model, experiment = base.model, base.task.experiment
    rows = []
    for candidate in candidates:
        if candidate.released:
            # A freed parameter of the model needs no prediction, because the derivative by this parameter is known.
            (name,) = candidate.amplitudes
            fitted, size = next(number for number in base.parameters if number.name == name), candidate.size(name)
            shift = base.slopes[name] * (size.scale / fitted.scale)
            rows.append(Signature(candidate, {name: size.value(1.0)}, shift))
    # All other candidates need one prediction for each trial; all of them go into one call, which may run in parallel.
    tried = [
        (candidate, amplitudes)
        for candidate in candidates
        if not candidate.released
        for amplitudes in trials(candidate)
    ]
    models = [experiment.with_values(candidate.on(model), amplitudes) for candidate, amplitudes in tried]
    request = (model, tuple(models))
    features = experiment.cached_arrays(request, lambda: {"features": _predictions(base, models)})["features"]
    for (candidate, amplitudes), prediction in zip(tried, features, strict=True):
        signature = Signature(candidate, amplitudes, prediction - base.predicted)
        if np.isnan(signature.shift[base.task.noise.good]).any():
            # At the whole size of the candidate the model cannot predict some samples, for example because no sinkage
            # carries the load.
            neutral = candidate.neutral
            small = {name: neutral[name] + REDUCED_SIZE * (size - neutral[name]) for name, size in amplitudes.items()}
            shift = _predictions(base, [experiment.with_values(candidate.on(model), small)])[0] - base.predicted
            signature = replace(signature, amplitudes=small, shift=shift, share=REDUCED_SIZE)
        rows.append(signature)
    return rows


def _predictions(base: Fit, models: Sequence[Any]) -> np.ndarray:
    """Return the predictions of some models for the experiment of the fit `base` (models, folds, channels, samples)."""
    return base.task.experiment.predict(models) if models else np.zeros((0, *base.predicted.shape))


def trials(candidate: Candidate) -> list[dict[str, float]]:
    """Return the sizes at which a candidate is tried: one dictionary for each trial, with the value of each size by
    name.

    In a trial, one size has its default value and the others are neutral; a size with a threshold is tried at several
    multiples of its default. A local effect with several sizes is tried only once, with all its sizes at their
    defaults.
    """
    # A size alone shows its own influence; the sizes of a local effect act together at its place.
    parameters = [candidate.size(name) for name in candidate.amplitudes]
    if candidate.place_searched and len(parameters) > 1:
        return [{parameter.name: parameter.value(1.0) for parameter in parameters}]
    trial_amplitudes = []
    for parameter in parameters:
        multiples = TRIAL_MULTIPLES if parameter.log else (1.0,)
        for multiple in multiples:
            value = parameter.origin * multiple if parameter.log else parameter.value(multiple)
            trial_amplitudes.append({**candidate.neutral, parameter.name: value})
    return trial_amplitudes


@dataclass(frozen=True, eq=False)
class Option:
    """A candidate that may be added to a fit, at its best place and size, and its influence on the residuals."""

    signature: Signature
    column: np.ndarray = field(repr=False)
    """change of the whitened residuals (n,) for u = 1 of the candidate's size"""
    log_places: float = 0.0
    """penalty for the choice of the best place [nats]: log of the mean evidence over all tried places, minus the log
    evidence at the best place"""

    @property
    def candidate(self) -> Candidate:
        """The candidate (an effect or a freed parameter) that may be added."""
        return self.signature.candidate

    @property
    def size(self) -> Cause:
        """The candidate as a cause with only one free parameter: the size that its signature changes.

        A size that is otherwise fitted on a logarithm is returned on a linear scale without bounds, as the linear model
        needs it.
        """
        cause, name = self.candidate.cause, self.signature.moved
        number = next(parameter for parameter in cause.parameters if parameter.name == name)
        unbounded = replace(number, log=False, low=-math.inf, high=math.inf)
        return replace(cause, parameters=(unbounded if number.log else number,))


def options(start: Fit, rows: Sequence[Signature], is_optimum: bool = True) -> list[Option]:
    """Return the candidates that change the prediction visibly, each at its best place and size, as options for the
    next fit.

    Parameters
    ----------
    start : Fit
        The fit that a candidate would be added to.
    rows : sequence of Signature
        Signatures of all candidates on this fit.
    is_optimum : bool
        Whether `start` is at the minimum of its loss, so that the gradient of the loss is zero.
    """
    # The sign is negative, because a larger prediction makes the residual (measured minus predicted) smaller.
    columns = [Option(row, -start.task.noise.white(row.column)) for row in rows]
    visible = [option for option in columns if np.linalg.norm(option.column) > MIN_VISIBLE_CHANGE * SIZE_SD]
    gains = [hypothesis.log_evidence for hypothesis in alone(start, visible, is_optimum)]

    # Best size of each candidate at each place.
    best: dict[str, tuple[Option, float]] = {}
    for option, gain in zip(visible, gains, strict=True):
        name = option.candidate.name
        if name not in best or gain > best[name][1]:
            best[name] = option, gain

    # Best place of each candidate. A cause that may act anywhere has the same prior probability as any other and
    # shares it among its places, so the evidence is the mean over the places.
    by_kind: dict[str, list[tuple[Option, float]]] = {}
    for option, gain in best.values():
        by_kind.setdefault(option.candidate.anywhere, []).append((option, gain))
    at_best_place = []
    for places in by_kind.values():
        option, gain = max(places, key=lambda pair: pair[1])
        log_sum = float(logsumexp(np.array([place_gain for _, place_gain in places])))
        at_best_place.append(replace(option, log_places=log_sum - gain - math.log(len(places))))
    return at_best_place


def alone(start: Fit, listed: Sequence[Option], is_optimum: bool = True) -> list[LinearHypothesis]:
    """Return one hypothesis for each option: the causes of the fit `start` with this option alone added. Its evidence
    is estimated, without a new fit.
    """
    if not listed:
        return []
    expansion = Expansion(start, np.array([option.column for option in listed]).T, is_optimum)
    return [
        linear_hypothesis((option.size,), expansion, (column,), (option.size,)) for column, option in enumerate(listed)
    ]


def singles(start: Fit, rows: Sequence[Signature]) -> np.ndarray:
    """Return the log evidence (signatures,) [nats] of the fit `start` with one candidate added, estimated for each
    signature.
    """
    columns = [Option(row, -start.task.noise.white(row.column)) for row in rows]
    return np.array([hypothesis.log_evidence for hypothesis in alone(start, columns)])
