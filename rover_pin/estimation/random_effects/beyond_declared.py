"""What measurements of an exact experiment share by chance, beyond declared noise, apart from a model's residual."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import Noise, huber_weights, spread
from rover_pin.estimation.random_effects.drift import learnt_drift
from rover_pin.estimation.random_effects.random_field import RandomField, learnt_sds, random_effects_filter, spanning

CLIP_SPREADS = 3.0
"""Times the spread of its channel at which a residual is held when drift is learnt."""
MOST_SPREAD = 2.0
"""Times the declared SD that a channel spreads, the law as far as it goes, above which a law is missing: what lacks
waves with slip, load or order, and no noise is declared too small by more (SCATTER of the judge, squared)."""
SURE = 2.71
"""Gain in -2 ln of the restricted likelihood from which folds differ beyond their noise: where they do not, half of the
sets gain nothing and 5 % more than this. Source: a variance at its bound, Self and Liang, JASA 82 (1987) 605."""

EXPLAINED = 1.5
"""Mean chi2 of what numbers leave in the noise that is learnt, over the scatter within folds, above which a law is
missing: up to 1.2 on 18 generated sets whose levels differ, 1.9 on a measured wheel whose laws fall short."""


def beyond_declared(last: Fit, candidate_shifts: Callable[[], Sequence[np.ndarray]]) -> Noise | None:
    """Return the declared noise with what measurements share by chance beside it; None where nothing shows.

    Drift in the order of measurement, with what folds differ in left free, else that. Every number is left free too,
    and `candidate_shifts` with them, so that neither a wrong number nor a missing law is taken for chance. With a fold
    left out the noise stays what it is on all.
    """
    experiment = last.task.experiment
    turn, field = experiment.turns(), experiment.random_field(last.model)
    if (turn is None and field is None) or not last.task.noise.good.any(axis=(1, 2)).all():
        return None
    noise = replace(last.task.noise, random_effects=None, drift=None)
    responses = np.array([last.slopes[parameter.name] for parameter in last.parameters] + list(candidate_shifts()))
    levels = responses if field is None else np.concatenate([responses, field.moved])
    scaled = last.residual / noise.sd
    spreads = [spread(scaled[:, row][noise.good[:, row]]) for row in range(scaled.shape[1])]
    drift = None
    if turn is not None and max(spreads) <= MOST_SPREAD:
        drift = learnt_drift(_held(scaled, spreads), levels / noise.sd, noise.good, turn)
    if drift is not None:
        return replace(noise, drift=drift)
    return None if field is None else _differing(last, responses, noise, field)


def _held(scaled: np.ndarray, spreads: Sequence[float]) -> np.ndarray:
    """Return residuals in SDs, held at STRAYING times the spread of their channel: two outliers would be a drift."""
    most = CLIP_SPREADS * np.maximum(1.0, spreads)[:, None]
    return np.clip(scaled, -most, most)


def _differing(last: Fit, responses: np.ndarray, noise: Noise, field: RandomField) -> Noise | None:
    """Return the noise with the SDs by which folds differ; None where that does not show, or is more than chance.

    They count in units of what the samples of a fold scatter: noise that was declared too small is none of them. SDs
    above a kind's `most` are something missing, and so is what is left in that noise beyond the scatter.
    """
    root = np.sqrt(huber_weights(noise.white(last.residual)))[:, None]
    columns = noise.white(field.moved).T
    free, drawn, rows = root * noise.white(responses).T, root * columns, root[:, 0] * noise.white(last.residual)
    within = _scatter(rows, np.hstack([free, drawn]))
    learnt = learnt_sds(rows / within, free, drawn / within, field)
    if max(learnt_sd.gain for learnt_sd in learnt) <= SURE or any(
        learnt_sd.sd > learnt_sd.kind.most for learnt_sd in learnt
    ):
        return None
    learnt_noise = replace(noise, random_effects=random_effects_filter(field, columns, noise.good, learnt))
    residual_sd = _residual_sd(last.residual, responses[: len(last.parameters)], learnt_noise)
    return learnt_noise if residual_sd**2 <= EXPLAINED * within**2 else None


def _residual_sd(residual: np.ndarray, responses: np.ndarray, noise: Noise) -> float:
    """Return the SD of what free numbers leave of a residual, in a noise; at least 1."""
    rows = noise.white(residual)
    root = np.sqrt(huber_weights(rows))
    return _scatter(root * rows, root[:, None] * noise.white(responses).T)


def _scatter(rows: np.ndarray, columns: np.ndarray) -> float:
    """Return the SD of what no column takes of the rows, at least the declared 1."""
    Q = spanning(columns)
    unexplained = rows - Q @ (Q.T @ rows)
    return max(1.0, float(np.sqrt(unexplained @ unexplained / max(len(rows) - Q.shape[1], 1))))
