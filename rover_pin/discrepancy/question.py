"""What the loop is asked: which of the candidates a model lacks, its uncertain numbers free."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from rover_pin.discrepancy.candidate import Candidate
from rover_pin.estimation.columns import Columns
from rover_pin.estimation.experiment import Experiment
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.parameter import Parameter
from rover_pin.inference.beliefs import Hypothesis
from rover_pin.inference.outlook import Offer
from rover_pin.inference.residual_function import smooth_functions

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Question:
    """What the loop is asked: which of the candidates the model lacks, its uncertain numbers free."""

    kind: str
    name: str
    experiment: Experiment
    model: Any
    numbers: tuple[Parameter, ...]
    candidates: Callable[[Fit], Sequence[Candidate]]
    "what may be missing of the calibrated model"
    draft: Callable[[Fit], tuple[str, Candidate] | None] = lambda fitted: None
    "what a fit leaves as the text of an effect file and the effect in it, where that can be described"
    functions: Callable[[Fit], Iterable[Columns]] = smooth_functions
    "what a fit may leave besides noise, where slopes are differences: functions of which at most one acts"
    offers: Callable[[Sequence[Hypothesis]], Iterable[Offer]] = lambda leading: ()
    "what could be measured next, to tell the leading hypotheses apart"
