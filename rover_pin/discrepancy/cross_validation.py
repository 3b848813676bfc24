"""Every fold of an experiment as the others predict it: to first order, and by whole refits."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation.fit import Fit, Task, fit
from rover_pin.estimation.noise import huber, huber_weights
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.task import objective

FAR = 3.0
"""Default sizes by which a size may move when a run is left out, that the other runs hardly tell."""


def first_order_surprises(fitted: Fit) -> np.ndarray:
    """Return how badly the others predict every run (runs,): `surprise`, to first order.

    The numbers without a run are one Gauss-Newton step from the optimum, its rows left out; nothing is replayed.
    """
    rows, columns = fitted.rows, fitted.columns
    return _surprises(fitted, (rows + columns @ step for step in _steps(fitted)))


def refitted_surprises(fitted: Fit) -> np.ndarray:
    """Return how badly the others predict every run (runs,): `surprise`, by fits to the others."""
    rows = fitted.task.noise.white(held_out_residual(fitted))
    return _surprises(fitted, (rows for _ in fitted.predicted))


def held_out_losses(fitted: Fit) -> np.ndarray:
    """Return how badly the others predict every fold: its robust chi2 where fits are exact, else its `surprise`."""
    return losses_of(fitted) if fitted.task.experiment.is_exact else refitted_surprises(fitted)


def fall_of(without: np.ndarray, new_losses: np.ndarray) -> float:
    """Return by how much held-out losses (folds,) fall, over the folds that both models predict.

    NaN where the second loses a fold that the first predicts: on the rest alone the two are not compared. A fold that
    only the second predicts counts for neither.
    """
    return float(_falls(without, new_losses).sum())


def _falls(without: np.ndarray, new_losses: np.ndarray) -> np.ndarray:
    return (without - new_losses)[~np.isnan(without)]


def seen_again(without: np.ndarray, new_losses: np.ndarray) -> float:
    """Return the fall of `surprise` over all runs; of three and more that which falls most does not count.

    What a single run shows is not seen again in another.
    """
    falls = _falls(without, new_losses)
    return float(falls.sum() - (max(falls.max(), 0.0) if len(falls) > 2 else 0.0))


def _surprises(fitted: Fit, predicted: Iterable[np.ndarray]) -> np.ndarray:
    """Return the `surprise` of every run (runs,); for each come all rows as they are predicted without it.

    What the others tell is counted in the noise as the fit leaves it.
    """
    columns, weights, owner = fitted.columns, huber_weights(fitted.rows), run_of_rows(fitted)
    noise, surprises = fitted.task.noise.inflation * max(fitted.misfit, 1.0), []
    for run, rows in enumerate(predicted):
        precision = _curvature(columns, weights * (owner != run), fitted.parameters) / noise
        run_rows = rows[owner == run]
        surprises.append(math.nan if np.isnan(run_rows).any() else surprise(run_rows, columns[owner == run], precision))
    return np.array(surprises)


def surprise(e: np.ndarray, columns: np.ndarray, precision: np.ndarray) -> float:
    """Return -2 ln of the density that all other rows give the rows e left out, to which noise alone gives 0.

    They leave the numbers uncertain by P^-1, so the rows e, of SD 1, are of N(0, I + J P^-1 J^T). By Woodbury that is
    min over d of |e + J d|^2 + d^T P d, + ln det(P + J^T J) - ln det P: what alone tells a number may differ from what
    the others say of it by as much as they leave open. e counts robustly.
    Source: Geisser and Eddy, J. Am. Stat. Assoc. 74 (1979) 153; Vehtari, Gelman and Gabry, Stat. Comput. 27 (2017).
    """
    weighted = columns * huber_weights(e)[:, None]
    both = precision + weighted.T @ columns
    step = -np.linalg.solve(both, weighted.T @ e)
    room = np.linalg.slogdet(both)[1] - np.linalg.slogdet(precision)[1]
    return float(huber(e + columns @ step) + step @ precision @ step + room)


def without_each(fitted: Fit) -> np.ndarray:
    """Return the robust chi2, priors included, of a fit to all runs but one (runs,), to first order."""
    rows, owner, columns = fitted.rows, run_of_rows(fitted), fitted.columns
    chi2_by_run = []
    for run, step in enumerate(_steps(fitted)):
        at = owner != run
        chi2_by_run.append(objective((rows + columns @ step)[at], fitted.u + step, fitted.parameters))
    return np.array(chi2_by_run)


def losses_of(fitted: Fit) -> np.ndarray:
    """Return the robust chi2 of every run (runs,) as fits to the others predict it."""
    rows, owner = fitted.task.noise.white(held_out_residual(fitted)), run_of_rows(fitted)
    return np.array([huber(rows[owner == run]) for run in range(len(fitted.predicted))])


def held_out_residual(fitted: Fit) -> np.ndarray:
    """Return the residual (runs, channels, blocks) with every run as a fit to the others predicts it.

    The fits descend from the whole one with its slopes; sizes are held near their values by SDs of FAR default sizes.
    A run that no fit to the others predicts is NaN.
    """
    residual = fitted.residual.copy()
    for run, fold_fit in enumerate(_fold_fits(fitted)):
        residual[run] = np.nan if fold_fit is None else fold_fit.missed[run]
    return residual


def fold_models(fitted: Fit) -> list[Any]:
    """Return the model as the fit to all runs but one has it, one a run; the whole fit's where there is none."""
    return [(fold_fit or fitted).model for fold_fit in _fold_fits(fitted)]


def _fold_fits(fitted: Fit) -> Iterator[Fit | None]:
    """Yield the fit to all runs but one, one a run, or None where it does not end; as it is for a run it has not."""
    noise = fitted.task.noise
    anchored_parameters = tuple(
        _anchored(parameter, u) for parameter, u in zip(fitted.parameters, fitted.u, strict=True)
    )
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
            yield fit(task, fitted.model, anchored_parameters, start, slopes, reuse=True)
        except OptimisationError:
            yield None


def _anchored(parameter: Parameter, u: float) -> Parameter:
    if parameter.prior:
        return parameter
    return dataclasses.replace(parameter, origin=parameter.value(u), scale=FAR * parameter.scale, prior=True)


def _steps(fitted: Fit) -> Iterator[np.ndarray]:
    """Yield how u moves when the rows of each run in turn are left out."""
    rows, columns, owner = fitted.rows, fitted.columns, run_of_rows(fitted)
    prior_gradient = np.array(
        [u if parameter.prior else 0.0 for parameter, u in zip(fitted.parameters, fitted.u, strict=True)]
    )
    weights = huber_weights(rows)
    for run in range(len(fitted.predicted)):
        use = weights * (owner != run)
        normal = _curvature(columns, use, fitted.parameters)
        yield -np.linalg.lstsq(normal, columns.T @ (use * rows) + prior_gradient, rcond=None)[0]


def _curvature(columns: np.ndarray, weights: np.ndarray, parameters: Sequence[Parameter]) -> np.ndarray:
    """Return the normal matrix of weighted rows, every number held by its prior, or by FAR default sizes."""
    prior = np.diag([1.0 if parameter.prior else FAR**-2 for parameter in parameters])
    return np.asarray((columns * weights[:, None]).T @ columns + prior)


def run_of_rows(fitted: Fit) -> np.ndarray:
    """Return to which run each whitened row belongs."""
    good = fitted.task.noise.good
    return np.broadcast_to(np.arange(good.shape[0])[:, None, None], good.shape)[good]
