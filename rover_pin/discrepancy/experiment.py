"""An experiment in one file: a class with everything that the search for missing effects needs to know about data of a
new kind.

A user writes such a class, for example for a joint on a test rig. The package also contains such experiments.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from rover_pin.discrepancy.candidate import Candidate, is_effect, released_candidate
from rover_pin.discrepancy.question import LoopData, Progress, Question, quiet
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.noise import Noise, declared_noise
from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.beliefs import Hypothesis
from rover_pin.inference.next_measurement import Offer


@dataclass(frozen=True)
class Parts:
    """A simple model for a `FileExperiment`: named records (objects that hold parameters, for example a soil), and the
    effects that act.

    An experiment may use another class of models instead; it only needs a method `having(effect)`, which returns the
    model with the effect added.

    Example: `Parts({"soil": Soil()}).having(SlipSinkage()).effects` is `(SlipSinkage(),)`.
    """

    records: Mapping[str, Any]
    effects: tuple[Any, ...] = ()

    def having(self, effect: Any) -> Self:
        """Return the model with this effect added; an effect of its class that the model already has is replaced."""
        # A model has at most one effect of each class, so that an effect can be replaced by adding it again.
        others = (present for present in self.effects if type(present) is not type(effect))
        return replace(self, effects=(*others, effect))


class FileExperiment(Experiment, LoopData):
    """An experiment that is complete in one file. The loop can search missing effects with it.

    A derived class implements `read`, `base_model`, `uncertain`, `candidates` and `predict`. The command `rover-pin
    close-loop DATA --experiment FILE` runs the loop on it. `experiments/motor_brake.py` is a short example, and
    `docs/own-experiment.md` explains each method.

    A derived class also sets these attributes: `name`, `channels` and `folds` (tuples of names; a fold is a group of
    samples that cross-validation leaves out together), `observed` (folds, channels, samples) with NaN for missing
    values, and `sd` (channels,).
    """

    file: ClassVar[str] = ""
    """Name of the file that marks a folder as data of this experiment. For an experiment of the package, `close-loop`
    then needs no option --experiment."""
    is_for_loop: ClassVar[bool] = True
    """Whether the loop can search for missing effects in these data; False if the experiment only serves to fit
    parameters."""

    @classmethod
    @abstractmethod
    def read(cls, path: Path) -> Self:
        """Read the data at a path (a file or a folder), and return them as an experiment."""

    @abstractmethod
    def base_model(self) -> Any:
        """Return the model that the search for missing effects starts from, with its declared parameters, before
        anything is fitted.
        """

    @abstractmethod
    def uncertain(self, model: Any) -> tuple[Parameter, ...]:
        """Return the uncertain parameters of the base model, with their priors. Every fit adjusts these parameters."""

    @abstractmethod
    def candidates(self, model: Any, kinds: Sequence[type]) -> tuple[Candidate, ...]:
        """Return the effects that the model may lack, each as a candidate at its default size. `kinds` are all known
        classes of effects.
        """

    def records(self, model: Parts) -> dict[str, Any]:
        """Return a mapping from names to the parts of a model: its records, and its effects under the names of their
        classes.
        """
        return {**model.records, **{type(effect).__name__: effect for effect in model.effects}}

    def replace_record(self, model: Parts, owner: str, record: Any) -> Parts:
        """Return the model with `record` in place of the record or effect called `owner`."""
        # The owner is an effect, which `having` replaces by its class.
        if owner not in model.records:
            return model.having(record)
        return replace(model, records={**model.records, owner: record})

    sd: np.ndarray
    """SD of the noise of each channel (channels,), either declared or from repeated measurements. It must not be
    estimated from the residual of a model"""

    def noise(self) -> Noise:
        """Return the noise of the measured values: white noise with the SDs of the attribute `sd`."""
        return declared_noise(self.sd, self.observed)

    def along(self) -> tuple[str, np.ndarray] | None:
        """Return the quantity on the horizontal axis of the report's figures: its label with unit, and its values
        (folds, samples).

        None means that the samples are plotted one after the other.
        """
        return None

    def next_runs(self) -> Self | None:
        """Return the runs that could be measured next, as an experiment with one fold for each run; None if no further
        run is possible.

        The search for missing effects proposes the most informative of these runs. The measured values (`observed`) are
        0 in this experiment, because nothing is measured yet.
        """
        return None

    def question(self, kinds: Sequence[type], progress: Progress = quiet) -> Question:
        """Return the question for the loop: which of the effects `kinds` does the model lack, or which declared
        parameter is wrong.
        """
        model = self.base_model()

        def candidates(base: Fit) -> tuple[Candidate, ...]:
            # A declared number may be wrong, so each one is a separate candidate that widens its prior. The numbers of
            # effects are left out, because their effects are candidates already.
            records = self.records(base.model)
            declared = [
                number
                for number in base.parameters
                if number.declared and not is_effect(records[number.name.rpartition(".")[0]])
            ]
            return *self.candidates(base.model, kinds), *(released_candidate(number, records) for number in declared)

        def offers(leading: Sequence[Hypothesis]) -> tuple[Offer, ...]:
            runs = self.next_runs()
            return () if runs is None else (Offer(runs, runs.noise()),)

        return Question(self.kind, self.name, self, model, self.uncertain(model), candidates, offers=offers)

    def describe(self) -> str:
        """Return one line of text with the numbers of points and folds and the names of the channels."""
        points = int(np.isfinite(self.observed).any(axis=1).sum())
        return f"{points} points in {len(self.folds)} folds; {', '.join(self.channels)}"
