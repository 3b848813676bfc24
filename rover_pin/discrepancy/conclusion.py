"""What the loop concludes of an experiment: a graded answer, the evidence for it, and what speaks against it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rover_pin.discrepancy.answer import Answer, plain, score_line
from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.discrepancy.search import Search
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.profile import NORMAL_95
from rover_pin.estimation.wording import interval

SCHEMA = 1
"""Version of the plain values of a conclusion, as docs/verdict.md describes them."""
DRIFTED = 3.0
"""Prior SDs from which a number is said to sit away from what was declared of it."""


class Number(NamedTuple):
    """One fitted number of a model with its 95 % interval [SI]."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    drift: float
    "distance from what was declared, in its SDs; NaN where nothing was"

    @property
    def said(self) -> str:
        """One line for a reader."""
        line = f"{self.name} = {interval(self.value, self.low, self.high, self.unit)}"
        return line if not abs(self.drift) > DRIFTED else f"{line}, {self.drift:+.1f} SD from what was declared"


def numbers(fitted: Fit) -> tuple[Number, ...]:
    """Return all free numbers with intervals of `Fit.spread` about the optimum."""
    found = []
    for one, u, sd in zip(fitted.parameters, fitted.u, fitted.spread, strict=True):
        ends = sorted(one.value(u + side * NORMAL_95 * sd) for side in (-1, 1))
        unit = fitted.task.experiment.quantity(fitted.model, one.name).unit
        found.append(Number(one.name, unit, one.value(u), ends[0], ends[1], float(u) if one.prior else float("nan")))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Conclusion:
    """The result of the loop on a test bed. `model` carries the fitted numbers and what was added."""

    answer: Answer
    name: str
    sentence: str
    model: Any = field(repr=False)
    named: tuple[str, ...] = ()
    "what was added to the base model"
    alike: tuple[str, ...] = ()
    "the candidates that cannot be distinguished from the first of them"
    share: float = 0.0
    "of the held-out chi2 beyond the noise, what was added takes so much"
    before: Fit | None = field(default=None, repr=False)
    after: Fit | None = field(default=None, repr=False)
    scores: tuple[ChannelScore, ...] = field(default=(), repr=False)
    chosen: dict[str, str] = field(default_factory=dict)
    "what is chosen when each fold is left out of the choice as well"
    vetoes: tuple[str, ...] = ()
    "what keeps the name from standing alone"
    search: Search | None = field(default=None, repr=False)
    provenance: dict[str, Any] = field(default_factory=dict, repr=False)

    def summary(self) -> str:
        """Return the conclusion in a page of text; angles in degrees."""
        lines = [f"{self.name}: {self.answer.value}", f"  {self.sentence}"]
        if self.before is not None and self.after is not None:
            lines += [f"  reduced chi-square: {self.before.misfit:.3g} -> {self.after.misfit:.3g}; 1 is the noise"]
        lines += [f"  {score_line(score)}" for score in self.scores]
        lines += [f"  without {fold}: {name or 'nothing'} chosen" for fold, name in self.chosen.items()]
        lines += [f"  against the name: {veto}" for veto in self.vetoes]
        lines += [f"  {one.said}" for one in (numbers(self.after) if self.after is not None else ())]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return the conclusion as plain values for JSON; SI units, NaN and infinities as None."""
        rows = self.search.rounds if self.search else ()
        sides = {"before": self.before, "after": self.after}
        return plain(
            {
                "kind": "verdict",
                "schema": SCHEMA,
                "name": self.name,
                "answer": self.answer.value,
                "sentence": self.sentence,
                "effects": list(self.named),
                "alike": list(self.alike),
                "share": self.share,
                "reduced_chi_square": {side: fit.misfit for side, fit in sides.items() if fit is not None},
                "held_out": [score._asdict() | {"said": score.said} for score in self.scores],
                "folds": self.chosen,
                "vetoes": list(self.vetoes),
                **{side: _values(fit) for side, fit in sides.items()},
                "rounds": [[_refit(one) for one in each.refits] for each in rows],
                **self.provenance,
            }
        )


def _values(fit: Fit | None) -> dict[str, Any]:
    return {} if fit is None else {one.name: one._asdict() for one in numbers(fit)}


def _refit(one: Any) -> dict[str, Any]:
    return {"name": one.name, "gain": one.gain, "threshold": one.fee, "held_out_gain": one.held_out}
