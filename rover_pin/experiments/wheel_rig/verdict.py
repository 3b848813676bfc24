"""What the loop found: the effect, or the set of effects, or none, with all the evidence for it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rover_pin.discrepancy.answer import Answer, plain, score_line
from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.effects.effect import Effect
from rover_pin.estimation.profile import Profile
from rover_pin.estimation.wording import got_worse, interval, shown
from rover_pin.experiments.wheel_rig.calibrate import Fitted, Flag
from rover_pin.experiments.wheel_rig.checks import Finding
from rover_pin.experiments.wheel_rig.compare import Candidate, Comparison
from rover_pin.experiments.wheel_rig.fit import RigFit
from rover_pin.experiments.wheel_rig.model import RigModel
from rover_pin.experiments.wheel_rig.remainder import Remainder
from rover_pin.experiments.wheel_rig.reselect import Fold
from rover_pin.experiments.wheel_rig.residual_tests import ResidualTest
from rover_pin.experiments.wheel_rig.screen import Screened
from rover_pin.experiments.wheel_rig.separating_run import SeparatingRun


@dataclass(frozen=True, eq=False)
class Side:
    """A model before or after: fitted values with intervals, what disagrees with other measurements, what is left."""

    model: RigModel
    parameters: tuple[Fitted, ...]
    flags: tuple[Flag, ...]
    remainders: tuple[Remainder, ...]
    misfit: float
    "chi2 per degree of freedom; 1 is the noise"
    fit: RigFit = field(repr=False)
    tests: tuple[ResidualTest, ...] = ()
    "how the residuals hang together with what was set, and with each other"


@dataclass(frozen=True, eq=False)
class Verdict:
    """The result of `close_the_loop`. `model` carries the fitted effects and predicts at once."""

    answer: Answer
    name: str
    "name of the data set"
    sentence: str
    model: RigModel
    effects: tuple[Effect, ...]
    "what was added to the base model, at its fitted values"
    alike: tuple[str, ...]
    "the candidates that the data cannot tell apart, the best first"
    before: Side
    after: Side
    scores: tuple[ChannelScore, ...] = field(repr=False)
    screened: tuple[Screened, ...] = field(repr=False)
    singles: Comparison = field(repr=False)
    pairs: Comparison = field(repr=False)
    explained: float
    "share of chi2 beyond the noise that the added effects take"
    findings: tuple[Finding, ...]
    experiments: tuple[SeparatingRun, ...]
    provenance: dict[str, Any] = field(repr=False)
    "versions, seed, seconds, the command that repeats it"
    base: RigFit = field(repr=False)
    "the fit with which single candidates are compared"
    files: tuple[Path, ...] = ()
    folds: tuple[Fold, ...] = ()
    "what is chosen when each level is left out of the choice as well; where a report is written"
    reselected: tuple[ChannelScore, ...] = field(default=(), repr=False)
    "held-out errors with the effect chosen anew in each fold"
    profiles: tuple[Profile, ...] = field(default=(), repr=False)
    cautions: tuple[str, ...] = ()
    vetoes: tuple[str, ...] = ()
    "what keeps a name from standing alone"

    @property
    def chosen_again(self) -> str:
        """How many folds choose the same, in words; where nothing was added, what they choose."""
        if not self.effects:
            chosen = Counter(fold.chosen for fold in self.folds).most_common()
            return f"chosen in {len(self.folds)} folds: " + ", ".join(f"{name} in {times}" for name, times in chosen)
        names = {type(effect).__name__ for effect in self.effects}
        folds = [set(fold.chosen.split(" + ")) for fold in self.folds]
        same, more = sum(fold == names for fold in folds), sum(fold > names for fold in folds)
        among = f", and with another in {more}" if more else ""
        return f"{' + '.join(sorted(names))} chosen in {same} of {len(folds)} folds{among}"

    @property
    def model_said(self) -> str:
        """What `model` is, in words."""
        added = " + ".join(type(effect).__name__ for effect in self.effects)
        return f"the model with {added}" if added else "the fitted base model, to which nothing was added"

    def summary(self) -> str:
        """Return the verdict in a page of text; angles in degrees."""
        lines = [f"{self.name}: {self.answer.value}", f"  {self.sentence}"]
        lines += [f"  check: {finding}" for finding in self.findings]
        lines += [f"  {score_line(score)}" for score in self.scores]
        lines += [f"  {self.chosen_again}"] if self.folds else []
        lines += [f"  {got_worse((one.name, one.worded) for one in self.scores)}"] if self.effects else []
        lines += [f"  {flag_line(flag, 'before')}" for flag in self.before.flags]
        if self.effects:
            lines += [f"  {flag_line(flag, 'after')}" for flag in self.after.flags]
        lines += [f"  {parameter_line(one)}" for one in self.after.parameters]
        lines += [f"  left: {one.said}" for one in self.after.remainders]
        lines += [f"  caution: {said}" for said in self.cautions]
        lines += [f"  next: {one.said}" for one in self.experiments]
        lines += [f"  written: {file}" for file in self.files]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as plain values for JSON; SI units, NaN and infinities as None."""
        return plain(
            {
                "kind": "rig-verdict",
                "name": self.name,
                "answer": self.answer.value,
                "sentence": self.sentence,
                "effects": [type(effect).__name__ for effect in self.effects],
                "alike": list(self.alike),
                "explained": self.explained,
                "findings": [str(finding) for finding in self.findings],
                "held_out": [score_dict(score) for score in self.scores],
                "held_out_reselected": [score_dict(score) for score in self.reselected],
                "folds": {fold.level: fold.chosen for fold in self.folds},
                "chosen_again": self.chosen_again,
                "cautions": list(self.cautions),
                "vetoes": list(self.vetoes),
                "profiles": [one._asdict() for one in self.profiles],
                "before": _side(self.before),
                "after": _side(self.after),
                "screened": [_screened(row) for row in self.screened],
                "singles": [_candidate(one) for one in self.singles.ranked],
                "pairs": [_candidate(one) for one in self.pairs.ranked],
                "experiments": [one._asdict() for one in self.experiments],
                "files": [str(file) for file in self.files],
                **self.provenance,
            }
        )


def score_dict(score: ChannelScore) -> dict[str, Any]:
    """Return a channel's held-out errors as plain values."""
    return score._asdict() | {"said": score.said, "levels": [one._asdict() for one in score.levels]}


def _side(side: Side) -> dict[str, Any]:
    return {
        "misfit": side.misfit,
        "parameters": {one.name: one._asdict() for one in side.parameters},
        "flags": [
            {
                "name": flag.name,
                "unit": flag.unit,
                "fitted": flag.fitted,
                "independent": [flag.independent.low, flag.independent.high],
                "source": flag.independent.source,
                "agrees": flag.agrees,
                "says": flag.says.value,
            }
            for flag in side.flags
        ],
        "residual_tests": [test._asdict() for test in side.tests],
        "remainder": [
            one._asdict() | {"levels": [level._asdict() for level in one.levels], "said": one.said}
            for one in side.remainders
        ],
    }


def _screened(row: Screened) -> dict[str, Any]:
    return row._asdict() | {"effect": row.name}


def _candidate(one: Candidate) -> dict[str, Any]:
    return {
        "name": one.name,
        "net": one.net,
        "gain": one.gain,
        "fee": one.fee,
        "chi2": one.fit.chi2,
        "misfit": one.fit.misfit,
        "held_out_loss": one.loss,
        "held_out_loss_without": one.reference_loss,
        "accepted": one.accepted,
        "values": {name: one.fit.value(name) for name in one.fit.problem.space.names},
    }


def flag_line(flag: Flag, when: str) -> str:
    """Return one fitted constant against its independent measurement."""
    known = shown(flag.independent.low, flag.unit)
    if flag.independent.high > flag.independent.low:
        known += f" to {shown(flag.independent.high, flag.unit)}"
    fitted = interval(*flag.fitted, flag.unit)
    return f"{when}: {flag.name} = {fitted} {flag.says.value} {known} ({flag.independent.source})"


def parameter_line(one: Fitted) -> str:
    """Return one fitted parameter with its 95 % interval."""
    said = f"{one.name} = {interval(one.value, one.low, one.high, one.unit)}"
    if one.prior:
        said += f", assumed beforehand {one.prior}"
    return said + (", AT ITS BOUND" if one.at_bound else "" if one.closed else ", not closed by the data")
