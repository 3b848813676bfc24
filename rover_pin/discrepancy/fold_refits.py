"""Every fold of an experiment as the others predict it: to first order, and by whole refits."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation.fit import Fit, Task, fit
from rover_pin.estimation.noise import huber
from rover_pin.estimation.parameter import Parameter

FAR = 3.0
"""Default sizes by which a size may move when a run is left out, that the other runs hardly tell."""


def fall_of(without: np.ndarray, new_losses: np.ndarray) -> float:
    """Return by how much held-out losses (folds,) fall, over the folds that both models predict.

    NaN where the second loses a fold that the first predicts: on the rest alone the two are not compared. A fold that
    only the second predicts counts for neither.
    """
    return float((without - new_losses)[~np.isnan(without)].sum())


def losses_of(fitted: Fit) -> np.ndarray:
    """Return the robust chi2 of every run (runs,) as fits to the others predict it."""
    rows, owner = fitted.task.noise.white(held_out_residual(fitted)), fitted.task.noise.fold
    return np.array([huber(rows[owner == run]) for run in range(len(fitted.predicted))])


def held_out_residual(fitted: Fit) -> np.ndarray:
    """Return the residual (runs, channels, blocks) with every run as a fit to the others predicts it.

    The fits descend from the whole one with its slopes; sizes are held near their values by SDs of FAR default sizes.
    A run that no fit to the others predicts is NaN.
    """
    residual = fitted.residual.copy()
    for run, fold_fit in enumerate(fold_fits(fitted)):
        residual[run] = np.nan if fold_fit is None else fold_fit.missed[run]
    return residual


def fold_fits(fitted: Fit) -> Iterator[Fit | None]:
    """Yield the fit to all runs but one, one a run, or None where it does not end; as it is for a run it has not."""
    noise = fitted.task.noise
    parameters = tuple(_weak_prior(parameter, u) for parameter, u in zip(fitted.parameters, fitted.u, strict=True))
    start = np.array([u if parameter.prior else 0.0 for parameter, u in zip(fitted.parameters, fitted.u, strict=True)])
    slopes = {
        parameter.name: fitted.slopes[parameter.name] * (1.0 if parameter.prior else FAR)
        for parameter in fitted.parameters
    }
    for run in range(len(fitted.predicted)):
        if not noise.good[run].any():
            yield fitted
            continue
        good = noise.good.copy()
        good[run] = False
        task = Task(fitted.task.experiment, dataclasses.replace(noise, good=good))
        try:
            yield fit(task, fitted.model, parameters, start, slopes, reuse=True)
        except OptimisationError:
            yield None


def _weak_prior(parameter: Parameter, u: float) -> Parameter:
    if parameter.prior:
        return parameter
    return dataclasses.replace(parameter, origin=parameter.value(u), scale=FAR * parameter.scale, prior=True)
