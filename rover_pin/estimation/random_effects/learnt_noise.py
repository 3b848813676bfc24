"""The noise of an experiment that declares none: what neither numbers, nor candidates, nor random effects explain."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from rover_pin.estimation.fit import Fit, again
from rover_pin.estimation.noise import Absorbed, huber_weights, noise_of
from rover_pin.estimation.random_effects.random_field import RandomField, learnt_sds, random_effects_filter, scales

TURNS = 2
"""How often noise and fit are made in turn."""


def with_learnt_noise(base: Fit, shifts: Sequence[np.ndarray]) -> Fit:
    """Return the fit in noise, and chance, as large as what nothing explains, `shifts` of candidates included."""
    experiment = base.task.experiment
    least, field = experiment.least_noise(base.model), experiment.random_field(base.model)
    for _ in range(TURNS):
        unexplained, absorbed = residuals(base, shifts, field)
        noisy = with_noise(base, unexplained, least, absorbed)
        base = again(noisy if field is None else with_random_effects(noisy, shifts, field), reuse=True)
    return base


def residuals(base: Fit, shifts: Sequence[np.ndarray], field: RandomField | None = None) -> tuple[np.ndarray, Absorbed]:
    """Return the residual (runs, channels, blocks) that no shift and no number explains, to tell noise from.

    Nor does the random field, of which as much is explained as its SDs allow, at first the sizes of its columns.

    Beside it stands what of the noise they took with them, the covariance of what they explain: p columns on n rows
    take p / n of the variance, and more of the memory, which made the noise of a minute's log half as large as it is.
    """
    responses = [base.slopes[parameter.name] for parameter in base.parameters] + [*shifts]
    free, noise = len(responses), dataclasses.replace(base.task.noise, random_effects=None)
    if field is not None:
        effects = base.task.noise.random_effects
        sds = scales(field, effects.learnt) if effects else np.ones(len(field.kind))
        responses += list(sds[:, None, None, None] * field.moved)
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


def with_random_effects(base: Fit, shifts: Sequence[np.ndarray], field: RandomField) -> Fit:
    """Return the fit with the SDs of the random field learnt, what it may have done taken out of its rows."""
    noise = base.task.noise
    free = noise.white(np.array([base.slopes[parameter.name] for parameter in base.parameters] + [*shifts])).T
    columns, rows = noise.white(field.moved).T, base.rows
    root = np.sqrt(huber_weights(rows))
    learnt = learnt_sds(root * rows, root[:, None] * free, root[:, None] * columns, field)
    learnt_noise = dataclasses.replace(noise, random_effects=random_effects_filter(field, columns, noise.good, learnt))
    return dataclasses.replace(base, task=dataclasses.replace(base.task, noise=learnt_noise))


def with_noise(base: Fit, residual: np.ndarray, least: np.ndarray, absorbed: Absorbed | None = None) -> Fit:
    """Return the fit judged by the noise that a residual shows; its numbers are not fitted again."""
    noise = noise_of(residual, base.task.noise.good, least, absorbed)
    return dataclasses.replace(base, task=dataclasses.replace(base.task, noise=noise))
