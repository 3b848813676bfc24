"""The door of fits and of the loop: what an experiment must offer to be fitted, and for what its model lacks."""

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
LEAST_NOISE = 1e-6
"""Least SD of a channel's noise [its unit], where it is learnt."""


class Sensitivities(NamedTuple):
    """A prediction (folds, channels, samples) and its exact slopes d predicted / d u (parameters, folds, ...)."""

    predicted: np.ndarray
    slopes: np.ndarray


class Experiment(ABC):
    """Measurements of something, and a way to predict them from a model; arrays are (folds, channels, samples).

    `channels` and `folds` are names, `observed` is what was measured, NaN where nothing is compared. A fold is what is
    left out together in cross-validation: a run, a level of slip, a step of the load. A model is
    anything with `having(effect)`; its numbers are called `owner.quantity`, after the records that `records` returns.
    """

    name: str = "experiment"
    stand_in: float = np.inf
    "what `predict` has in place of NaN where a fit by differences must step away: no error is taken of it"
    no_value: str = "the model has no value there"
    "why a prediction may be NaN, in words"
    is_timed: bool = False
    "whether samples of a fold follow one another in time, so that neighbours hang together"
    difference: float = 0.3
    "of u for a derivative by a difference: what its `predict_near` rounds, or jumps, must be small against that"

    if TYPE_CHECKING:  # fields or properties of an implementation, as it likes: a property here would be their default

        @property
        def channels(self) -> tuple[str, ...]:
            """Names of the measured channels."""

        @property
        def folds(self) -> tuple[str, ...]:
            """Names of what is left out together."""

        @property
        def observed(self) -> np.ndarray:
            """What was measured; NaN is not compared."""

    @abstractmethod
    def predict(self, models: Sequence[Any]) -> np.ndarray:
        """Return what each model predicts (models, folds, channels, samples), `stand_in` where that is nothing.

        Where slopes are exact that is NaN; else finite everywhere.
        """

    def predict_near(self, models: Sequence[Any]) -> np.ndarray:
        """Return what models predict of which all are near the first, for the differences between them."""
        return self.predict(models)

    @abstractmethod
    def records(self, model: Any) -> Mapping[str, Any]:
        """Return the records of a model whose numbers can be fitted, effects included, by name of the owner."""

    @abstractmethod
    def replace_record(self, model: Any, owner: str, record: Any) -> Any:
        """Return the model with another record of this owner."""

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return ""

    def quantity(self, model: Any, name: str) -> Quantity:
        """Return what is known of a parameter: its unit, bounds and source."""
        return find(self.records(model), name)[2]

    def value(self, model: Any, name: str) -> float:
        """Return the value of a parameter."""
        record, quantity, _ = find(self.records(model), name)
        return float(getattr(record, quantity))

    def with_values(self, model: Any, values: dict[str, float]) -> Any:
        """Return the model with these values of parameters."""
        for name, value in values.items():
            record, quantity, _ = find(self.records(model), name)
            model = self.replace_record(model, name.rpartition(".")[0], record.replace(**{quantity: value}))
        return model

    def parameter(self, model: Any, name: str, sd: float, log: bool = False, declared: str = "") -> Parameter:
        """Return an uncertain number around its present value; `sd` is relative where `log`.

        `declared` says where the data state it; without it is assumed, by the source of its quantity.
        """
        return parameter_of(name, find(self.records(model), name)[0], sd, log, declared)

    def noise(self) -> Noise | None:
        """Return the noise as it is declared, or as repeats show it; None where it is learnt from what is left."""
        return None

    def floor(self) -> np.ndarray | None:
        """Return the SD of each channel (channels,) that no model beats, as samples show it; None: the noise."""
        return None

    def least_noise(self, model: Any) -> np.ndarray:
        """Return the least SD that noise is taken to have in each channel (channels,), where it is learnt.

        A channel that never moves, or a fit that meets all its numbers, shows no noise.
        """
        return np.full(len(self.channels), LEAST_NOISE)

    def random_field(self, model: Any) -> RandomField | None:
        """Return what differs from fold to fold by chance and how that would move a model; None: nothing that shows."""
        return None

    @property
    def campaigns(self) -> np.ndarray:
        """Which campaign each fold (folds,) is of: noise and discrepancy of each are its own."""
        return np.zeros(len(self.folds), dtype=int)

    @property
    def varied(self) -> np.ndarray:
        """What was set at each sample (folds, samples, inputs), over which what a model leaves may be smooth."""
        folds, _, samples = np.shape(self.observed)
        return np.zeros((folds, samples, 0))

    def reading_errors(self, model: Any) -> tuple[Parameter, ...]:
        """Return the errors of the measuring that nobody declares, at none: each may be what is missing."""
        return ()

    def turns(self) -> np.ndarray | None:
        """Return at which turn each sample was measured (folds, samples), by which noise may drift.

        None where that is not known, or folds were measured one after the other: their drift looks like a law.
        """
        return None

    def unpredicted_part(self, model: Any) -> str:
        """Return what of the measurements a model does not predict, and why, in words; empty where it predicts all."""
        return ""

    def neighbours(self, candidate: Any, step: float) -> Sequence[Any]:
        """Return a candidate whose place was sought with its edges moved by `step`; none where there is no place."""
        return ()

    def cached_arrays(self, request: tuple[Any, ...], make: Callable[[], Arrays]) -> Arrays:
        """Return what `make` makes, or what was kept of it when the same was asked before."""
        return make()


class Differentiable(Experiment):
    """An experiment that tells exact slopes at little more than a prediction's cost.

    Fits then start from several points and end at a minimum, and every fold is predicted by whole refits.
    """

    @abstractmethod
    def sensitivities(self, model: Any, parameters: Sequence[Parameter], u: np.ndarray) -> Sensitivities:
        """Return what the model predicts with the parameters at u, and its exact slopes."""


def find(records: Mapping[str, Any], name: str) -> tuple[Any, str, Quantity]:
    """Return the record, the quantity's name and what is known of a parameter called `owner.quantity`.

    Raises ParameterError: the model has no such owner, or it no such number; the message lists the close ones.
    """
    owner, _, quantity = name.rpartition(".")
    if owner not in records:
        raise ParameterError(f"The model has no '{owner}' to fit: {closest(owner, records)}")
    specs = quantities(records[owner])
    if quantity not in specs:
        raise ParameterError(f"'{owner}' has no number '{quantity}': {closest(quantity, specs)}")
    return records[owner], quantity, specs[quantity]


def residual(measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Return measured - predicted, the sign of every residual of the package: above 0 where the model gives too little.

    Whatever is fitted, tested for correlations, tabled, drawn or described as left has it.
    """
    return np.asarray(measured - predicted)
