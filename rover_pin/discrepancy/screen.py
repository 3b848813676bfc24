"""A score test of every candidate: what its signature explains that no uncertain number can."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_pin.base.quantity import quantities
from rover_pin.discrepancy.candidate import FAR_FROM, Candidate
from rover_pin.estimation.fit import Fit, covariance
from rover_pin.estimation.noise import COLOURED, Absorbed, Noise, huber_weights, noise_of
from rover_pin.estimation.random_effects.random_field import RandomField, learnt_sds, random_effects_filter

FALSE_ALARMS = 0.05
"""Share of sets without any effect in which one may be named."""
SOUGHT = 3.0
"""How much more chance gains where the stretch of ground is chosen too: on null sets up to 71 of prepared sand."""
ROUGH = 0.01
"""Share of the chi2 that an effect took which its law may leave: laws hold to 10 %, assumed."""
ABSORBED = 0.02
"""Share of a signature that must be left after the uncertain numbers for the candidate to be identified at all."""
STILL = 0.3
"""A signature that moves all rows together by fewer SDs than this is not in the data."""
SMALL = 0.05
"""Share of its default size from which a refit starts, besides the default."""
MULTIPLES = (0.8, 1.2, 1.8, 2.7)
"""Multiples of the default size at which a threshold effect is tried."""


@dataclass(frozen=True, eq=False)
class Signature:
    """How a candidate at some size moves the features (runs, channels, blocks); `amplitudes` are its values there."""

    candidate: Candidate
    amplitudes: dict[str, float]
    shift: np.ndarray = field(repr=False)
    neutral: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Scored:
    """One candidate by its best signature: the gain in chi2 and the size that a linear model promises.

    NaN where the model with it, however small, loses a prediction: it is not identified.
    """

    candidate: Candidate
    signature: Signature = field(repr=False)
    gain: float
    share: float
    "of the signature's own size at which the gain is taken"
    visible: float
    "SDs by which the signature moves what the uncertain numbers cannot"
    absorbed: float
    "share of the signature's sum of squares that they can imitate"

    @property
    def is_identifiable(self) -> bool:
        """Whether the data can tell the candidate at all."""
        return self.visible > STILL and 1 - self.absorbed > ABSORBED**2

    def smallest(self, threshold: float) -> float:
        """Return the share of the signature's size that these data would show."""
        return math.sqrt(threshold) / self.visible if self.visible > 0 else math.inf


def signatures(base: Fit, candidates: Sequence[Candidate]) -> list[Signature]:
    """Return the signatures of all candidates on the fitted base: one prediction each."""
    model, experiment = base.model, base.task.experiment
    number_signatures = [
        _unconstrained_signature(base, candidate) for candidate in candidates if candidate.effect is None
    ]
    tried = [
        (candidate, amplitudes)
        for candidate in candidates
        if candidate.effect is not None
        for amplitudes in trials(candidate)
    ]
    with_it = [experiment.with_values(candidate.on(model), amplitudes) for candidate, amplitudes in tried]
    request = (model, tuple(with_it))
    features = experiment.cached_arrays(request, lambda: {"features": _features(base, with_it)})["features"]
    effect_signatures = [
        Signature(candidate, amplitudes, prediction - base.predicted, candidate.neutral)
        for (candidate, amplitudes), prediction in zip(tried, features, strict=True)
    ]
    return number_signatures + [_smaller(base, signature) for signature in effect_signatures]


def _smaller(base: Fit, signature: Signature) -> Signature:
    """Return a signature at a share SMALL of its sizes where the whole loses a prediction: no sinkage may carry it."""
    if not is_lost(base, signature.shift):
        return signature
    amplitudes = {
        name: (1 - SMALL) * signature.neutral[name] + SMALL * size for name, size in signature.amplitudes.items()
    }
    with_it = base.task.experiment.with_values(signature.candidate.on(base.model), amplitudes)
    return dataclasses.replace(signature, amplitudes=amplitudes, shift=_features(base, [with_it])[0] - base.predicted)


def is_lost(fitted: Fit, values: np.ndarray) -> bool:
    """Return whether any of the compared values is not predicted."""
    return bool(np.isnan(values[fitted.task.noise.good]).any())


def _features(base: Fit, models: Sequence[Any]) -> np.ndarray:
    return base.task.experiment.predict(models) if models else np.zeros((0, *base.predicted.shape))


def _unconstrained_signature(base: Fit, candidate: Candidate) -> Signature:
    """Return the signature of a number freed from its prior: its slope for one SD of the prior."""
    (name,) = candidate.amplitudes
    parameter = next(number for number in base.parameters if number.name == name)
    at = [number.name for number in base.parameters].index(name)
    present_value = parameter.value(base.u[at])
    return Signature(candidate, {name: parameter.value(base.u[at] + 1.0)}, base.slopes[name], {name: present_value})


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


def score(base: Fit, candidate_signatures: Sequence[Signature]) -> list[Scored]:
    """Return every candidate with its best signature, the most promising first.

    With rows r, slopes J, priors P, weights W and A = J^T W J + P, a signature d scores
    s = d^T W r - d^T W J A^-1 (J^T W r + P u), the last bracket 0 at the base's optimum, and has the information
    I = d^T W d - d^T W J A^-1 J^T W d; the gain is s^2 / I, the step s / I of its size.
    """
    rows, columns = base.rows, base.columns
    weights, spread = huber_weights(rows), covariance(columns, rows, base.parameters)
    prior_gradient = np.array(
        [u if parameter.prior else 0.0 for parameter, u in zip(base.parameters, base.u, strict=True)]
    )
    off = columns.T @ (weights * rows) + prior_gradient
    best: dict[str, Scored] = {}
    for signature in candidate_signatures:
        white_shift = base.task.noise.white(signature.shift)
        weighted = weights * white_shift
        across = columns.T @ weighted
        total_info = float(white_shift @ weighted)
        info = np.maximum(total_info - float(across @ spread @ across), 1e-12)
        slope = float(weighted @ rows - across @ spread @ off)
        share = _reachable(signature, slope / info)
        gain = float(np.maximum(2 * share * slope - share**2 * info, 0.0))
        row = Scored(
            signature.candidate,
            signature,
            gain,
            share,
            math.sqrt(info),
            float(1 - info / np.maximum(total_info, 1e-12)),
        )
        name = signature.candidate.name
        if name not in best or math.isnan(best[name].gain) or row.gain > best[name].gain:
            best[name] = row
    return sorted(best.values(), key=lambda row: -row.gain if row.is_identifiable else 0.0)


def _reachable(signature: Signature, share: float) -> float:
    """Return the step inside the bounds of the sizes; a freed number may go either way."""
    candidate = signature.candidate
    if candidate.effect is None:
        return share
    low, high = -math.inf, math.inf
    for name, size in signature.amplitudes.items():
        neutral = signature.neutral[name]
        field_name = name.rpartition(".")[2]
        spec = quantities(candidate.effect)[field_name]
        if size == neutral:
            continue
        ends = sorted([(spec.low - neutral) / (size - neutral), (spec.high - neutral) / (size - neutral)])
        low, high = max(low, ends[0]), min(high, ends[1])
    return min(max(share, low), high)


def saturated(
    base: Fit, candidate_signatures: Sequence[Signature], field: RandomField | None = None
) -> tuple[np.ndarray, Absorbed]:
    """Return the residual (runs, channels, blocks) that no candidate and no number explains, to tell noise from.

    Nor does the random field, of which as much is explained as its SDs allow, at first the sizes of its columns.

    Beside it stands what of the noise they took with them, the covariance of what they explain: p columns on n rows
    take p / n of the variance, and more of the memory, which made the noise of a minute's log half as large as it is.
    """
    responses = [base.slopes[parameter.name] for parameter in base.parameters] + [
        signature.shift for signature in candidate_signatures
    ]
    free, noise = len(responses), dataclasses.replace(base.task.noise, random_effects=None)
    if field is not None:
        responses += list(_scales(base.task.noise, field)[:, None, None, None] * field.moved)
    explained = np.moveaxis(np.array(responses), 0, -1)
    columns, rows = noise.white(np.moveaxis(explained, -1, 0)).T, noise.white(base.residual)
    root = np.sqrt(huber_weights(rows))
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-9)
    penalty = np.where(np.arange(len(scale)) < free, 1e-4, 1.0 / scale**2)
    scaled = columns / scale
    weighted = scaled * root[:, None]
    normal = weighted.T @ weighted + np.diag(penalty)
    size = np.sqrt(np.diag(normal))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    sound = values > len(values) * np.finfo(float).eps * values[-1]  # below stands round-off, of columns that are alike
    axes = vectors[:, sound] / np.sqrt(values[sound]) / size[:, None]
    share = axes @ (axes.T @ (scaled.T @ (root**2 * rows))) / scale
    projected = explained / scale @ axes
    before = np.concatenate([np.zeros_like(projected[..., :1, :]), projected[..., :-1, :]], axis=-2)
    absorbed = Absorbed(np.sum(projected**2, axis=-1), np.sum(projected * before, axis=-1))
    return np.asarray(base.residual - explained @ share), absorbed


def _scales(noise: Noise, field: RandomField) -> np.ndarray:
    """Return the learnt SD of each column of a field, in its size; 1 before any is learnt."""
    learnt = (
        [learnt_sd.sd / learnt_sd.kind.size for learnt_sd in noise.random_effects.learnt]
        if noise.random_effects
        else [1.0] * len(field.kinds)
    )
    return np.array(learnt)[field.kind]


def with_random_effects(base: Fit, candidate_signatures: Sequence[Signature], field: RandomField) -> Fit:
    """Return the fit with the SDs of the random field learnt, what it may have done taken out of its rows."""
    noise = base.task.noise
    free = noise.white(
        np.array(
            [base.slopes[parameter.name] for parameter in base.parameters]
            + [signature.shift for signature in candidate_signatures]
        )
    ).T
    columns, rows = noise.white(field.moved).T, base.rows
    root = np.sqrt(huber_weights(rows))
    learnt = learnt_sds(root * rows, root[:, None] * free, root[:, None] * columns, field)
    learnt_noise = dataclasses.replace(noise, random_effects=random_effects_filter(field, columns, noise.good, learnt))
    return dataclasses.replace(base, task=dataclasses.replace(base.task, noise=learnt_noise))


def null_threshold(candidates: int) -> float:
    """Return the gain in chi2 that chance alone gives the best of `candidates` in 5 % of sets."""
    return 2 * math.log(max(candidates, 1) / FALSE_ALARMS)


def candidate_threshold(candidate: Candidate, count: int, taken: float = 0.0, inflation: float = COLOURED) -> float:
    """Return what chance gains the best of `count` candidates; SOUGHT times that for one that is sought somewhere.

    Beside chance stands what the laws that were added before, which took `taken` of chi2, may leave by their form.
    """
    extra_numbers = len(candidate.amplitudes) - 1
    white = null_threshold(count) * (SOUGHT if candidate.place_searched else 1.0) + null_threshold(1) * extra_numbers
    return inflation * white + ROUGH * taken


def started(scored: Scored, base: Fit) -> dict[str, float]:
    """Return the sizes at which a refit of a candidate starts: where its best signature takes the gain."""
    if scored.candidate.effect is None:
        return {name: base.task.experiment.value(base.model, name) for name in scored.candidate.amplitudes}
    share = min(max(scored.share, -3.0), 3.0)
    amplitudes = {}
    for name, size in scored.signature.amplitudes.items():
        neutral = scored.signature.neutral[name]
        amplitudes[name] = size if abs(neutral) > FAR_FROM * abs(size) else neutral + share * (size - neutral)
    return amplitudes


def with_noise(base: Fit, residual: np.ndarray, least: np.ndarray, absorbed: Absorbed | None = None) -> Fit:
    """Return the fit judged by the noise that a residual shows; its numbers are not fitted again."""
    noise = noise_of(residual, base.task.noise.good, least, absorbed)
    return dataclasses.replace(base, task=dataclasses.replace(base.task, noise=noise))
