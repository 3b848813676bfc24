"""Take a fit to the minimum of chi2, and test whether it is there.

A fit with finite differences can end before the minimum: its derivatives are reused, and the prediction may bend or
jump between the points at which they were computed. Two tests need no trust in the derivatives at the end. The first
predicts the model at points along chosen parameters, lets the other parameters follow, and starts a new descent where
chi2 is smaller: this is the profile of chi2 along these parameters. The second is the decrease of chi2 that the
derivatives still predict.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation.experiment import model_at
from rover_pin.estimation.fit import Fit, again, fit
from rover_pin.estimation.parameter import bounds_of, prior_curvature
from rover_pin.estimation.profile import NORMAL_95
from rover_pin.estimation.residual import chi2, huber_weights

PROBES = -1.5, -0.6, -0.2, 0.2, 0.6, 1.5
"""Distances of the tested points from the fitted value of a parameter, in units of half its 95 % interval, or of its
prior SD if this is smaller. The outer points lie outside the interval, because the interval of a fit that ended on a
slope of chi2 can be too narrow. The inner points are for the opposite case: at a local minimum with small derivatives,
the interval is too wide."""
MIN_LOWER = 2.0
"""Smallest decrease of chi2 (per inflation of the noise) at a tested point that starts a new descent. A decrease by 2
is one nat of log evidence; a smaller one does not change an answer."""
MAX_DESCENTS = 4
"""Maximum number of further descents, each from the tested point with the smallest chi2. If the tested points are still
lower after the last one, the fit did not reach its minimum, and the answer states this. Each descent computes the
derivatives again."""


class Completion(NamedTuple):
    """A fit that was taken to the minimum of chi2."""

    fit: Fit
    fall: float
    """decrease of chi2 that a tested point shows, or that the derivatives predict, after the last descent; 0 if the fit
    is at its minimum"""
    predictions: int
    """number of models that were predicted"""


def to_minimum(start: Fit, names: Sequence[str]) -> Completion:
    """Continue a fit to the minimum of chi2, and return the fit with the decrease of chi2 that is still possible.

    Parameters
    ----------
    start : Fit
        The fit to continue; its derivatives are computed again.
    names : sequence of str
        Names of the parameters along which the end of the fit is tested, such as the sizes of the added effects.
    """
    fitted = again(start, stale=True)
    predictions, descents = fitted.predictions, 0
    while True:
        point, fall, tested = lowest_probe(fitted, names)
        predictions += tested
        least = MIN_LOWER * fitted.task.noise.inflation
        if fall < least:
            # No tested point is lower. The descent may still have ended early, with a long step before it.
            remaining = fitted.remaining_fall
            return Completion(fitted, remaining if remaining > least else 0.0, predictions)
        if descents == MAX_DESCENTS:
            return Completion(fitted, fall, predictions)
        descents += 1
        try:
            end = fit(fitted.task, fitted.model, fitted.parameters, point, fitted.slopes, stale=True)
        except OptimisationError:
            return Completion(fitted, fall, predictions)
        predictions += end.predictions
        # A descent from a lower point cannot end above this point, so that the fit improves each time.
        fitted = end


def lowest_probe(fitted: Fit, names: Sequence[str]) -> tuple[np.ndarray, float, int]:
    """Return the tested point u with the smallest chi2, the decrease of chi2 there, and the number of predicted models.

    The points lie along each parameter in `names`, at the distances PROBES. At each point the other parameters take one
    Newton step from the prediction at this point, with their derivatives of the fit. The decrease is 0 if no point is
    lower.
    """
    low, high = bounds_of(fitted.parameters).T
    points, held = [], []
    for at, parameter in enumerate(fitted.parameters):
        if parameter.name in names:
            half = NORMAL_95 * float(fitted.spread[at])
            moved = np.eye(len(low))[at] * (min(half, 1.0) if parameter.prior else half)
            points += [np.clip(fitted.u + share * moved, low, high) for share in PROBES]
            held += [at] * len(PROBES)
    if not points:
        return fitted.u, 0.0, 0
    rows = _rows(fitted, points)
    columns, curvature = fitted.columns, prior_curvature(fitted.parameters)
    losses = np.full(len(points), np.inf)
    for index, at in enumerate(held):
        # A point that the model cannot predict is no start of a descent.
        if not np.isfinite(rows[index]).all():
            continue
        # The other parameters follow: normal equations with Huber's weights and the priors, within the bounds.
        weighted = columns * huber_weights(rows[index])[:, None]
        normal, gradient = columns.T @ weighted + curvature, weighted.T @ rows[index] + curvature @ points[index]
        free = np.arange(len(low)) != at
        step = np.zeros(len(low))
        step[free] = -np.linalg.lstsq(normal[np.ix_(free, free)], gradient[free], rcond=None)[0]
        followed = np.clip(points[index] + step, low, high)
        losses[index] = chi2(rows[index] + columns @ (followed - points[index]), followed, fitted.parameters)
        points[index] = followed
    # The losses follow from the derivatives, so that the best point is predicted once more.
    best = points[int(np.argmin(losses))]
    if not losses.min() < fitted.chi2:
        return fitted.u, 0.0, len(points)
    loss = chi2(_rows(fitted, [best])[0], best, fitted.parameters)
    return best, max(fitted.chi2 - loss, 0.0) if np.isfinite(loss) else 0.0, len(points) + 1


def _rows(fitted: Fit, points: Sequence[np.ndarray]) -> np.ndarray:
    """Return the whitened residuals (points, n) of the model at several points u."""
    # All points are predicted in one call, which may run in parallel, and an interrupted search does not repeat it.
    experiment = fitted.task.experiment
    models = [model_at(experiment, fitted.model, fitted.parameters, u) for u in points]
    request = ("points along parameters", fitted.model, tuple(models))
    predicted = experiment.cached_arrays(request, lambda: {"predicted": experiment.predict(models)})["predicted"]
    return fitted.task.rows(predicted)
