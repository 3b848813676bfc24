"""Which candidates were tried, what each gains, and which of them cannot be told from the best."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.discrepancy.refit import Refit
from rover_pin.discrepancy.search import Round, Search
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.numbers import numbers
from rover_pin.estimation.wording import figure, interval, shown
from rover_pin.report.figures import candidates_figure
from rover_pin.report.section import CHOSEN, Picture, Row, Section, Table
from rover_pin.report.words import Manner, full, kinds_of, listing

MOST = 12
"""Refits that a table lists."""


@dataclass(frozen=True, eq=False)
class WhichEffect(Section):
    """The candidates of every round."""

    verdict: Verdict
    manner: Manner
    title: ClassVar[str] = "Which effect"
    template: ClassVar[str] = "sections/which_effect.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return a table for each round; None where none was scored."""
        found = self.verdict.search
        if found is None or not any(each.scored for each in found.rounds):
            return None
        return {
            "count": found.count,
            "folds": self.manner.folds,
            "tables": [self._table(found, at, each) for at, each in enumerate(found.rounds) if each.refits],
            "places": any(mark in row.candidate.name for row in found.rounds[0].scored for mark in "[@"),
            "again": " ".join(filter(None, (self._again(), self._others()))),
        }

    def pictures(self) -> Mapping[str, Picture]:
        """Return gains against what chance gives."""
        found = self.verdict.search
        assert found is not None
        kinds = kinds_of(self.verdict)
        best = [f"{full(one.name, kinds)} gains {one.gain:.3g}" for one in found.found]
        alt = f"Gain of the leading candidates in chi2: {listing(best) or 'none gains more than chance'}."
        return {"candidates": Picture((candidates_figure(found, kinds),), alt)}

    def _table(self, found: Search, at: int, each: Round) -> Table:
        kinds = kinds_of(self.verdict)
        base = listing(full(one.name, kinds) for one in found.before(at)) or "the base model"
        held = f"gain on {self.manner.folds} left out"
        heads = ("candidate", "gain in chi2", "must gain", "net", held, "its numbers", "judged")
        rows = [
            Row((full(one.name, kinds), *_gains(one), own_text(one), judged(one)), CHOSEN * (one in each.alike))
            for one in each.refits[:MOST]
        ]
        return Table(heads, tuple(rows), f"Refitted, added to {base}")

    def _again(self) -> str:
        chosen = self.verdict.chosen
        if not chosen:
            return ""
        kinds = kinds_of(self.verdict)
        said = [f"without {self.manner.fold(fold)} {full(name, kinds) or 'nothing'}" for fold, name in chosen.items()]
        if len(chosen) > 1 and len(set(chosen.values())) == 1:
            said = [f"{full(next(iter(chosen.values())), kinds) or 'nothing'}, whichever of the {len(chosen)}"]
        anew = f"Chosen anew with one of the {self.manner.folds} left out of the choice, too: {'; '.join(said)}."
        errors = self._errors(self.verdict.errors_anew)
        return f"{anew} The error on each with what was chosen without it: {errors}." if errors else anew

    def _others(self) -> str:
        kinds = kinds_of(self.verdict)
        said = [f"with {full(name, kinds)} {self._errors(errors)}" for name, errors in self.verdict.others.items()]
        return f"Errors on the {self.manner.folds} left out, in place of the first: {'; '.join(said)}." if said else ""

    def _errors(self, errors: dict[str, float]) -> str:
        units = {one.name: one.unit for one in self.verdict.scores}
        return listing(
            [f"{self.manner.channel(name)} {shown(errors[name], units[name])}" for name in errors if name in units]
        )


def _gains(one: Refit) -> tuple[str, ...]:
    held = figure(one.held_out, "+.1f") if one.held_out else ""
    return (f"{one.gain:.1f}", f"{one.fee:.1f}", f"{one.net:+.1f}", held)


def judged(one: Refit) -> str:
    """Return what became of a refit."""
    if one.gain < 0:
        return "its refit did not settle"
    if one.net <= 0:
        return "gains no more than chance"
    if one.loses:
        return "not compared: it loses a fold left out"
    return "accepted" if one.accepted else "no better where it was not fitted"


def own_text(one: Refit) -> str:
    """Return the candidate's own numbers in words; of an exact fit without intervals, whose profiles take long."""
    own = one.candidate.names
    if one.fit.task.experiment.is_exact:
        free = [each.name for each in one.fit.parameters if each.name in own]
        quantity = one.fit.task.experiment.quantity
        said = [(name, shown(one.fit.value(name), quantity(one.fit.model, name).unit)) for name in free]
    else:
        rows = [each for each in numbers(one.fit) if each.name in own]
        said = [(each.name, interval(each.value, each.low, each.high, each.unit)) for each in rows]
    return "; ".join(f"{name.rpartition('.')[2]} = {words}" for name, words in said)
