"""The verdict of the search for missing effects: the answer, the evidence for it, and the reasons to doubt it."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from rover_pin.base.encode import html_text
from rover_pin.base.public import brief
from rover_pin.discrepancy.answer import Answer
from rover_pin.discrepancy.decision import usual_noise
from rover_pin.discrepancy.draft import Draft
from rover_pin.discrepancy.equivalents import Equivalent
from rover_pin.discrepancy.held_out_errors import ChannelScore, RunScore
from rover_pin.estimation.baselines import Baseline
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.numbers import Number, assumed_lines
from rover_pin.estimation.profile import CLEAR_SDS, Profile
from rover_pin.estimation.wording import Outcome, format_value, got_worse
from rover_pin.inference.beliefs import Beliefs
from rover_pin.inference.next_measurement import NextMeasurement

SCHEMA = 3
"""Version of verdict.json. Programs that read the file should refuse another version; docs/verdict.md describes its
keys."""


class Extra(Protocol):
    """Interface of the part of a verdict that only one kind of data has, for example the results about the drive in a
    drive log.
    """

    def lines(self, added: bool) -> list[str]:
        """Return lines for the summary; `added` states whether an effect was added to the model."""

    def as_dict(self) -> dict[str, Any]:
        """Return the results as plain values for verdict.json."""


@brief
class Side(NamedTuple):
    """One side of the comparison in a verdict: the fitted model before or after causes were added, with its parameters
    and its misfit.
    """

    model: Any
    numbers: tuple[Number, ...]
    misfit: float
    """reduced chi-square with the declared noise; 1 means that the residual is noise"""
    fit: Fit
    """the fit of the model. If the residual exceeds the declared noise, the noise of this fit is enlarged to the size
    of the residual"""


class Alternative(NamedTuple):
    """Another set of causes that may act instead of the kept causes: its fitted sizes, and the held-out RMSE of each
    channel with this set (channel name -> RMSE).
    """

    numbers: tuple[Number, ...]
    errors: dict[str, float]


@brief
@dataclass(frozen=True, eq=False)
class Verdict:
    """Result of the search for missing effects.

    `model` is the kept model with its fitted numbers and the added effects; it can predict or drive at once.
    `summary()` is the whole verdict as text, and `as_dict()` the content of verdict.json.

    A fold is a group of samples that cross-validation leaves out together; a held-out error is the error in a fold that
    was predicted by a fit to the other folds.

    Example: `close_the_loop("rig")` returns a verdict; `print(verdict.summary())` shows it.
    """

    kind: str
    """kind of data: wheel-rig, drive-log or test-bed (any other experiment)"""
    answer: Answer
    name: str
    """name of the data set"""
    sentence: str
    """the answer as a sentence, with probabilities"""
    model: Any = field(repr=False)
    effects: tuple[Any, ...] = ()
    """effects of the kept model, with their fitted values, that were added to the base model, or that have a parameter
    that was freed from its prior"""
    named: tuple[str, ...] = ()
    """names of the causes that were added to the base model; a parameter that was freed from its prior counts as a
    cause"""
    indistinguishable: tuple[str, ...] = ()
    """sets of causes that remain possible, the most probable first"""
    share: float = 0.0
    """fraction of the base model's held-out error above the noise that the added causes remove"""
    before: Side | None = field(default=None, repr=False)
    """the fitted base model, before causes were added"""
    after: Side | None = field(default=None, repr=False)
    """the fitted kept model, after causes were added"""
    scores: tuple[ChannelScore, ...] = field(default=(), repr=False)
    """held-out errors of every channel"""
    runs: tuple[RunScore, ...] = field(default=(), repr=False)
    """held-out errors of every fold"""
    chosen: dict[str, str] = field(default_factory=dict)
    """name of a fold -> causes that the search for missing effects would choose without the data of this fold; an empty
    text for no cause"""
    vetoes: tuple[str, ...] = ()
    """reasons against the name of the added effect, for example a size at its bound"""
    cautions: tuple[str, ...] = ()
    """reasons for caution about the data or the model, as sentences"""
    findings: tuple[Any, ...] = ()
    """findings of the data check"""
    experiments: tuple[NextMeasurement, ...] = ()
    """the most informative next measurement, if several sets of causes remain possible"""
    beliefs: Beliefs | None = field(default=None, repr=False)
    """probabilities of all hypotheses given all data"""
    deciding: Beliefs | None = field(default=None, repr=False)
    """probabilities from which the answer follows if held-out data contradict `beliefs`: averages over the folds, or
    the probabilities of the sets of causes that held-out data do not contradict; None if the answer follows from
    `beliefs`"""
    overturned: tuple[str, ...] = ()
    """sentences that state where held-out data contradict the answer that the evidence alone would give; empty if both
    agree"""
    beyond_noise: dict[str, float] = field(default_factory=dict)
    """name of each channel whose residual is too large for noise but is taken for noise -> ratio of the residual to the
    declared noise or to the scatter of the samples"""
    profiles: tuple[Profile, ...] = field(default=(), repr=False)
    baselines: tuple[Baseline, ...] = field(default=(), repr=False)
    """held-out errors of curves that know no physics, or of odometry"""
    rival: str = ""
    """sentence about the curves without physics that predict held-out data better than the model; empty if there is no
    such curve"""
    errors_anew: dict[str, float] = field(default_factory=dict, repr=False)
    """held-out RMSE of each channel, averaged over all fitted hypotheses, if the choice of the causes is also made
    without the held-out fold, not only the fit"""
    others: dict[str, Alternative] = field(default_factory=dict, repr=False)
    """other sets of causes that the data do not distinguish from the kept causes: names of the causes as one text ->
    the set"""
    equivalents: tuple[Equivalent, ...] = ()
    """effects that undeclared numbers of the model can imitate, so that they may act unseen"""
    draft: Draft | None = field(default=None, repr=False)
    """effect that the search for missing effects drafted for a residual that no known effect explains, with the result
    of its trial"""
    extra: Extra | None = field(default=None, repr=False)
    """results that only this kind of data has"""
    files: tuple[Path, ...] = ()
    """files that were written"""
    provenance: dict[str, Any] = field(default_factory=dict, repr=False)
    """versions, seed, duration, and the command that repeats the search for missing effects"""

    @property
    def deciding_beliefs(self) -> Beliefs | None:
        """Probabilities from which the answer follows; None if none were computed."""
        return self.deciding if self.deciding is not None else self.beliefs

    @property
    def tried(self) -> int:
        """Number of candidates that were tried."""
        return self.beliefs.choice if self.beliefs is not None else 0

    @property
    def model_description(self) -> str:
        """Description of `model` in words: the base model, or the model with its added effects."""
        if self.after is None:
            return "the base model as declared, nothing fitted"
        added = " + ".join(self.named)
        return f"the model with {added}" if added else "the fitted base model, to which nothing was added"

    @property
    def agreeing_folds(self) -> int:
        """Number of folds whose data the choice does not depend on: without them, the search for missing effects
        chooses the causes of the verdict.
        """
        return sum(set(name.split(" + ")) == set(self.named or ("",)) for name in self.chosen.values())

    @property
    def chosen_again(self) -> str:
        """Text for a report on the stability of the choice: the number of folds that do not change the chosen causes if
        they are held out.
        """
        if not self.named:
            # Nothing was added: count each set that was chosen without a fold.
            kinds = list(dict.fromkeys(self.chosen.values()))
            times = [f"{name or 'no effect'} in {list(self.chosen.values()).count(name)}" for name in kinds]
            return f"chosen in {len(self.chosen)} folds: " + ", ".join(times)
        # A fold without which the loop chooses the kept causes and others in addition is counted separately.
        more = sum(set(name.split(" + ")) > set(self.named) for name in self.chosen.values())
        among = f", and with another in {more}" if more else ""
        return f"{' + '.join(self.named)} chosen in {self.agreeing_folds} of {len(self.chosen)} folds{among}"

    def _errors_text(self, errors: dict[str, float]) -> str:
        """Return errors of channels (channel name -> error) as text with units; a channel without a held-out score is
        omitted.
        """
        units = {score.name: score.unit for score in self.scores}
        return ", ".join(
            f"{name} {format_value(error, units[name])}" for name, error in errors.items() if name in units
        )

    @property
    def drifted(self) -> tuple[Number, ...]:
        """Parameters of the kept model whose fitted value is more than CLEAR_SDS prior SDs from the declared or assumed
        one.
        """
        return tuple(number for number in (self.after.numbers if self.after else ()) if abs(number.drift) > CLEAR_SDS)

    def summary(self) -> str:
        """Return the verdict as text of about one page; angles are in degrees."""
        # The order is that of a reader's questions: the answer, the errors, the alternatives, the parameters, the
        # doubts.
        lines = [f"{self.name}: {self.answer.value}", f"  {self.sentence}", *(f"  check: {f}" for f in self.findings)]
        if self.before is not None and self.after is not None:
            lines += [f"  reduced chi-square: {self.before.misfit:.3g} -> {self.after.misfit:.3g}; 1 is the noise"]
        is_short, anew = len(self.scores) <= MAX_FULL_SUMMARY, self._errors_text(self.errors_anew)
        lines += [f"  {score.line}" for score in self.scores if score.worded.outcome in CLAIMED or is_short]
        if self.beliefs is not None:
            taken = ", ".join(f"{name} {times:.2f}" for name, times in self.beliefs.noise_taken(self.named).items())
            lines.append(f"  estimated noise: {taken} times {usual_noise(self.beliefs)}")
        for name, (numbers, errors) in self.others.items():
            instead = f"  with {name} instead: " if self.named else f"  with {name}: "
            fitted = ", ".join(number.text for number in numbers)
            lines.append(f"{instead}{fitted}; held-out RMSE {self._errors_text(errors)}")
        missed = f"; held-out RMSE of all hypotheses together: {anew}" if anew else ""
        lines += [f"  {self.chosen_again}{missed}"] if self.chosen else []
        lines += [f"  {got_worse((score.name, score.worded) for score in self.scores)}"] if self.named else []
        lines += [f"  {line}" for line in (self.extra.lines(bool(self.named)) if self.extra else [])]
        lines += [f"  draft: {line}" for line in (self.draft.lines() if self.draft else [])]
        # For data with few channels all parameters, otherwise those that were added or left their priors.
        numbers = self.after.numbers if self.after else ()
        prefixes = tuple(name.partition("@")[0] + "." for name in self.named)
        lines += [
            f"  {number.text}"
            for number in numbers
            if is_short or number.name.startswith(prefixes) or number in self.drifted
        ]
        lines += [f"  {line}" for line in assumed_lines(self.after.numbers if self.after else ())]
        lines += [f"  unseen: {equivalent.sentence}" for equivalent in self.equivalents]
        lines += [f"  against the name: {veto}" for veto in self.vetoes]
        lines += [f"  caution: {caution}" for caution in self.cautions]
        lines += [f"  next: {experiment.sentence}" for experiment in self.experiments]
        lines += [f"  written: {file}" for file in self.files]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return the summary for notebooks."""
        return f"<pre>{html_text(self.summary())}</pre>"

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as plain values for verdict.json, in SI units; NaN and infinities become None."""
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
                "overturned": list(self.overturned),
                "beyond_noise": self.beyond_noise,
                "equivalents": [equivalent.as_dict() for equivalent in self.equivalents],
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


MAX_FULL_SUMMARY = 5
"""Largest number of channels in a summary with a line for each channel and each parameter. With more channels, it shows
only significant changes, so that it stays on one page; a drive log has about twenty channels, a rig up to five.
"""
CLAIMED = Outcome.BETTER, Outcome.WORSE, Outcome.LOST
"""Outcomes of a change of error that a long summary always shows."""


def plain(value: Any) -> Any:
    """Return nested values with None in place of NaN and infinities, because JSON has no such numbers."""
    if isinstance(value, dict):
        return {str(key): plain(element) for key, element in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(element) for element in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _numbers(side: Side | Alternative | None) -> dict[str, Any]:
    """Return the parameters of a fitted model for verdict.json, as a mapping from a parameter's name to plain values;
    an empty dictionary if there is no such model.
    """
    return {} if side is None else {number.name: number.as_dict() for number in side.numbers}
