"""Fits of the base model of rigs with their declared noise alone, as a reference for studies and tests.

The loop fits the base model together with a discrepancy, as in `discrepancy.conclude.explorer_of`.
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
"""Number of start values of a fit (STARTS). If the fit converges from none of them, the spread of the start values is
multiplied by the factors of WIDER, one after the other."""
SURPRISE = 1e-3
"""Smallest probability of a chi2 as large as the fitted one, if the declared noise were the only cause of the residual.
Below this value, the residual counts as larger than the noise."""


def calibrated(experiment: Experiment, model: Any, numbers: Sequence[Parameter], seed: int = 0) -> Fit:
    """Return the fit of the model's free numbers that has the lowest chi2 among several start values.

    Raises OptimisationError if no start converges.
    """
    noise = experiment.noise()
    assert noise is not None
    centre = np.array([parameter.u(experiment.value(model, parameter.name)) for parameter in numbers])
    starts = np.array(scattered(centre, STARTS, seed))
    # A wider spread of starts is tried only if all starts of the narrower spread fail.
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
    """Return `count` start values of a fit: the centre, and random points whose coordinates u (in prior SDs) differ
    from the centre by up to 1.
    """
    draws = np.random.default_rng(seed).uniform(-1.0, 1.0, (count - 1, len(centre)))
    return [centre, *(centre + draws)]


def is_adequate(fitted: Fit) -> bool:
    """Return whether the declared noise explains the residual with a probability of at least SURPRISE."""
    return float(chi2_law.sf(huber(fitted.rows), fitted.freedom)) >= SURPRISE
