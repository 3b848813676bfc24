"""The picture of the errors of many channels, which the report of any data has."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from rover_pin.discrepancy.held_out import ChannelScore
from rover_pin.estimation.wording import Outcome
from rover_pin.report.svg import AFTER, BEFORE, GREY
from rover_pin.report.words import Labels, as_text


def heldout_panel(scores: Sequence[ChannelScore], added: bool, labels: Labels) -> Figure:
    """Return each channel's held-out error in times its noise, before and after."""
    ranked = sorted(scores, key=lambda score: score.times(score.before))
    places = np.arange(len(ranked))
    before, after = np.array([(score.times(score.before), score.times(score.after)) for score in ranked]).T
    figure = Figure(figsize=(7.2, 0.24 * len(ranked) + 1.3), layout="constrained")
    axis = figure.subplots()
    axis.axvline(1, color="k", lw=0.8)
    axis.plot(before, places, "o", color=BEFORE, ms=5, label="base model")
    if added:
        changed = np.array([score.worded.outcome in (Outcome.BETTER, Outcome.WORSE) for score in ranked], dtype=bool)
        axis.hlines(places[changed], before[changed], after[changed], color=GREY, lw=1, zorder=1)
        axis.plot(after[changed], places[changed], "s", color=AFTER, ms=5, label="with what was added")
        axis.plot(after[~changed], places[~changed], "s", color=AFTER, mfc="none", ms=5, label="no change to claim")
    axis.set_yticks(places, [as_text(labels.channel(score.name)) for score in ranked], fontsize=8.5)
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlabel("held-out RMSE / noise")
    axis.grid(alpha=0.25)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=8.5)
    return figure
