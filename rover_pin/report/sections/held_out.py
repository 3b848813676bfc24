"""Errors on what was not fitted: by channel, and by what was left out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.discrepancy.held_out import LOSES, ChannelScore
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import Outcome, figure, got_worse, shown
from rover_pin.report.figures import heldout_panels
from rover_pin.report.headline import FEW, by_outcome, worst
from rover_pin.report.section import AWAY, Picture, Row, Section, Table
from rover_pin.report.words import Manner

CAPTION = "What a user would otherwise take, on the same data left out; marked where it is better than the model"


@dataclass(frozen=True, eq=False)
class HeldOut(Section):
    """Held-out errors before and after, with what may be claimed of each."""

    verdict: Verdict
    manner: Manner
    title: ClassVar[str] = "Error on data that were not fitted"
    template: ClassVar[str] = "sections/held_out.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return the tables; None where nothing could be fitted."""
        scores, added = self.verdict.scores, bool(self.verdict.named)
        if not scores:
            return None
        return {
            "folds": self.manner.folds,
            "added": added,
            "resampled": scores[0].worded.of,
            "channels": channel_table(scores, added, self.manner),
            "parts": self._parts(scores, added),
            "baselines": baseline_table(self.verdict, self.manner),
            "worse": got_worse((self.manner.channel(one.name), one.worded) for one in scores) if added else "",
        }

    def pictures(self) -> Mapping[str, Picture]:
        """Return the errors of many channels at a glance."""
        scores = self.verdict.scores
        if len(scores) <= FEW:
            return {}
        better, worse = (by_outcome(scores, one) for one in (Outcome.BETTER, Outcome.WORSE))
        said = f"{len(better)} of {len(scores)} channels are predicted better and {len(worse)} worse" * bool(
            self.verdict.named
        )
        alt = f"Held-out error of each channel over its noise; {said or 'nothing was added'}."
        return {"heldout": Picture(heldout_panels(scores, bool(self.verdict.named), self.manner), alt)}

    def _parts(self, scores: Sequence[ChannelScore], added: bool) -> Table:
        """Return the errors by what was left out: of every channel where there are few, else of all together."""
        if len(scores) > FEW or not all(one.levels for one in scores):
            return self._together(added)
        fold, channel = self.manner.fold, self.manner.channel
        heads = ("left out", *(channel(one.name) + ", before to after" * added for one in scores))
        pairs = zip(*([_level(each, one, added) for each in one.levels] for one in scores), strict=True)
        names = [each.level for each in scores[0].levels]
        return Table(heads, tuple(Row((fold(name), *cells)) for name, cells in zip(names, pairs, strict=True)))

    def _together(self, added: bool) -> Table:
        rows = []
        for one in self.verdict.runs:
            cells = (self.manner.fold(one.run), f"{one.blocks}", figure(one.before, ".2f"))
            after = (figure(one.after, ".2f"), one.worded.text) if added else ()
            rows.append(Row((*cells, *after), AWAY * (added and one.low > 0)))
        heads = ("left out", "blocks", *(("before", "after", "change, 95 %") if added else ("misfit",)))
        return Table(heads, tuple(rows), "All channels together: chi2 for each number measured; 1 is the noise.")


def baseline_table(verdict: Verdict, manner: Manner) -> Table | None:
    """Return the held-out errors of what a user would otherwise take, beside the model's; None where none was tried."""
    known = {one.name: one for one in verdict.scores}
    rows = [
        Row((manner.channel(one.channel), f"{one.curve} of {one.given}", shown(one.error, one.unit),
             shown(known[one.channel].after, one.unit)), AWAY * (one.error < LOSES * known[one.channel].after))
        for one in verdict.baselines if one.channel in known
    ]  # fmt: skip
    return Table(("channel", "otherwise", "its error", "the model's"), tuple(rows), CAPTION) if rows else None


def _level(each: Any, score: ChannelScore, added: bool) -> str:
    if math.isnan(each.before) and each.level not in score.lost:
        return "-"
    before = shown(each.before, score.unit)
    return f"{before} to {shown(each.after, score.unit)}" if added else before


def channel_table(scores: Sequence[ChannelScore], added: bool, manner: Manner) -> Table:
    """Return held-out errors by channel, the farthest from its noise first."""
    heads = ("channel", "before", "after", "change, 95 %", "noise", "times the noise", "what may be said")
    rows = []
    for one in worst(scores):
        name, floor, times = manner.channel(one.name), shown(one.floor, one.unit), one.times(one.before)
        if added:
            cells = (name, shown(one.before, one.unit), shown(one.after, one.unit), one.worded.text, floor,
                     f"{figure(times, '.1f')} to {figure(one.times(one.after), '.1f')}", one.said)  # fmt: skip
            rows.append(Row(cells, AWAY * (one.worded.outcome is Outcome.WORSE)))
        else:
            rows.append(Row((name, shown(one.before, one.unit), floor, figure(times, ".1f"))))
    return Table(heads if added else ("channel", "held-out error", "noise", "times the noise"), tuple(rows))
