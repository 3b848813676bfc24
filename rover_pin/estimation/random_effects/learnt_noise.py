"""Estimate the noise of an experiment that declares none, from the part of the residual that neither the parameters nor
the candidate effects explain.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from rover_pin.estimation.fit import Fit, again
from rover_pin.estimation.noise import AbsorbedNoise, noise_of
from rover_pin.estimation.random_effects.random_field import RandomField, learnt_sds, random_effects_filter, scales
from rover_pin.estimation.residual import huber_weights

ALTERNATIONS = 2
"""Number of times that the noise is estimated and the model is then fitted again. The first estimate still contains
part of the misfit; the second is assumed to be close enough to the limit of many alternations."""


def with_learnt_noise(base: Fit, shifts: Sequence[np.ndarray]) -> Fit:
    """Estimate noise and random effects (random differences between folds) from the unexplained residual, and return
    the fit repeated with them.

    Parameters
    ----------
    base : Fit
        Fit of the base model.
    shifts : sequence of array (folds, channels, samples)
        Change of the prediction by each candidate effect. The part of the residual that these changes can imitate
        counts as explained, so that a missing effect is not taken for noise.
    """
    experiment = base.task.experiment
    least, field = experiment.least_noise(base.model), experiment.random_field(base.model)
    for _ in range(ALTERNATIONS):
        unexplained, absorbed = residuals(base, shifts, field)
        noisy = with_noise(base, unexplained, least, absorbed)
        base = again(noisy if field is None else with_random_effects(noisy, shifts, field), reuse=True)
    return base


def residuals(
    base: Fit, shifts: Sequence[np.ndarray], field: RandomField | None = None
) -> tuple[np.ndarray, AbsorbedNoise]:
    """Return the unexplained part of the residual (folds, channels, samples) for the estimate of the noise, and the
    noise that the explained part absorbed.

    `shifts` are the changes of the prediction by each candidate effect. The unexplained part is the residual minus the
    part that parameters, candidates and random effects can explain. A random effect may explain a part of the residual
    that its SD allows; in the first alternation, its assumed size serves as its SD. The fitted columns also absorb
    noise: p columns fitted to n residuals absorb the fraction p / n of its variance, and a larger fraction of its
    correlation in time. The second result holds the variance and covariance of the absorbed noise, which `noise_of`
    adds again. Without this correction, the noise of a short log would be estimated much too small.
    """
    # All columns that can explain part of the residual: parameters, candidates, and random differences in units of
    # their SD.
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
    # Random effects have a prior SD of 1 in their own size; parameters and candidates are nearly free.
    penalty = np.where(np.arange(len(scale)) < free, 1e-4, 1.0 / scale**2)
    scaled = columns / scale
    # Ridge regression with Huber's weights, solved in the eigenvectors of its normal matrix.
    weighted = scaled * root[:, None]
    normal = weighted.T @ weighted + np.diag(penalty)
    size = np.sqrt(np.diag(normal))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    # Columns that are nearly equal leave eigenvalues of round-off, which would amplify noise.
    sound = values > len(values) * np.finfo(float).eps * values[-1]
    axes = vectors[:, sound] / np.sqrt(values[sound]) / size[:, None]
    share = axes @ (axes.T @ (scaled.T @ (root**2 * rows))) / scale
    projected = explained / scale @ axes
    # Products with the block before give back the memory that the columns absorbed.
    before = np.concatenate([np.zeros_like(projected[..., :1, :]), projected[..., :-1, :]], axis=-2)
    absorbed = AbsorbedNoise(np.sum(projected**2, axis=-1), np.sum(projected * before, axis=-1))
    return np.asarray(base.residual - explained @ share), absorbed


def with_random_effects(base: Fit, shifts: Sequence[np.ndarray], field: RandomField) -> Fit:
    """Return the fit with estimated SDs of the random effects (random differences between folds); its parameters are
    not fitted again.

    The noise of the returned fit removes the expected contribution of the random effects from the whitened residuals.
    `shifts` are the changes of the prediction by each candidate effect.
    """
    # Whitened with the noise as estimated so far; outliers count less, as in the fit.
    noise = base.task.noise
    free = noise.white(np.array([base.slopes[parameter.name] for parameter in base.parameters] + [*shifts])).T
    columns, rows = noise.white(field.moved).T, base.rows
    root = np.sqrt(huber_weights(rows))
    learnt = learnt_sds(root * rows, root[:, None] * free, root[:, None] * columns, field)
    learnt_noise = dataclasses.replace(noise, random_effects=random_effects_filter(field, columns, noise.good, learnt))
    return dataclasses.replace(base, task=dataclasses.replace(base.task, noise=learnt_noise))


def with_noise(base: Fit, residual: np.ndarray, least: np.ndarray, absorbed: AbsorbedNoise | None = None) -> Fit:
    """Return the fit with noise that is estimated from a residual (folds, channels, samples); its parameters are not
    fitted again.

    The SD of each channel is raised to at least `least` (channels,). `absorbed` is the noise that the fitted parameters
    absorbed (see `AbsorbedNoise`).
    """
    noise = noise_of(residual, base.task.noise.good, least, absorbed)
    return dataclasses.replace(base, task=dataclasses.replace(base.task, noise=noise))
