"""The question that the search for missing effects answers, and the interface of the data that the search works on.

The search itself knows no kind of data. Each kind is a class with the interface `LoopData`: a wheel rig, a drive log,
or an experiment in one file of a user.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.columns import Columns
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.beliefs import Hypothesis
from rover_pin.inference.next_measurement import Offer
from rover_pin.inference.residual_function import smooth_functions

Progress = Callable[[str], None]
"""Function that is called with one line of text before each step of a long computation."""


def quiet(message: str) -> None:
    """Print nothing. This is the default of an argument `progress`."""


@dataclass(frozen=True, eq=False)
class Question:
    """A question for the loop, with its data: which of the candidate effects does the model lack?

    The uncertain parameters of the model are fitted together with the candidates.
    """

    kind: str
    "kind of data: wheel-rig, drive-log or test-bed"
    name: str
    """name of the data set"""
    experiment: Experiment
    model: Any
    """base model that the search for missing effects starts from"""
    numbers: tuple[Parameter, ...]
    """uncertain parameters of the base model, which every fit adjusts"""
    candidates: Callable[[Fit], Sequence[Candidate]]
    """function of the fitted base model that returns the candidates: effects that the model may lack, and parameters
    whose declared values may be wrong"""
    draft: Callable[[Fit], tuple[str, Candidate] | None] = lambda fitted: None
    """function that takes a fit and describes its residual as the text of an effect file, together with the effect as a
    candidate; it returns None if no formula describes the residual"""
    functions: Callable[[Fit], Iterable[Columns]] = smooth_functions
    """function that takes a fit and yields unlisted functions (smooth discrepancies that no known effect causes). At
    most one of them is assumed to act. Only experiments without exact derivatives of the prediction use this function
    """
    offers: Callable[[Sequence[Hypothesis]], Iterable[Offer]] = lambda leading: ()
    """function that takes the most probable hypotheses and returns possible next measurements"""


class LoopData(ABC):
    """Interface of measured data for the search for missing effects: the data check, the question, and the results that
    only this kind of data has.

    A new kind of data is one class with these methods. The methods with a default add nothing, so that `name`,
    `base_model` and `question` suffice.
    """

    kind: ClassVar[str] = "test-bed"
    """Name of the kind of data in verdict.json: wheel-rig, drive-log, or test-bed for every other experiment."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the data in reports."""

    @abstractmethod
    def base_model(self) -> Any:
        """Return the model that the search for missing effects starts from, before anything is fitted."""

    @abstractmethod
    def question(self, kinds: Sequence[type], progress: Progress = quiet) -> Question:
        """Return the question for the loop: which effect does the model lack? `kinds` are the classes of effects that
        may be missing.
        """

    def describe(self) -> str:
        """Return a description of the data in one line, such as the numbers of runs and channels."""
        return self.name

    def insufficient(self) -> str:
        """Return the reason why these data cannot answer the question, and what to measure instead; an empty text if
        the data can answer the question.
        """
        return ""

    def findings(self) -> tuple[Any, ...]:
        """Return the findings of the data check that a reader of the verdict should know."""
        return ()

    def extra(self, verdict: Verdict, question: Question, progress: Progress = quiet, seed: int = 0) -> Verdict:
        """Return the verdict with the results added that only this kind of data has: cautions, errors of curves without
        physics, further errors.
        """
        return verdict

    def write_models(self, model: Any, folder: Path, stem: str, note: str) -> list[Path]:
        """Write a model to the file `folder`/`stem`.toml, with `note` as a comment, and return the written files.

        The list is empty for a kind of data whose models have no file format.
        """
        return []

    @contextmanager
    def resuming(self, progress: Progress = quiet) -> Iterator[None]:
        """Keep the finished steps of the search for missing effects while this context is active, so that a stopped
        search can be continued.
        """
        yield
