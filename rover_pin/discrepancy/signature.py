"""How each candidate moves what a fitted model predicts: one prediction each, where slopes would cost as much."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.estimation.fit import Fit
from rover_pin.inference.cause import SIZE_SD

SMALL = 0.05
"""Share of its default size at which a candidate is tried that as a whole loses a prediction."""
MULTIPLES = (0.8, 1.2, 1.8, 2.7)
"""Multiples of the default size at which an effect is tried that acts from a size on."""
FARTHEST = 3.0
"""Default sizes from neutral at which a refit starts, at most."""


@dataclass(frozen=True, eq=False)
class Signature:
    """How a candidate of its size, at the numbers `amplitudes`, moves the features (folds, channels, samples)."""

    candidate: Candidate
    amplitudes: dict[str, float]
    shift: np.ndarray = field(repr=False)
    share: float = 1.0
    "of its size at which it was tried"

    @property
    def column(self) -> np.ndarray:
        """The shift for u = 1 of its size."""
        return self.shift * (SIZE_SD / self.share)

    @property
    def moved(self) -> str:
        """The name of the first number that it moves."""
        return next(name for name, value in self.amplitudes.items() if value != self._neutral(name))

    def start_numbers(self, u: float) -> dict[str, float]:
        """Return the numbers at which a refit starts where the linear size is u; one on a logarithm as it was tried."""
        times = min(max(u * SIZE_SD / self.share, -FARTHEST), FARTHEST)
        start = {}
        for name, value in self.amplitudes.items():
            size, neutral = self.candidate.size(name), self._neutral(name)
            first = value if size.log else neutral + times * (value - neutral)
            if self.candidate.released:
                first = size.value(times)
            start[name] = min(max(first, size.low), size.high)
        return start

    def _neutral(self, name: str) -> float:
        released = self.candidate.released
        return self.candidate.neutral[name] if released is None else released.origin


def signatures(base: Fit, candidates: Sequence[Candidate]) -> list[Signature]:
    """Return the signatures of all candidates on the fitted base."""
    model, experiment = base.model, base.task.experiment
    released = [_released_signature(base, candidate) for candidate in candidates if candidate.released]
    tried = [
        (candidate, amplitudes)
        for candidate in candidates
        if not candidate.released
        for amplitudes in trials(candidate)
    ]
    with_it = [experiment.with_values(candidate.on(model), amplitudes) for candidate, amplitudes in tried]
    request = (model, tuple(with_it))
    features = experiment.cached_arrays(request, lambda: {"features": _features(base, with_it)})["features"]
    rows = [
        Signature(candidate, amplitudes, prediction - base.predicted)
        for (candidate, amplitudes), prediction in zip(tried, features, strict=True)
    ]
    return released + [_smaller(base, row) for row in rows]


def _released_signature(base: Fit, candidate: Candidate) -> Signature:
    """Return the signature of a number freed from its prior: its slope, over its size."""
    (name,) = candidate.amplitudes
    fitted, size = next(number for number in base.parameters if number.name == name), candidate.size(name)
    return Signature(candidate, {name: size.value(1.0)}, base.slopes[name] * (size.scale / fitted.scale))


def _smaller(base: Fit, signature: Signature) -> Signature:
    """Return a signature at a share SMALL of its sizes where the whole loses a prediction: no sinkage may carry it."""
    if not np.isnan(signature.shift[base.task.noise.good]).any():
        return signature
    neutral = signature.candidate.neutral
    amplitudes = {name: neutral[name] + SMALL * (size - neutral[name]) for name, size in signature.amplitudes.items()}
    with_it = base.task.experiment.with_values(signature.candidate.on(base.model), amplitudes)
    shift = _features(base, [with_it])[0] - base.predicted
    return replace(signature, amplitudes=amplitudes, shift=shift, share=SMALL)


def _features(base: Fit, models: Sequence[Any]) -> np.ndarray:
    return base.task.experiment.predict(models) if models else np.zeros((0, *base.predicted.shape))


def trials(candidate: Candidate) -> list[dict[str, float]]:
    """Return the sizes at which a candidate is tried: each of its sizes alone, threshold effects at several."""
    parameters = [candidate.size(name) for name in candidate.amplitudes]
    if candidate.place_searched and len(parameters) > 1:
        return [{parameter.name: parameter.value(1.0) for parameter in parameters}]
    trial_amplitudes = []
    for parameter in parameters:
        multiples = MULTIPLES if parameter.log else (1.0,)
        for multiple in multiples:
            value = parameter.origin * multiple if parameter.log else parameter.value(multiple)
            trial_amplitudes.append({**candidate.neutral, parameter.name: value})
    return trial_amplitudes
