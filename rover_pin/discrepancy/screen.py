"""A score test of every candidate: what its signature explains that no uncertain number can."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_pin.discrepancy.candidate import FAR_FROM, Candidate
from rover_pin.estimation.by_chance.random_field import RandomField, chance_of, learnt_sds
from rover_pin.estimation.fit import Fit, covariance
from rover_pin.estimation.noise import COLOURED, Absorbed, Noise, huber_weights, noise_of
from rover_pin.quantity import quantities

FALSE_ALARMS = 0.05
"""Share of sets without any effect in which one may be named."""
SOUGHT = 3.0
"""How much more chance gains where the stretch of ground is chosen too: on null sets up to 71 of raked sand."""
ROUGH = 0.01
"""Share of the chi2 that an effect took which its law may leave: laws hold to 10 %, assumed."""
ABSORBED = 0.02
"""Share of a signature that must be left after the uncertain numbers for the candidate to be told at all."""
STILL = 0.3
"""A signature that moves all rows together by fewer SDs than this is not in the data."""
SMALL = 0.05
"""Share of its default size from which a refit starts, besides the default."""
MULTIPLES = (0.8, 1.2, 1.8, 2.7)
"""Multiples of the default size at which a threshold effect is tried."""


@dataclass(frozen=True, eq=False)
class Signature:
    """How a candidate at some size moves the features (runs, channels, blocks); `sizes` are its values there."""

    candidate: Candidate
    sizes: dict[str, float]
    moved: np.ndarray = field(repr=False)
    neutral: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Scored:
    """One candidate by its best signature: the gain in chi2 and the size that a linear model promises.

    NaN where the model with it, however small, loses a prediction: it is not told.
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
    def told(self) -> bool:
        """Whether the data can tell the candidate at all."""
        return self.visible > STILL and 1 - self.absorbed > ABSORBED**2

    def smallest(self, fee: float) -> float:
        """Return the share of the signature's size that these data would show."""
        return math.sqrt(fee) / self.visible if self.visible > 0 else math.inf


def signatures(base: Fit, candidates: Sequence[Candidate]) -> list[Signature]:
    """Return the signatures of all candidates on the fitted base: one prediction each."""
    model, experiment = base.model, base.task.experiment
    freed = [_freed(base, one) for one in candidates if one.effect is None]
    tried = [(one, sizes) for one in candidates if one.effect is not None for sizes in trials(one)]
    with_it = [experiment.with_values(one.on(model), sizes) for one, sizes in tried]
    asked = (model, tuple(with_it))
    features = experiment.kept(asked, lambda: {"features": _features(base, with_it)})["features"]
    found = [
        Signature(one, sizes, each - base.predicted, one.neutral)
        for (one, sizes), each in zip(tried, features, strict=True)
    ]
    return freed + [_smaller(base, one) for one in found]


def _smaller(base: Fit, found: Signature) -> Signature:
    """Return a signature at a share SMALL of its sizes where the whole loses a prediction: no sinkage may carry it."""
    if not is_lost(base, found.moved):
        return found
    sizes = {name: (1 - SMALL) * found.neutral[name] + SMALL * size for name, size in found.sizes.items()}
    with_it = base.task.experiment.with_values(found.candidate.on(base.model), sizes)
    return dataclasses.replace(found, sizes=sizes, moved=_features(base, [with_it])[0] - base.predicted)


def is_lost(fitted: Fit, values: np.ndarray) -> bool:
    """Return whether any of the compared values is not predicted."""
    return bool(np.isnan(values[fitted.task.noise.good]).any())


def _features(base: Fit, models: Sequence[Any]) -> np.ndarray:
    return base.task.experiment.predict(models) if models else np.zeros((0, *base.predicted.shape))


def _freed(base: Fit, candidate: Candidate) -> Signature:
    """Return the signature of a number freed from its prior: its slope for one SD of the prior."""
    (name,) = candidate.sizes
    one = next(each for each in base.parameters if each.name == name)
    at = [each.name for each in base.parameters].index(name)
    here = one.value(base.u[at])
    return Signature(candidate, {name: one.value(base.u[at] + 1.0)}, base.slopes[name], {name: here})


def trials(candidate: Candidate) -> list[dict[str, float]]:
    """Return the sizes at which a candidate is tried: each of its sizes alone, threshold effects at several."""
    parameters = [candidate.size(name) for name in candidate.sizes]
    if candidate.sought and len(parameters) > 1:
        return [{one.name: one.value(1.0) for one in parameters}]
    found = []
    for one in parameters:
        multiples = MULTIPLES if one.log else (1.0,)
        for multiple in multiples:
            value = one.origin * multiple if one.log else one.value(multiple)
            found.append({**candidate.neutral, one.name: value})
    return found


def score(base: Fit, found: Sequence[Signature]) -> list[Scored]:
    """Return every candidate with its best signature, the most promising first.

    With rows r, slopes J, priors P, weights W and A = J^T W J + P, a signature d scores
    s = d^T W r - d^T W J A^-1 (J^T W r + P u), the last bracket 0 at the base's optimum, and has the information
    I = d^T W d - d^T W J A^-1 J^T W d; the gain is s^2 / I, the step s / I of its size.
    """
    rows, columns = base.rows, base.columns
    weights, spread = huber_weights(rows), covariance(columns, rows, base.parameters)
    held = np.array([u if one.prior else 0.0 for one, u in zip(base.parameters, base.u, strict=True)])
    off = columns.T @ (weights * rows) + held
    best: dict[str, Scored] = {}
    for each in found:
        moved = base.task.noise.white(each.moved)
        weighted = weights * moved
        across = columns.T @ weighted
        whole = float(moved @ weighted)
        info = np.maximum(whole - float(across @ spread @ across), 1e-12)
        slope = float(weighted @ rows - across @ spread @ off)
        share = _reachable(each, slope / info)
        gain = float(np.maximum(2 * share * slope - share**2 * info, 0.0))
        row = Scored(each.candidate, each, gain, share, math.sqrt(info), float(1 - info / np.maximum(whole, 1e-12)))
        name = each.candidate.name
        if name not in best or math.isnan(best[name].gain) or row.gain > best[name].gain:
            best[name] = row
    return sorted(best.values(), key=lambda row: -row.gain if row.told else 0.0)


def _reachable(signature: Signature, share: float) -> float:
    """Return the step inside the bounds of the sizes; a freed number may go either way."""
    candidate = signature.candidate
    if candidate.effect is None:
        return share
    low, high = -math.inf, math.inf
    for name, size in signature.sizes.items():
        neutral = signature.neutral[name]
        field_name = name.rpartition(".")[2]
        about = quantities(candidate.effect)[field_name]
        if size == neutral:
            continue
        ends = sorted([(about.low - neutral) / (size - neutral), (about.high - neutral) / (size - neutral)])
        low, high = max(low, ends[0]), min(high, ends[1])
    return min(max(share, low), high)


def saturated(base: Fit, found: Sequence[Signature], field: RandomField | None = None) -> tuple[np.ndarray, Absorbed]:
    """Return the residual (runs, channels, blocks) that no candidate and no number explains, to tell noise from.

    Nor does the random field, of which as much is explained as its SDs allow, at first the sizes of its columns.

    Beside it stands what of the noise they took with them, the covariance of what they explain: p columns on n rows
    take p / n of the variance, and more of the memory, which made the noise of a minute's log half as large as it is.
    """
    moved = [base.slopes[one.name] for one in base.parameters] + [each.moved for each in found]
    free, noise = len(moved), dataclasses.replace(base.task.noise, chance=None)
    if field is not None:
        moved += list(_scales(base.task.noise, field)[:, None, None, None] * field.moved)
    explained = np.moveaxis(np.array(moved), 0, -1)
    columns, rows = noise.white(np.moveaxis(explained, -1, 0)).T, noise.white(base.residual)
    root = np.sqrt(huber_weights(rows))
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-9)
    held = np.where(np.arange(len(scale)) < free, 1e-4, 1.0 / scale**2)
    scaled = columns / scale
    weighted = scaled * root[:, None]
    normal = weighted.T @ weighted + np.diag(held)
    size = np.sqrt(np.diag(normal))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    told = values > len(values) * np.finfo(float).eps * values[-1]  # below stands round-off, of columns that are alike
    axes = vectors[:, told] / np.sqrt(values[told]) / size[:, None]
    share = axes @ (axes.T @ (scaled.T @ (root**2 * rows))) / scale
    doubted = explained / scale @ axes
    before = np.concatenate([np.zeros_like(doubted[..., :1, :]), doubted[..., :-1, :]], axis=-2)
    absorbed = Absorbed(np.sum(doubted**2, axis=-1), np.sum(doubted * before, axis=-1))
    return np.asarray(base.residual - explained @ share), absorbed


def _scales(noise: Noise, field: RandomField) -> np.ndarray:
    """Return the learnt SD of each column of a field, in its size; 1 before any is learnt."""
    learnt = [one.sd / one.kind.size for one in noise.chance.learnt] if noise.chance else [1.0] * len(field.kinds)
    return np.array(learnt)[field.kind]


def with_chance(base: Fit, found: Sequence[Signature], field: RandomField) -> Fit:
    """Return the fit with the SDs of the random field learnt, what it may have done taken out of its rows."""
    noise = base.task.noise
    free = noise.white(np.array([base.slopes[one.name] for one in base.parameters] + [each.moved for each in found])).T
    columns, rows = noise.white(field.moved).T, base.rows
    root = np.sqrt(huber_weights(rows))
    learnt = learnt_sds(root * rows, root[:, None] * free, root[:, None] * columns, field)
    made = dataclasses.replace(noise, chance=chance_of(field, columns, noise.good, learnt))
    return dataclasses.replace(base, task=dataclasses.replace(base.task, noise=made))


def entry_fee(candidates: int) -> float:
    """Return the gain in chi2 that chance alone gives the best of so many candidates in 5 % of sets."""
    return 2 * math.log(max(candidates, 1) / FALSE_ALARMS)


def fee_of(candidate: Candidate, count: int, taken: float = 0.0, inflation: float = COLOURED) -> float:
    """Return what chance gains the best of `count` candidates; SOUGHT times that for one that is sought somewhere.

    Beside chance stands what the laws that were added before, which took `taken` of chi2, may leave by their form.
    """
    further = len(candidate.sizes) - 1 + len(candidate.freed)
    white = entry_fee(count) * (SOUGHT if candidate.sought else 1.0) + entry_fee(1) * further
    return inflation * white + ROUGH * taken


def started(scored: Scored, base: Fit) -> dict[str, float]:
    """Return the sizes at which a refit of a candidate starts: where its best signature takes the gain."""
    if scored.candidate.effect is None:
        return {name: base.task.experiment.value(base.model, name) for name in scored.candidate.sizes}
    share = min(max(scored.share, -3.0), 3.0)
    sizes = {}
    for name, size in scored.signature.sizes.items():
        neutral = scored.signature.neutral[name]
        sizes[name] = size if abs(neutral) > FAR_FROM * abs(size) else neutral + share * (size - neutral)
    return sizes


def with_noise(base: Fit, residual: np.ndarray, least: np.ndarray, absorbed: Absorbed | None = None) -> Fit:
    """Return the fit judged by the noise that a residual shows; its numbers are not fitted again."""
    noise = noise_of(residual, base.task.noise.good, least, absorbed)
    return dataclasses.replace(base, task=dataclasses.replace(base.task, noise=noise))
