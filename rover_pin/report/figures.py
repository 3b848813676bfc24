"""Pictures that the report of any data has: gains of the candidates, and errors of many channels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.estimation.wording import Outcome
from rover_pin.report.svg import AFTER, BEFORE, GREY
from rover_pin.report.words import Labels, as_text


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
