"""Pictures that the report of any data has: gains of the candidates, and errors of many channels."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.discrepancy.refit import Refit
from rover_pin.discrepancy.screen import Scored
from rover_pin.discrepancy.search import Round, Search, threshold_after
from rover_pin.effects.names import display_name
from rover_pin.estimation.wording import Outcome
from rover_pin.report.svg import AFTER, BEFORE, GREY
from rover_pin.report.words import Labels, as_text, listing

FIRST, LATER = 14, 6
"""Candidates that are drawn of the first look, and of each later one."""
LEAST_GAIN = 0.1
"""Gain in chi2 at which the axis begins."""
BEATEN, REFUSED = "#8fb4c2", "#b9bdbf"
"""Colours of what was accepted and beaten, and of what was not accepted."""


class Bar(NamedTuple):
    """A candidate of a look: what it gains, what it must, and its refit, if it was refitted."""

    name: str
    gain: float
    detection_threshold: float
    refit: Refit | None


def candidates_figure(search: Search, kinds: Iterable[type]) -> Figure:
    """Return the gain of the leading candidates of every look against what chance gives the best of them."""
    rows = [_bars(search, number) for number in range(len(search.rounds))]
    heights = [len(round_bars) + 1.2 for round_bars in rows]
    figure = Figure(figsize=(6.2, 0.3 * sum(heights) + 1.5), layout="constrained")
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
    for number, (axis, look, bars) in enumerate(zip(axes, search.rounds, rows, strict=True)):
        _candidates(axis, look, bars[::-1])
        names = [as_text(display_name(bar.name, kinds)) for bar in bars[::-1]]
        axis.set_yticks(range(len(names)), names, fontsize=8.5)
        base = listing(display_name(refit.name, kinds) for refit in search.before(number)) or "the base model"
        axis.set_title(f"added to {as_text(base)}", fontsize=9.5, loc="left")
    axes[-1].set_xlabel("gain in chi2")
    axes[-1].set_xlim(left=LEAST_GAIN)  # only now: a limit ends the growth with what is drawn, in all of them
    figure.legend(handles=_signs(), loc="outside upper left", ncols=2, frameon=False, fontsize=8.5)
    return figure


def _bars(search: Search, number: int) -> list[Bar]:
    """Return the leading candidates of a look and all refitted ones, by refitted or else promised gain."""
    look, most = search.rounds[number], LATER if number else FIRST
    must_gain = threshold_after(search.rounds[:number], search.count, search.base.task.noise.inflation)
    refits = {refit.name: refit for refit in look.refits}
    rows = [row for row in _leaders(look.scored, refits, most) if row.candidate.name not in refits]
    bars = [Bar(row.candidate.name, row.gain, must_gain(row.candidate), None) for row in rows]
    bars += [Bar(refit.name, refit.gain, refit.threshold, refit) for refit in look.refits]
    return sorted(bars, key=lambda bar: -bar.gain)


def _leaders(scored: Sequence[Scored], refitted: Container[str], most: int) -> list[Scored]:
    """Return the leading candidates; of an effect sought all over the ground its best place, or what was refitted."""
    leaders: list[Scored] = []
    places = set()
    for row in scored:
        name, kind = row.candidate.name, row.candidate.kind
        if name not in refitted and (
            not row.is_identifiable or ("@" in name and kind in places) or len(leaders) >= most
        ):
            continue
        places.add(kind)
        leaders.append(row)
    return leaders


def _candidates(axis: Axes, look: Round, bars: Sequence[Bar]) -> None:
    for place, (_, gain, threshold, refit) in enumerate(bars):
        colour = (
            AFTER if refit in look.indistinguishable else BEATEN if refit is not None and refit.accepted else REFUSED
        )
        if gain > LEAST_GAIN:
            axis.barh(place, gain - LEAST_GAIN, left=LEAST_GAIN, color=colour, height=0.7)
        if refit is not None:
            axis.plot(max(gain, LEAST_GAIN), place, "D", color="k", ms=4, clip_on=False)
        axis.plot([threshold, threshold], [place - 0.45, place + 0.45], color=BEFORE, lw=1.8)
    axis.set_ylim(-0.7, len(bars) - 0.3)
    axis.set_xscale("log")
    axis.grid(alpha=0.25, axis="x")


def _signs() -> list[Line2D]:
    return [
        Line2D([], [], color=AFTER, lw=7, label="accepted: the best, or not distinguished from it"),
        Line2D([], [], color=BEATEN, lw=7, label="accepted, but beaten"),
        Line2D([], [], color=REFUSED, lw=7, label="not accepted, or promised only"),
        Line2D([], [], color="k", marker="D", ms=4, ls="", label="refitted"),
        Line2D([], [], color=BEFORE, lw=1.8, label="what it must gain"),
    ]


def heldout_panels(scores: Sequence[ChannelScore], added: bool, labels: Labels) -> tuple[Figure, ...]:
    """Return each channel's held-out error in times its noise, and the change of each with the 95 % interval."""
    ranked = sorted(scores, key=lambda score: score.times(score.before))
    panels = [_panel(ranked, labels) for _ in range(2 if added else 1)]
    _errors(panels[0].axes[0], ranked, added)
    if added:
        _changes(panels[1].axes[0], ranked)
    for figure in panels:
        handles = figure.axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper center", ncols=2, frameon=False, fontsize=8.5)
    return tuple(panels)


def _panel(ranked: Sequence[ChannelScore], labels: Labels) -> Figure:
    figure = Figure(figsize=(4.9, 0.24 * len(ranked) + 1.3), layout="constrained")
    axis = figure.subplots()
    axis.set_yticks(range(len(ranked)), [as_text(labels.channel(score.name)) for score in ranked], fontsize=8.5)
    axis.grid(alpha=0.25)
    return figure


def _errors(axis: Axes, ranked: Sequence[ChannelScore], added: bool) -> None:
    places = np.arange(len(ranked))
    before, after = np.array([(score.times(score.before), score.times(score.after)) for score in ranked]).T
    axis.axvline(1, color="k", lw=0.8)
    axis.plot(before, places, "o", color=BEFORE, ms=5, label="base model")
    if added:
        changed = np.array([score.worded.outcome in (Outcome.BETTER, Outcome.WORSE) for score in ranked], dtype=bool)
        axis.hlines(places[changed], before[changed], after[changed], color=GREY, lw=1, zorder=1)
        axis.plot(after[changed], places[changed], "s", color=AFTER, ms=5, label="with what was added")
        axis.plot(after[~changed], places[~changed], "s", color=AFTER, mfc="none", ms=5, label="no change to claim")
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlabel("held-out RMSE / noise")


def _changes(axis: Axes, ranked: Sequence[ChannelScore]) -> None:
    labels = {Outcome.BETTER: "better", Outcome.WORSE: "worse"}
    colours = {Outcome.BETTER: AFTER, Outcome.WORSE: BEFORE}
    labelled = set()
    for place, score in enumerate(ranked):
        outcome = score.worded.outcome
        colour, label = colours.get(outcome, GREY), labels.get(outcome, "no change to claim")
        axis.plot([100 * score.low, 100 * score.high], [place, place], color=colour, lw=2)
        axis.plot(100 * score.change, place, "o", color=colour, ms=4, label=None if label in labelled else label)
        labelled.add(label)
    axis.axvline(0, color="k", lw=0.8)
    axis.set_xlabel("change of the RMSE [%], 95 % interval")
