"""What the data could not tell, and from what size they would have: so that 'nothing found' has a number."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from rover_pin.discrepancy.candidate import FAR_FROM
from rover_pin.discrepancy.screen import STILL, Scored, fee_of
from rover_pin.discrepancy.search import Search
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.fit import Fit
from rover_pin.estimation.wording import shown
from rover_pin.quantity import Quantity, quantities
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
    told: bool
    why: str
    "why not"
    threshold: bool
    "whether it acts from a size on, so that a share of it means nothing"

    @property
    def usual(self) -> str:
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
        found = sensitivities(self.verdict.search) if self.verdict.search else ()
        if not found:
            return None
        kinds = kinds_of(self.verdict)

        def name(one: Sensitivity) -> str:
            return full(one.name, kinds) + (f", {one.places} places" if one.places > 1 else "")

        held = _accepted(self.verdict.search)
        untold = [Row((name(one), one.why, one.size)) for one in found if not one.told and one.name not in held]
        told = [Row((name(one), one.size, one.usual)) for one in found if one.told]
        return {
            "untold": Table(("candidate", "why not", "would show from about"), tuple(untold)),
            "told": Table(("candidate", "would show from about", "of its usual size"), tuple(told)),
        }


def _accepted(search: Search | None) -> set[str]:
    """Return the kinds that a refit told after all: a linear estimate at the usual size may deny a greater one."""
    rounds = search.rounds if search else ()
    return {one.candidate.kind for each in rounds for one in each.refits if one.accepted}


def sensitivities(search: Search) -> tuple[Sensitivity, ...]:
    """Return what the data say of every kind of candidate, what they tell least last."""
    kinds: dict[str, list[Scored]] = {}
    for row in search.rounds[0].scored if search.rounds else ():
        kinds.setdefault(row.candidate.kind, []).append(row)
    found = [_of_kind(kind, rows, search) for kind, rows in kinds.items()]
    return tuple(sorted(found, key=lambda one: one.share))


def _of_kind(kind: str, rows: Sequence[Scored], search: Search) -> Sensitivity:
    fee = {row.candidate.name: fee_of(row.candidate, search.count) for row in rows}
    best = min(rows, key=lambda row: (row.absorbed > IMITATED, row.smallest(fee[row.candidate.name])))
    share = best.smallest(fee[best.candidate.name])
    why = _why(best, share)
    far = any(_far(best, name) for name in best.signature.sizes)
    return Sensitivity(kind, len(rows), share, _size(best, share, search.base), not why, why, far)


def _far(row: Scored, name: str) -> bool:
    """Return whether a size vanishes so far off that there is no straight way to it."""
    return abs(row.signature.neutral[name]) > FAR_FROM * abs(row.signature.sizes[name])


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
    sizes = []
    for name, size in row.signature.sizes.items():
        neutral, about = row.signature.neutral[name], _about(row, name, base)
        own = name.rpartition(".")[2]
        if size == neutral:
            continue
        if _far(row, name):
            sizes.append(f"{own} near {shown(size, about.unit)}")
        elif row.candidate.effect is None:
            sizes.append(f"{own} off by {shown(share * abs(size - neutral), about.unit)}")
        else:
            sizes.append(_bounded(own, neutral + share * (size - neutral), about))
    return " and ".join(sizes)


def _bounded(own: str, value: float, about: Quantity) -> str:
    within = about.low <= value <= about.high
    return f"{own} = {shown(value, about.unit)}" + ("" if within else ", beyond its bounds")


def _about(row: Scored, name: str, base: Fit) -> Quantity:
    if row.candidate.effect is None:
        return base.task.experiment.quantity(base.model, name)
    return quantities(row.candidate.effect)[name.rpartition(".")[2]]
