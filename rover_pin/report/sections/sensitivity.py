"""What the data could not tell, and from what size they would have: so that 'nothing found' has a number."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from rover_pin.base.quantity import Quantity, quantities
from rover_pin.discrepancy.candidate import FAR_FROM
from rover_pin.discrepancy.screen import STILL, Scored, candidate_threshold
from rover_pin.discrepancy.search import Search
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.wording import format_value
from rover_pin.report.section import Row, Section, Table
from rover_pin.report.words import full, kinds_of

IMITATED = 0.98
"""Share of a signature's sum of squares from which it counts as one that the uncertain numbers imitate."""


class Sensitivity(NamedTuple):
    """What data say of one kind of candidate, at the wheel, channel or place where it would show best."""

    name: str
    places: int
    "wheels, channels or places at which it was tried"
    share: float
    "of its usual size that would show, by linear estimate"
    size: str
    "the same in numbers"
    detectable: bool
    why: str
    "why not"
    threshold: bool
    "whether it acts from a size on, so that a share of it means nothing"

    @property
    def share_text(self) -> str:
        """The share in words."""
        return "" if self.threshold else f"{self.share:.2g}"


@dataclass(frozen=True, eq=False)
class Untold(Section):
    """What could not be told, and from what size the rest would show."""

    verdict: Verdict
    title: ClassVar[str] = "What could not be told"
    template: ClassVar[str] = "sections/sensitivity.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return the two tables; None where nothing was scored."""
        results = sensitivities(self.verdict.search) if self.verdict.search else ()
        if not results:
            return None
        kinds = kinds_of(self.verdict)

        def name(result: Sensitivity) -> str:
            return full(result.name, kinds) + (f", {result.places} places" if result.places > 1 else "")

        accepted_kinds = _accepted(self.verdict.search)
        undetectable = [
            Row((name(result), result.why, result.size))
            for result in results
            if not result.detectable and result.name not in accepted_kinds
        ]
        detectable = [Row((name(result), result.size, result.share_text)) for result in results if result.detectable]
        return {
            "untold": Table(("candidate", "why not", "would show from about"), tuple(undetectable)),
            "told": Table(("candidate", "would show from about", "of its usual size"), tuple(detectable)),
        }


def _accepted(search: Search | None) -> set[str]:
    """Return the kinds that a refit identified: a linear estimate at the usual size may deny a greater one."""
    rounds = search.rounds if search else ()
    return {refit.candidate.kind for search_round in rounds for refit in search_round.refits if refit.accepted}


def sensitivities(search: Search) -> tuple[Sensitivity, ...]:
    """Return what the data say of every kind of candidate, what they tell least last."""
    kinds: dict[str, list[Scored]] = {}
    for row in search.rounds[0].scored if search.rounds else ():
        kinds.setdefault(row.candidate.kind, []).append(row)
    results = [_of_kind(kind, rows, search) for kind, rows in kinds.items()]
    return tuple(sorted(results, key=lambda result: result.share))


def _of_kind(kind: str, rows: Sequence[Scored], search: Search) -> Sensitivity:
    gain_thresholds = {row.candidate.name: candidate_threshold(row.candidate, search.count) for row in rows}
    best = min(rows, key=lambda row: (row.absorbed > IMITATED, row.smallest(gain_thresholds[row.candidate.name])))
    share = best.smallest(gain_thresholds[best.candidate.name])
    why = _why(best, share)
    is_threshold = any(_far(best, name) for name in best.signature.amplitudes)
    return Sensitivity(kind, len(rows), share, _size(best, share, search.base), not why, why, is_threshold)


def _far(row: Scored, name: str) -> bool:
    """Return whether a size vanishes so far off that there is no straight way to it."""
    return abs(row.signature.neutral[name]) > FAR_FROM * abs(row.signature.amplitudes[name])


def _why(row: Scored, share: float) -> str:
    """Return why the log cannot tell a candidate, or an empty string."""
    if math.isnan(row.gain):
        return "with it, however small, the model does not predict all that was measured"
    if row.visible <= STILL:
        return "moves nothing that was measured here"
    if row.absorbed > IMITATED:
        return f"the uncertain numbers imitate {row.absorbed:.1%} of what it does"
    return f"would show from {share:.1f} times its usual size only" if share > 1 else ""


def _size(row: Scored, share: float, base: Fit) -> str:
    """Return the size from which a candidate would show: a share of the way from neutral to its signature's size.

    None where its whole way moves nothing: a share of that is no estimate.
    """
    if not math.isfinite(share) or row.visible <= STILL:
        return "none"
    clauses = []
    for name, size in row.signature.amplitudes.items():
        neutral, quantity = row.signature.neutral[name], _about(row, name, base)
        parameter_name = name.rpartition(".")[2]
        if size == neutral:
            continue
        if _far(row, name):
            clauses.append(f"{parameter_name} near {format_value(size, quantity.unit)}")
        elif row.candidate.effect is None:
            clauses.append(f"{parameter_name} off by {format_value(share * abs(size - neutral), quantity.unit)}")
        else:
            clauses.append(_bounded(parameter_name, neutral + share * (size - neutral), quantity))
    return " and ".join(clauses)


def _bounded(parameter_name: str, value: float, quantity: Quantity) -> str:
    within = quantity.low <= value <= quantity.high
    return f"{parameter_name} = {format_value(value, quantity.unit)}" + ("" if within else ", beyond its bounds")


def _about(row: Scored, name: str, base: Fit) -> Quantity:
    if row.candidate.effect is None:
        return base.task.experiment.quantity(base.model, name)
    return quantities(row.candidate.effect)[name.rpartition(".")[2]]
