"""What the loop says of measurements of any kind: a graded answer, the evidence for it, and what speaks against it."""

from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from rover_pin.base.public import brief
from rover_pin.discrepancy.answer import Answer, plain, score_line
from rover_pin.discrepancy.decision import usual_noise
from rover_pin.discrepancy.draft import Draft
from rover_pin.discrepancy.held_out_errors import ChannelScore, RunScore
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.numbers import Number, assumed_lines
from rover_pin.estimation.profile import CLEAR, Profile
from rover_pin.estimation.wording import Outcome, format_value, got_worse
from rover_pin.inference.beliefs import Beliefs
from rover_pin.inference.next_measurement import NextMeasurement

SCHEMA = 3
"""Version of the plain values of a verdict, as docs/verdict.md describes them."""


class Extra(Protocol):
    """What only one kind of data has to say besides."""

    def lines(self, added: bool) -> list[str]:
        """Return lines for a reader, given whether something was added."""

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""


@brief
class Side(NamedTuple):
    """A model before or after: its fitted numbers, and how well it fits."""

    model: Any
    numbers: tuple[Number, ...]
    misfit: float
    "reduced chi-square; 1 is the noise"
    fit: Fit
    "in the noise widened to what it leaves, where that is more than was declared"


class Alternative(NamedTuple):
    """A set of causes that may act instead: the sizes of its causes, and its held-out RMSE by channel."""

    numbers: tuple[Number, ...]
    errors: dict[str, float]


@brief
@dataclass(frozen=True, eq=False)
class Verdict:
    """The result of the loop. `model` carries the fitted numbers and what was added, and predicts or drives at once."""

    kind: str
    "wheel-rig, drive-log or test-bed"
    answer: Answer
    name: str
    "name of the data"
    sentence: str
    model: Any = field(repr=False)
    effects: tuple[Any, ...] = ()
    "what was added to the base model, or freed in it, at its fitted values"
    named: tuple[str, ...] = ()
    "what was added, or freed, by name"
    indistinguishable: tuple[str, ...] = ()
    "the sets that the data leave, the best first"
    share: float = 0.0
    "of what is missed beyond the noise on data left out, what was added takes so much"
    before: Side | None = field(default=None, repr=False)
    after: Side | None = field(default=None, repr=False)
    scores: tuple[ChannelScore, ...] = field(default=(), repr=False)
    runs: tuple[RunScore, ...] = field(default=(), repr=False)
    "held-out errors of every fold"
    chosen: dict[str, str] = field(default_factory=dict)
    "what is chosen when each fold is left out of the choice as well; empty: nothing"
    vetoes: tuple[str, ...] = ()
    "what keeps a name from standing alone"
    cautions: tuple[str, ...] = ()
    findings: tuple[Any, ...] = ()
    "what the check of the data found"
    experiments: tuple[NextMeasurement, ...] = ()
    "what to measure next"
    beliefs: Beliefs | None = field(default=None, repr=False)
    "what the data make of all hypotheses, where they were weighed"
    profiles: tuple[Profile, ...] = field(default=(), repr=False)
    baselines: tuple[Baseline, ...] = field(default=(), repr=False)
    "held-out errors of what a user would otherwise take"
    rival: str = ""
    "which of these predicts what was left out better than the model, in a sentence"
    errors_anew: dict[str, float] = field(default_factory=dict, repr=False)
    "RMSE of each channel, every fold predicted with what is chosen and fitted without it, or by all hypotheses as \
the other folds weigh them"
    others: dict[str, Alternative] = field(default_factory=dict, repr=False)
    "sets that cannot be distinguished from what is kept, by name"
    draft: Draft | None = field(default=None, repr=False)
    "of what is on no list, as it was tried"
    extra: Extra | None = field(default=None, repr=False)
    files: tuple[Path, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict, repr=False)
    "versions, seed, seconds, the command that repeats it"

    @property
    def tried(self) -> int:
        """How many candidates were tried."""
        return self.beliefs.choice if self.beliefs is not None else 0

    @property
    def model_description(self) -> str:
        """What `model` is, in words."""
        if self.after is None:
            return "the base model as declared, nothing fitted"
        added = " + ".join(self.named)
        return f"the model with {added}" if added else "the fitted base model, to which nothing was added"

    @property
    def agreeing_folds(self) -> int:
        """How many folds choose what was added when they are left out of the choice, or nothing where nothing was."""
        return sum(set(name.split(" + ")) == set(self.named or ("",)) for name in self.chosen.values())

    @property
    def chosen_again(self) -> str:
        """How many folds choose the same, in words; where nothing was added, what they choose."""
        if not self.named:
            kinds = list(dict.fromkeys(self.chosen.values()))
            times = [f"{name or 'no effect'} in {list(self.chosen.values()).count(name)}" for name in kinds]
            return f"chosen in {len(self.chosen)} folds: " + ", ".join(times)
        more = sum(set(name.split(" + ")) > set(self.named) for name in self.chosen.values())
        among = f", and with another in {more}" if more else ""
        return f"{' + '.join(self.named)} chosen in {self.agreeing_folds} of {len(self.chosen)} folds{among}"

    def _errors_text(self, errors: dict[str, float]) -> str:
        units = {score.name: score.unit for score in self.scores}
        return ", ".join(
            f"{name} {format_value(error, units[name])}" for name, error in errors.items() if name in units
        )

    @property
    def drifted(self) -> tuple[Number, ...]:
        """Numbers that sit away from what was declared or assumed of them."""
        return tuple(number for number in (self.after.numbers if self.after else ()) if abs(number.drift) > CLEAR)

    def summary(self) -> str:
        """Return the verdict in a page of text; angles in degrees."""
        lines = [f"{self.name}: {self.answer.value}", f"  {self.sentence}", *(f"  check: {f}" for f in self.findings)]
        if self.before is not None and self.after is not None:
            lines += [f"  reduced chi-square: {self.before.misfit:.3g} -> {self.after.misfit:.3g}; 1 is the noise"]
        is_short, anew = len(self.scores) <= FEW, self._errors_text(self.errors_anew)
        lines += [f"  {score_line(score)}" for score in self.scores if score.worded.outcome in CLAIMED or is_short]
        if self.beliefs is not None:
            taken = ", ".join(f"{name} {times:.2f}" for name, times in self.beliefs.noise_taken(self.named).items())
            lines.append(f"  taken for noise: {taken} times {usual_noise(self.beliefs)}")
        for name, (numbers, errors) in self.others.items():
            beside = f"  with {name} instead: " if self.named else f"  with {name}: "
            fitted = ", ".join(number.text for number in numbers)
            lines.append(f"{beside}{fitted}; held-out RMSE {self._errors_text(errors)}")
        missed = f"; held-out RMSE of all hypotheses together: {anew}" if anew else ""
        lines += [f"  {self.chosen_again}{missed}"] if self.chosen else []
        lines += [f"  {got_worse((score.name, score.worded) for score in self.scores)}"] if self.named else []
        lines += [f"  {line}" for line in (self.extra.lines(bool(self.named)) if self.extra else [])]
        lines += [f"  draft: {line}" for line in (self.draft.lines() if self.draft else [])]
        lines += [f"  {number.text}" for number in self._worth_a_line()]
        lines += [f"  {line}" for line in assumed_lines(self.after.numbers if self.after else ())]
        lines += [f"  against the name: {veto}" for veto in self.vetoes]
        lines += [f"  caution: {caution}" for caution in self.cautions]
        lines += [f"  next: {experiment.sentence}" for experiment in self.experiments]
        lines += [f"  written: {file}" for file in self.files]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"

    def _worth_a_line(self) -> list[Number]:
        """Return the numbers of a small model, or of a large one those that were added or sit away."""
        numbers = self.after.numbers if self.after else ()
        if len(self.scores) <= FEW:
            return list(numbers)
        prefixes = tuple(name.partition("@")[0] + "." for name in self.named)
        return [number for number in numbers if number.name.startswith(prefixes) or number in self.drifted]

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as plain values for JSON; SI units, NaN and infinities as None."""
        sides, beliefs = {"before": self.before, "after": self.after}, self.beliefs
        return plain(
            {
                "kind": self.kind,
                "schema": SCHEMA,
                "name": self.name,
                "answer": self.answer.value,
                "sentence": self.sentence,
                "effects": [type(effect).__name__ for effect in self.effects],
                "named": list(self.named),
                "alike": list(self.indistinguishable),
                "share": self.share,
                "reduced_chi_square": {name: side.misfit for name, side in sides.items() if side is not None},
                "held_out": [score.as_dict() for score in self.scores],
                "held_out_folds": [run_score._asdict() for run_score in self.runs],
                "folds": self.chosen,
                "held_out_anew": self.errors_anew,
                "held_out_others": {name: alternative.errors for name, alternative in self.others.items()},
                "others": {name: _numbers(alternative) for name, alternative in self.others.items()},
                "vetoes": list(self.vetoes),
                "cautions": list(self.cautions),
                "findings": [str(finding) for finding in self.findings],
                **{name: _numbers(side) for name, side in sides.items()},
                "baselines": [baseline._asdict() for baseline in self.baselines],
                "rival": self.rival,
                "profiles": [profile._asdict() for profile in self.profiles],
                "experiments": [experiment.sentence for experiment in self.experiments],
                "draft": self.draft.as_dict() if self.draft else {},
                "extra": self.extra.as_dict() if self.extra else {},
                "files": [str(file) for file in self.files],
                "posterior": {**beliefs.as_dict(), "noise": beliefs.noise_taken(self.named)} if beliefs else {},
                **self.provenance,
            }
        )


FEW = 5
"""Channels up to which a summary has a line for each; of more, those whose change can be claimed."""
CLAIMED = Outcome.BETTER, Outcome.WORSE, Outcome.LOST


def _numbers(side: Side | Alternative | None) -> dict[str, Any]:
    return {} if side is None else {number.name: number.as_dict() for number in side.numbers}
