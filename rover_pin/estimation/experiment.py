"""The interface between data and fits: an experiment provides measured values, their predictions by a model, and the
derivatives of these predictions by the parameters.

Every kind of data implements `Experiment`: a wheel rig, a drive log, a motor brake, or a file of a user.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rover_pin.base.errors import ParameterError, closest
from rover_pin.base.quantity import Quantity, quantities
from rover_pin.estimation.noise import Noise
from rover_pin.estimation.parameter import Parameter, parameter_of
from rover_pin.estimation.random_effects.random_field import RandomField

Arrays = dict[str, np.ndarray]
MIN_NOISE = 1e-6
"""Minimum SD of the noise of a channel, in its unit, if the noise is estimated from the residual. Without this minimum,
a channel that never changes would get noise 0 and infinite weight. It is far below the resolution of every sensor."""


class Sensitivities(NamedTuple):
    """A prediction (folds, channels, samples) and its exact derivatives by the parameters u, d predicted / d u
    (parameters, folds, channels, samples).
    """

    predicted: np.ndarray
    slopes: np.ndarray


class Experiment(ABC):
    """Measured values, and the prediction of these values by a model. Arrays have the shape (folds, channels, samples).

    `channels` and `folds` are names. `observed` holds the measured values, NaN for values that are not compared. A fold
    is a group of samples that cross-validation leaves out together, such as a run, a slip level or a load step. A
    campaign is a group of folds measured with one set-up. A model is any object with a method `having(effect)`, which
    returns the model with the effect added. A parameter has a name `owner.quantity`, such as `soil.k`: `owner` is the
    key in `records` of the part of the model that holds the parameter.
    """

    name: str = "experiment"
    stand_in: float = np.inf
    """value that `predict` returns for a missing prediction. Fits with finite differences need a finite value for each
    sample. No error is computed from this value"""
    no_value: str = "the model has no value there"
    """reason for a missing prediction, in words for a report"""
    is_timed: bool = False
    """whether the samples of a fold follow each other in time, so that neighbouring samples are correlated"""
    difference: float = 0.3
    """step of u (parameters in units of their prior SD) for finite differences. It must be large compared with the
    rounding errors and jumps of `predict_near`"""

    if TYPE_CHECKING:  # fields or properties of an implementation, as it likes: a property here would be their default

        @property
        def channels(self) -> tuple[str, ...]:
            """Names of the measured channels."""

        @property
        def folds(self) -> tuple[str, ...]:
            """Names of the groups of samples that cross-validation leaves out together."""

        @property
        def observed(self) -> np.ndarray:
            """Measured values (folds, channels, samples); a value that is NaN is not compared."""

    @abstractmethod
    def predict(self, models: Sequence[Any]) -> np.ndarray:
        """Return the prediction of the measured values by each of several models (models, folds, channels, samples).

        A sample that a model cannot predict is NaN if the experiment has exact derivatives (`Differentiable`).
        Otherwise it is `stand_in`, so that fits with finite differences see finite values only.
        """

    def predict_near(self, models: Sequence[Any]) -> np.ndarray:
        """Return the predictions of models that are all close to the first model, for finite differences between them.

        An implementation may be faster and less accurate than `predict`, if the differences between the models are
        accurate enough.
        """
        return self.predict(models)

    @abstractmethod
    def records(self, model: Any) -> Mapping[str, Any]:
        """Return the parts of a model that hold its parameters (the soil, the motor, each effect), by the name of the
        owner.
        """

    @abstractmethod
    def replace_record(self, model: Any, owner: str, record: Any) -> Any:
        """Return the model with `record` in place of the part called `owner`."""

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return ""

    def quantity(self, model: Any, name: str) -> Quantity:
        """Return the description of the parameter `owner.quantity`: its unit, its bounds and its source."""
        return find(self.records(model), name)[2]

    def value(self, model: Any, name: str) -> float:
        """Return the value of the parameter `owner.quantity` in a model [SI]."""
        # Each value is replaced in the model that the replacement before returned, so that several values of one part
        # add up.
        record, quantity, _ = find(self.records(model), name)
        return float(getattr(record, quantity))

    def with_values(self, model: Any, values: dict[str, float]) -> Any:
        """Return the model with new values [SI] of some parameters; `values` maps `owner.quantity` to the value."""
        for name, value in values.items():
            record, quantity, _ = find(self.records(model), name)
            model = self.replace_record(model, name.rpartition(".")[0], record.replace(**{quantity: value}))
        return model

    def parameter(self, model: Any, name: str, sd: float, log: bool = False, declared: str = "") -> Parameter:
        """Return the parameter `owner.quantity` as a free parameter of a fit, with its present value as the mean of its
        prior.

        Parameters
        ----------
        model : model
            Model that holds the value.
        name : str
            Name of the parameter.
        sd : float
            SD of the prior: in the unit of the parameter, or relative if `log` is True.
        log : bool
            Whether the logarithm of the parameter is fitted, for a parameter that may change by factors.
        declared : str
            Place where the data declare the value. If the text is empty, the value counts as assumed, with the source
            that its quantity states.
        """
        return parameter_of(name, find(self.records(model), name)[0], sd, log, declared)

    def noise(self) -> Noise | None:
        """Return the noise of the measured values, as declared or as estimated from repeated measurements; None if the
        noise has to be estimated from the residual of a fit.
        """
        return None

    def floor(self) -> np.ndarray | None:
        """Return the smallest error (SD) of each channel (channels,) that a model can reach, estimated from the scatter
        of samples.

        None means that this scatter is unknown; the noise then counts as the smallest error.
        """
        return None

    def least_noise(self, model: Any) -> np.ndarray:
        """Return the minimum SD of the noise of each channel (channels,), if the noise is estimated from the residual.

        Without a minimum, a channel that never changes, or a channel that a fit predicts exactly, would have no noise
        and an infinite weight.
        """
        return np.full(len(self.channels), MIN_NOISE)

    def random_field(self, model: Any) -> RandomField | None:
        """Return the random differences between folds (such as newly prepared terrain) and how each changes the
        prediction.

        None means that the experiment has no model of such differences.
        """
        return None

    @property
    def campaigns(self) -> np.ndarray:
        """Index of the campaign of each fold (folds,). A campaign is a group of folds measured with one set-up. The
        noise, and the smooth discrepancy between model and data, are estimated for each campaign separately.
        """
        return np.zeros(len(self.folds), dtype=int)

    @property
    def varied(self) -> np.ndarray:
        """Set quantities at each sample (folds, samples, inputs), such as slip and load. A discrepancy between model
        and data is assumed to be a smooth function of these quantities.
        """
        folds, _, samples = np.shape(self.observed)
        return np.zeros((folds, samples, 0))

    def reading_errors(self, model: Any) -> tuple[Parameter, ...]:
        """Return possible errors of the measurement (such as an offset of a sensor) that the data do not declare, as
        parameters with the value 0. Each is a candidate for the cause of the residual.
        """
        return ()

    def turns(self) -> np.ndarray | None:
        """Return the position of each sample in the order of measurement (folds, samples), along which the noise may
        drift.

        None if the order is unknown. Also None if the folds were measured one after the other: a drift would then look
        like a dependence on the quantity that differs between the folds.
        """
        return None

    def unpredicted_part(self, model: Any) -> str:
        """Return a text about the measured values that a model cannot predict, with the reason; empty if it predicts
        all values.
        """
        return ""

    def neighbours(self, candidate: Any, step: float) -> Sequence[Any]:
        """Return copies of a local candidate (an effect that acts on a stretch of the path only) with slightly
        different stretches.

        In each copy the edges of the stretch are moved by `step` [m]. The search for missing effects compares the
        copies to find the stretch that fits best. The result is empty if the candidate is not local.
        """
        return ()

    def cached_arrays(self, request: tuple[Any, ...], make: Callable[[], Arrays]) -> Arrays:
        """Return stored arrays for a request, or call `make` and return its arrays.

        An experiment that stores the arrays of earlier requests can continue a search that was stopped: an equal
        request is then not computed again. This default stores nothing and always calls `make`.
        """
        return make()


class Differentiable(Experiment):
    """An experiment with exact derivatives of its prediction by the parameters, at little more than the cost of a
    prediction.

    Fits then start from several points and end at a minimum, and cross-validation repeats the fit for every fold.
    """

    @abstractmethod
    def sensitivities(self, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> Sensitivities:
        """Return the prediction for parameters at u (parameters,), and its exact derivatives by u.

        `parameters` are the free parameters of the model, and u their values in units of their prior SD.
        """


def find(records: Mapping[str, Any], name: str) -> tuple[Any, str, Quantity]:
    """Return the part of a model that holds the parameter `owner.quantity`, the name of the quantity, and its
    `Quantity` (unit, bounds and source).

    `records` are the parts of the model by the name of the owner. Raises ParameterError if the model has no such part,
    or the part no such quantity; the message lists the closest names.
    """
    owner, _, quantity = name.rpartition(".")
    if owner not in records:
        raise ParameterError(
            f"The model has no '{owner}' to fit (from the parameter '{name}'): {closest(owner, records)}"
        )
    specs = quantities(records[owner])
    if quantity not in specs:
        raise ParameterError(f"'{owner}' has no number '{quantity}': {closest(quantity, specs)}")
    return records[owner], quantity, specs[quantity]


ADDITIVITY_TOLERANCE = 0.1
"""Limit for recognising samples whose prediction jumps; the derivative of such a sample is set to 0.

All parameters are changed together and one by one. If the joint change of the prediction differs from the sum of the
single changes by more than this fraction of that sum, plus the steps of all parameters, the prediction counts as
jumping. The steps are added, because a curved prediction deviates in proportion to the steps. The value is assumed: it
lies between the deviation of a curve and the deviation of a jump, whose change does not depend on the step."""


def model_at(experiment: Experiment, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> Any:
    """Return the model with its free parameters set to u (parameters,), which are in units of their prior SD."""
    return experiment.with_values(
        model, {parameter.name: parameter.value(x) for parameter, x in zip(parameters, u, strict=True)}
    )


def slopes_at(experiment: Experiment, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> np.ndarray:
    """Return the derivatives of the prediction by the parameters at u: d predicted / d u (parameters, folds, channels,
    samples).

    The derivatives are exact if the experiment has exact ones; otherwise they are one-sided finite differences. A
    finite difference is set to 0 for samples whose prediction jumps, for example samples of a wheel that just stops.
    The test for a jump: a double step of all parameters together changes a smooth prediction by twice the sum of the
    single changes, within a tolerance (ADDITIVITY_TOLERANCE).
    """
    if isinstance(experiment, Differentiable):
        return experiment.sensitivities(model, parameters, u).slopes
    model_at_u = model_at(experiment, model, parameters, u)
    step = experiment.difference
    # Differences point away from an upper bound.
    steps = [step if x + step <= parameter.bounds[1] else -step for parameter, x in zip(parameters, u, strict=True)]
    rows = list(zip(parameters, u, steps, strict=True))
    # One model for each parameter, and one more in which all parameters are changed by twice their step.
    single = [{parameter.name: parameter.value(x + change)} for parameter, x, change in rows]
    together = {parameter.name: parameter.value(x + 2.0 * change) for parameter, x, change in rows}
    models = [experiment.with_values(model_at_u, values) for values in (*single, together)]
    # All models go into one call, because an experiment can simulate them in parallel.
    centre, *predictions, both = experiment.predict_near([model_at_u, *models])
    changes = np.array(predictions) - centre
    # A curved prediction deviates in proportion to the steps, a jump deviates by a fixed amount.
    share = ADDITIVITY_TOLERANCE + step * len(steps)
    is_smooth = np.abs(both - centre - 2.0 * changes.sum(axis=0)) <= 2.0 * share * np.abs(changes).sum(axis=0)
    return np.where(is_smooth, changes / np.reshape(steps, (-1, 1, 1, 1)), 0.0)
