"""What a drive model leaves: how it acts, and what the residuals go with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from rover_pin.discrepancy.verdict import Verdict
from rover_pin.experiments.drive_log.extra import extra_of
from rover_pin.experiments.unlisted.remainder import Remainder
from rover_pin.experiments.unlisted.term import Term
from rover_pin.report.drive.runs import words_of
from rover_pin.report.drive.terms import term_panels
from rover_pin.report.section import AWAY, Picture, Row, Section, Table

TERMS = 3
"""Terms whose curves are drawn."""
LEFT = 12
"""Channels whose remainder is listed."""


@dataclass(frozen=True, eq=False)
class LeftOver(Section):
    """What is left: the terms that describe it best, and the channels with what they go with."""

    verdict: Verdict
    title: ClassVar[str] = "What is left"
    template: ClassVar[str] = "drive/left.html"

    def content(self) -> Mapping[str, Any] | None:
        """Return sentences and tables; None where nothing was fitted."""
        left = extra_of(self.verdict).remainder
        if left is None:
            return None
        terms = tuple(Row((f"it {one.said}", *_gains(one))) for one in left.terms[:TERMS])
        heads = ("what is left", "gain in chi2", "chance", "on runs left out", "net gain")
        return {
            "left": left.said,
            "terms": Table(heads, terms) if not left.is_noise else None,
            "channels": channel_table(left),
            "draft": self.verdict.draft,
        }

    def pictures(self) -> Mapping[str, Picture]:
        """Return the estimated functions, where more than noise is left."""
        left = extra_of(self.verdict).remainder
        if left is None or left.is_noise or not left.terms:
            return {}
        alt = f"Estimated functions of the terms that describe what is left best: it {left.best.said}."
        caption = (
            "What acts, times a function of what it depends on, as estimated from measured - model; shaded: one SD. "
            "Net gain: what it takes beyond chance, no more than on runs on which it was not fitted."
        )
        return {"terms": Picture(term_panels(left.terms[:TERMS]), alt, caption)}


def _gains(one: Term) -> tuple[str, ...]:
    held = "" if one.held_out is None else f"{one.held_out:+.1f}"
    return (f"{one.gain:.1f}", f"{one.fee:.1f}", held, f"{one.strength:+.1f}")


def channel_table(left: Remainder) -> Table:
    """Return what the channels leave, the most first, with what it goes with."""
    ranked = sorted(left.channels, key=lambda one: -one.rms)[:LEFT]
    signals = tuple(left.channels[0].correlations) if left.channels else ()
    rows = [
        Row(
            (
                words_of(one.name),
                f"{one.rms:.2f}",
                f"{one.memory:+.2f}",
                *(f"{value:+.2f}" for value in one.correlations.values()),
                "noise" if one.is_noise else f"{one.worst_run}, {one.worst_time:.1f} s, x = {one.worst_place:.2f} m",
            ),
            "" if one.is_noise else AWAY,
        )
        for one in ranked
    ]
    heads = ("channel", "times the noise", "one block with the next", *signals, "most of it")
    return Table(heads, tuple(rows), "What measured - model goes with")
