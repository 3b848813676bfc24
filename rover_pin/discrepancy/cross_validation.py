"""Every fold of an experiment as the others predict it: to first order, and by whole refits."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from rover_pin.errors import OptimisationError
from rover_pin.estimation.fit import Fit, Task, fit
from rover_pin.estimation.noise import huber, huber_weights
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.task import objective

LOST = 1e3
"""Residual [SD] of a run that the fit to the others cannot predict at all."""
FAR = 3.0
"""Default sizes by which a size may move when a run is left out, that the other runs hardly tell."""


def left_out(fitted: Fit) -> np.ndarray:
    """Return the robust chi2 of every run (runs,) as the others predict it, to first order.

    The numbers without a run are one Gauss-Newton step from the optimum, its rows left out; nothing is replayed.
    """
    rows, owner = fitted.rows, run_of_rows(fitted)
    columns, losses = fitted.columns, []
    for run, step in enumerate(_steps_without(fitted)):
        at = owner == run
        losses.append(huber(rows[at] + columns[at] @ step))
    return np.array(losses)


def without_each(fitted: Fit) -> np.ndarray:
    """Return the robust chi2, priors included, of a fit to all runs but one (runs,), to first order."""
    rows, owner, columns = fitted.rows, run_of_rows(fitted), fitted.columns
    found = []
    for run, step in enumerate(_steps_without(fitted)):
        at = owner != run
        found.append(objective((rows + columns @ step)[at], fitted.u + step, fitted.parameters))
    return np.array(found)


def losses_of(fitted: Fit) -> np.ndarray:
    """Return the robust chi2 of every run (runs,) as fits to the others predict it."""
    rows, owner = fitted.task.noise.white(refitted_left_out(fitted)), run_of_rows(fitted)
    return np.array([huber(rows[owner == run]) for run in range(len(fitted.predicted))])


def refitted_left_out(fitted: Fit) -> np.ndarray:
    """Return the residual (runs, channels, blocks) with every run as a fit to the others predicts it.

    The fits descend from the whole one with its slopes; sizes are held near their values by SDs of FAR default sizes.
    A run that no fit to the others predicts counts as LOST.
    """
    residual = fitted.residual.copy()
    for run, one in enumerate(_fits_left_out(fitted)):
        residual[run] = LOST * fitted.task.noise.floor[:, None] if one is None else one.residual[run]
    return residual


def models_left_out(fitted: Fit) -> list[Any]:
    """Return the model as the fit to all runs but one has it, one a run; the whole fit's where there is none."""
    return [(one or fitted).model for one in _fits_left_out(fitted)]


def _fits_left_out(fitted: Fit) -> Iterator[Fit | None]:
    """Yield the fit to all runs but one, one a run, or None where it does not end; as it is for a run it has not."""
    noise = fitted.task.noise
    held = tuple(_anchored(one, u) for one, u in zip(fitted.parameters, fitted.u, strict=True))
    start = np.array([u if one.prior else 0.0 for one, u in zip(fitted.parameters, fitted.u, strict=True)])
    slopes = {one.name: fitted.slopes[one.name] * (1.0 if one.prior else FAR) for one in fitted.parameters}
    for run in range(len(fitted.predicted)):
        if not noise.good[run].any():
            yield fitted
            continue
        good = noise.good.copy()
        good[run] = False
        task = Task(fitted.task.experiment, dataclasses.replace(noise, good=good))
        try:
            yield fit(task, fitted.model, held, start, slopes, reuse=True)
        except OptimisationError:
            yield None


def loss_of(fitted: Fit, residual: np.ndarray) -> float:
    """Return the robust chi2 of a residual (runs, channels, blocks), judged by the noise of a fit."""
    return huber(fitted.task.noise.white(residual))


def _anchored(one: Parameter, u: float) -> Parameter:
    if one.prior:
        return one
    return dataclasses.replace(one, origin=one.value(u), scale=FAR * one.scale, prior=True)


def _steps_without(fitted: Fit) -> list[np.ndarray]:
    """Return how u moves when the rows of each run in turn are left out."""
    rows, columns, owner = fitted.rows, fitted.columns, run_of_rows(fitted)
    prior = np.array([1.0 if one.prior else FAR**-2 for one in fitted.parameters])
    held = np.array([fitted.u[i] if one.prior else 0.0 for i, one in enumerate(fitted.parameters)])
    weights = huber_weights(rows)
    steps = []
    for run in range(len(fitted.predicted)):
        use = weights * (owner != run)
        normal = (columns * use[:, None]).T @ columns + np.diag(prior)
        steps.append(-np.linalg.lstsq(normal, columns.T @ (use * rows) + held, rcond=None)[0])
    return steps


def run_of_rows(fitted: Fit) -> np.ndarray:
    """Return to which run each whitened row belongs."""
    good = fitted.task.noise.good
    return np.broadcast_to(np.arange(good.shape[0])[:, None, None], good.shape)[good]
