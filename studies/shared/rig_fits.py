"""The base model of rigs fitted in their declared noise alone: what studies and tests compare with.

The loop fits them with a discrepancy besides, as `discrepancy.conclude.explorer_of` has it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import chi2 as chi2_law

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit, fit
from rover_pin.estimation.least_squares import Task
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.residual import huber

STARTS, WIDER = 6, (1.0, 2.0, 4.0)
"""Starts of a fit, and how many times as far they lie where none of them ends."""
SURPRISE = 1e-3
"""A chi2 less probable than this by the stated noise means that more is left than the noise."""


def calibrated(experiment: Experiment, model: Any, numbers: Sequence[Parameter], seed: int = 0) -> Fit:
    """Return the model with its numbers fitted, the lowest of several starts.

    Raises OptimisationError: none of them ends.
    """
    noise = experiment.noise()
    assert noise is not None
    centre = np.array([parameter.u(experiment.value(model, parameter.name)) for parameter in numbers])
    starts = np.array(scattered(centre, STARTS, seed))
    for times in WIDER:
        fits = []
        for start in centre + times * (starts - centre):
            try:
                fits.append(fit(Task(experiment, noise), model, numbers, start))
            except OptimisationError:
                continue
        if fits:
            return min(fits, key=lambda fitted: fitted.chi2)
    raise OptimisationError(f"{experiment.name}: no start of the fit ends.", status="")


def scattered(centre: np.ndarray, count: int, seed: int) -> list[np.ndarray]:
    """Return `count` starts: the centre, then points scattered around it, within u of 1."""
    draws = np.random.default_rng(seed).uniform(-1.0, 1.0, (count - 1, len(centre)))
    return [centre, *(centre + draws)]


def is_adequate(fitted: Fit) -> bool:
    """Return whether the stated noise leaves as much as a fit does, or more, with at least SURPRISE as probability."""
    return float(chi2_law.sf(huber(fitted.rows), fitted.freedom)) >= SURPRISE
