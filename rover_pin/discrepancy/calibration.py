"""The base model fitted: from several starts, and from what is declared where a missing effect bent the numbers."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_pin.base.errors import OptimisationError
from rover_pin.estimation.exact import scattered
from rover_pin.estimation.experiment import Experiment, residual
from rover_pin.estimation.fit import Fit, again, best_of, fit
from rover_pin.estimation.gauss_newton import at, slopes_at
from rover_pin.estimation.noise import first_noise
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import CLEAR
from rover_pin.estimation.random_effects.learnt_noise import with_noise
from rover_pin.estimation.task import Task

STARTS, WIDER = 6, (1.0, 2.0, 4.0)
"""Starts of the base model's fit where it is exact, and how many times as far they lie where none of them ends."""


def calibrated(experiment: Experiment, model: Any, numbers: Sequence[Parameter], seed: int = 0) -> Fit:
    """Return the model with its uncertain numbers fitted, the noise as declared, or taken as large as what is left.

    Raises OptimisationError: an exact experiment, and none of several starts ends.
    """
    declared = experiment.noise()
    if declared is not None and experiment.is_exact:
        centre = np.array([parameter.u(experiment.value(model, parameter.name)) for parameter in numbers])
        starts = np.array(scattered(numbers, centre, STARTS, seed))
        for times in WIDER:
            best_fit = best_of(Task(experiment, declared), model, numbers, [*(centre + times * (starts - centre))])
            if best_fit is not None:
                return best_fit
        lost = experiment.unpredicted(model)
        why = f"{lost}; start from a model that does, or mend that run" if lost else "free fewer numbers"
        message = f"{experiment.name}: no start of the fit of the base model converged: {why}."
        raise OptimisationError(message, status="")
    if declared is not None:
        return again(fit(Task(experiment, declared), model, numbers))
    initial_residual = residual(experiment.observed, experiment.predict([model])[0])
    least = experiment.least_noise(model)
    base = fit(Task(experiment, first_noise(initial_residual, least)), model, numbers)
    return again(with_noise(base, base.residual, least))


def is_bent(fitted: Fit) -> bool:
    """Return whether a number had to leave what was known beforehand, as where the model lacks something that acts."""
    return any(parameter.prior and abs(u) > CLEAR for parameter, u in zip(fitted.parameters, fitted.u, strict=True))


def as_declared(fitted: Fit) -> Fit:
    """Return the model of a fit with every number that has a prior at its mean; sizes of effects stay."""
    experiment, parameters = fitted.task.experiment, fitted.parameters
    u = np.array([0.0 if parameter.prior else x for parameter, x in zip(parameters, fitted.u, strict=True)])
    model = at(fitted.task, fitted.model, parameters, u)

    def driven() -> dict[str, np.ndarray]:
        slopes = slopes_at(fitted.task, model, parameters, u)
        return {
            "predicted": experiment.predict([model])[0],
            "slopes": np.array([slopes[parameter.name] for parameter in parameters]),
        }

    cached = experiment.cached_arrays(("as declared", model, parameters, u), driven)
    slopes = dict(zip([parameter.name for parameter in parameters], cached["slopes"], strict=True))
    return Fit(fitted.task, model, parameters, u, cached["predicted"], slopes)
