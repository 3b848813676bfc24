"""How a prediction moves with each number: exactly where an experiment tells that, else by differences."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_pin.estimation.experiment import Differentiable, Experiment
from rover_pin.estimation.parameter import Parameter

ADDS_UP = 0.1
"""Share by which the change of all numbers together may differ from the sum of all, besides a step of each. Why: 1e-5
of steps of 1e-5, where it is smooth."""


def at(experiment: Experiment, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> Any:
    """Return the model with the parameters at u."""
    return experiment.with_values(
        model, {parameter.name: parameter.value(x) for parameter, x in zip(parameters, u, strict=True)}
    )


def slopes_at(experiment: Experiment, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> np.ndarray:
    """Return d predicted / d u (parameters, folds, channels, samples): exact, or one-sided differences.

    They are none where a prediction jumps, as that of a wheel that just stops may: two steps of all numbers together
    do not move it by twice the sum of what single steps do.
    """
    if isinstance(experiment, Differentiable):
        return experiment.sensitivities(model, parameters, u).slopes
    model_at_u = at(experiment, model, parameters, u)
    step = experiment.difference
    steps = [step if x + step <= parameter.bounds[1] else -step for parameter, x in zip(parameters, u, strict=True)]
    rows = list(zip(parameters, u, steps, strict=True))
    single = [{parameter.name: parameter.value(x + change)} for parameter, x, change in rows]
    together = {parameter.name: parameter.value(x + 2.0 * change) for parameter, x, change in rows}
    models = [experiment.with_values(model_at_u, values) for values in (*single, together)]
    centre, *predictions, both = experiment.predict_near([model_at_u, *models])
    changes = np.array(predictions) - centre
    share = ADDS_UP + step * len(steps)
    is_smooth = np.abs(both - centre - 2.0 * changes.sum(axis=0)) <= 2.0 * share * np.abs(changes).sum(axis=0)
    return np.where(is_smooth, changes / np.reshape(steps, (-1, 1, 1, 1)), 0.0)
