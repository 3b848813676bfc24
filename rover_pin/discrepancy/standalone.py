"""A test bench: an experiment that brings along all that the loop needs, so that one file is enough."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from rover_pin.discrepancy.candidate import Candidate, is_effect, released_candidate
from rover_pin.discrepancy.question import Question
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import Noise, declared_noise
from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.beliefs import Hypothesis
from rover_pin.inference.outlook import Offer


@dataclass(frozen=True)
class Parts:
    """A model of a test bench: named records with numbers, and the effects that act; a bench may have its own."""

    records: Mapping[str, Any]
    effects: tuple[Any, ...] = ()

    def having(self, effect: Any) -> Self:
        """Return the model with this effect, in the place of one of its kind."""
        return replace(
            self,
            effects=(
                *(present_effect for present_effect in self.effects if type(present_effect) is not type(effect)),
                effect,
            ),
        )


class Standalone(Experiment):
    """An experiment that can be read, with its base model, its uncertain numbers and its declared noise."""

    @classmethod
    @abstractmethod
    def read(cls, path: Path) -> Self:
        """Return the experiment from what lies at a path."""

    @abstractmethod
    def base_model(self) -> Any:
        """Return the model as it is declared, before anything is fitted."""

    @abstractmethod
    def uncertain(self, model: Any) -> tuple[Parameter, ...]:
        """Return the numbers that are uncertain without anything being missing, with their priors."""

    @abstractmethod
    def candidates(self, model: Any, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return what may be missing, of these kinds of effects."""

    def records(self, model: Parts) -> dict[str, Any]:
        """Return the records and the effects of a model, by name."""
        return {**model.records, **{type(effect).__name__: effect for effect in model.effects}}

    def replace_record(self, model: Parts, owner: str, record: Any) -> Parts:
        """Return the model with another record or effect of this name."""
        if owner not in model.records:
            return model.having(record)
        return replace(model, records={**model.records, owner: record})

    sd: np.ndarray
    "SD of each channel (channels,) as declared, or as repeats show it: never what the model leaves"

    def noise(self) -> Noise:
        """Return white noise of these SDs."""
        return declared_noise(self.sd, self.observed)

    def along(self) -> tuple[str, np.ndarray] | None:
        """Return over what a picture shows samples, with unit, and its values [folds, samples]; None: in turn."""
        return None

    def next_runs(self) -> Self | None:
        """Return what could be measured next, each a fold of such an experiment with 0 observed; None: nothing."""
        return None

    def insufficient(self) -> str:
        """Return why these data cannot tell anything, and what to measure; empty where they can."""
        return ""


def question_of(standalone: Standalone, kinds: Sequence[type]) -> Question:
    """Return what is asked of a test bench: which of these kinds of effects its model lacks."""
    model = standalone.base_model()

    def candidates(base: Fit) -> tuple[Candidate, ...]:
        records = standalone.records(base.model)
        doubtful = [
            number
            for number in base.parameters
            if number.declared and not is_effect(records[number.name.rpartition(".")[0]])
        ]
        return *standalone.candidates(base.model, kinds), *(released_candidate(number, records) for number in doubtful)

    def offers(leading: Sequence[Hypothesis]) -> tuple[Offer, ...]:
        return () if (ahead := standalone.next_runs()) is None else (Offer(ahead, ahead.noise()),)

    numbers = standalone.uncertain(model)
    return Question("test-bed", standalone.name, standalone, model, numbers, candidates, offers=offers)
