"""Which candidates were tried, what each gains, and which of them cannot be distinguished from the best."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.discrepancy.refit import Refit
from rover_pin.discrepancy.search import Round, Search
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.numbers import numbers
from rover_pin.estimation.wording import figure, format_value, interval
from rover_pin.report.figures import candidates_figure
from rover_pin.report.section import CHOSEN, Picture, Row, Section, Table
from rover_pin.report.words import Labels, full, kinds_of, listing

MAX_REFITS = 12
"""Refits that a table lists."""


@dataclass(frozen=True, eq=False)
class WhichEffect(Section):
    """The candidates of every round."""

    verdict: Verdict
    labels: Labels
    title: ClassVar[str] = "Which effect"
    template: ClassVar[str] = "sections/which_effect.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return a table for each round; None where none was scored."""
        search = self.verdict.search
        if search is None or not any(search_round.scored for search_round in search.rounds):
            return None
        return {
            "count": search.count,
            "folds": self.labels.folds,
            "tables": [
                self._table(search, at, search_round)
                for at, search_round in enumerate(search.rounds)
                if search_round.refits
            ],
            "places": any(mark in row.candidate.name for row in search.rounds[0].scored for mark in "[@"),
            "again": " ".join(filter(None, (self._again(), self._others()))),
        }

    def pictures(self) -> Mapping[str, Picture]:
        """Return gains against what chance gives."""
        search = self.verdict.search
        assert search is not None
        kinds = kinds_of(self.verdict)
        best = [f"{full(refit.name, kinds)} gains {refit.gain:.3g}" for refit in search.best_refits]
        alt = f"Gain of the leading candidates in chi2: {listing(best) or 'none gains more than chance'}."
        return {"candidates": Picture((candidates_figure(search, kinds),), alt)}

    def _table(self, search: Search, at: int, search_round: Round) -> Table:
        kinds = kinds_of(self.verdict)
        base = listing(full(refit.name, kinds) for refit in search.before(at)) or "the base model"
        held_out_head = f"gain on {self.labels.folds} left out"
        heads = ("candidate", "gain in chi2", "must gain", "net", held_out_head, "its numbers", "judged")
        rows = [
            Row(
                (full(refit.name, kinds), *_gains(refit), own_text(refit), describe_outcome(refit)),
                CHOSEN * (refit in search_round.indistinguishable),
            )
            for refit in search_round.refits[:MAX_REFITS]
        ]
        return Table(heads, tuple(rows), f"Refitted, added to {base}")

    def _again(self) -> str:
        chosen = self.verdict.chosen
        if not chosen:
            return ""
        kinds = kinds_of(self.verdict)
        choices = [
            f"without {self.labels.fold(fold)} {full(name, kinds) or 'nothing'}" for fold, name in chosen.items()
        ]
        if len(chosen) > 1 and len(set(chosen.values())) == 1:
            choices = [f"{full(next(iter(chosen.values())), kinds) or 'nothing'}, whichever of the {len(chosen)}"]
        anew = f"Chosen anew with one of the {self.labels.folds} left out of the choice, too: {'; '.join(choices)}."
        errors = self._errors(self.verdict.errors_anew)
        return f"{anew} The error on each with what was chosen without it: {errors}." if errors else anew

    def _others(self) -> str:
        kinds = kinds_of(self.verdict)
        clauses = [f"with {full(name, kinds)} {self._errors(errors)}" for name, errors in self.verdict.others.items()]
        return (
            f"Errors on the {self.labels.folds} left out, in place of the first: {'; '.join(clauses)}."
            if clauses
            else ""
        )

    def _errors(self, errors: dict[str, float]) -> str:
        units = {score.name: score.unit for score in self.verdict.scores}
        return listing(
            [
                f"{self.labels.channel(name)} {format_value(errors[name], units[name])}"
                for name in errors
                if name in units
            ]
        )


def _gains(refit: Refit) -> tuple[str, ...]:
    held_out_gain = figure(refit.held_out, "+.1f") if refit.held_out else ""
    return (f"{refit.gain:.1f}", f"{refit.threshold:.1f}", f"{refit.net:+.1f}", held_out_gain)


def describe_outcome(refit: Refit) -> str:
    """Return what became of a refit."""
    if refit.gain < 0:
        return "its refit did not settle"
    if refit.net <= 0:
        return "gains no more than chance"
    if refit.loses:
        return "not compared: it loses a fold left out"
    return "accepted" if refit.accepted else "no better where it was not fitted"


def own_text(refit: Refit) -> str:
    """Return the candidate's own numbers in words."""
    rows = [number for number in numbers(refit.fit) if number.name in refit.candidate.names]
    texts = [(number.name, interval(number.value, number.low, number.high, number.unit)) for number in rows]
    return "; ".join(f"{name.rpartition('.')[2]} = {words}" for name, words in texts)
