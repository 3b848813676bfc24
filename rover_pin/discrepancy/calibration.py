"""The base model fitted, and taken as declared where a missing effect bent the numbers."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_pin.estimation.experiment import Experiment, residual
from rover_pin.estimation.fit import Fit, again, fit
from rover_pin.estimation.noise import first_noise
from rover_pin.estimation.parameter import Parameter
from rover_pin.estimation.profile import CLEAR
from rover_pin.estimation.random_effects.learnt_noise import with_noise
from rover_pin.estimation.slopes import at, slopes_at
from rover_pin.estimation.task import Task


def calibrate(experiment: Experiment, model: Any, numbers: Sequence[Parameter]) -> Fit:
    """Return the model with its uncertain numbers fitted, the noise as declared, or taken as large as what is left."""
    declared = experiment.noise()
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
    model = at(experiment, fitted.model, parameters, u)

    def predict_declared() -> dict[str, np.ndarray]:
        slopes = slopes_at(experiment, model, parameters, u)
        return {"predicted": experiment.predict([model])[0], "slopes": slopes}

    cached = experiment.cached_arrays(("as declared", model, parameters, u), predict_declared)
    slopes = dict(zip([parameter.name for parameter in parameters], cached["slopes"], strict=True))
    return Fit(fitted.task, model, parameters, u, cached["predicted"], slopes)
