"""The section on the held-out errors: by channel, and by the part of the data that was held out of the fit."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from rover_pin.base.encode import figure_text
from rover_pin.discrepancy.held_out_errors import ChannelScore
from rover_pin.discrepancy.rivals import is_better
from rover_pin.discrepancy.verdict import Verdict
from rover_pin.estimation.wording import MAX_NAMED, Outcome, figure, format_value, got_worse
from rover_pin.report.cause_sets import by_outcome, worst
from rover_pin.report.page import AWAY, Picture, ReportTable, Section, TableRow
from rover_pin.report.svg import AFTER, BEFORE, GREY
from rover_pin.report.words import Labels

MIN_LOG_RANGE = 10.0
"""Smallest ratio of the ends of a logarithmic axis with ticks at 1, 2 and 5 of each decade. A longer axis has at least
three such ticks. A shorter axis could have only one or two of them, so that it gets evenly spaced round numbers."""


def held_out_section(verdict: Verdict, labels: Labels) -> Section | None:
    """Return the section with the held-out errors and the claims that they allow; None if there are no held-out errors.

    Each fold of the data (a run or a slip level) is predicted by a fit to all other folds. The errors belong to the
    base model and to the model with added effects.
    """
    scores, added = verdict.scores, bool(verdict.named)
    if not scores:
        return None
    content = {
        "folds": labels.folds,
        "added": added,
        "resampled": scores[0].worded.of,
        "channels": channel_table(scores, added, labels),
        "parts": parts_table(verdict, labels),
        "baselines": baseline_table(verdict, labels),
        "worse": got_worse((labels.channel(score.name), score.worded) for score in scores) if added else "",
    }
    # A few channels are clear from the table alone; many channels need a picture.
    pictures = {}
    if len(scores) > MAX_NAMED:
        better, worse = (len(by_outcome(scores, outcome)) for outcome in (Outcome.BETTER, Outcome.WORSE))
        summary = f"{better} of {len(scores)} channels are predicted better and {worse} worse"
        alt = f"Held-out error of each channel over its noise; {summary if added else 'nothing was added'}."
        pictures["heldout"] = Picture((heldout_panel(scores, added, labels),), alt)
    return Section("Held-out errors", "sections/held_out.html", content, pictures)


def parts_table(verdict: Verdict, labels: Labels) -> ReportTable:
    """Return the table of the errors in each held-out fold of the data, which is a run or a slip level.

    If there are few channels, the table has the error of each channel; otherwise it has chi2 of all channels together.
    """
    scores, added = verdict.scores, bool(verdict.named)
    if len(scores) > MAX_NAMED or not all(score.levels for score in scores):
        rows = []
        for run_score in verdict.runs:
            cells = (labels.fold(run_score.run), f"{run_score.blocks}", figure(run_score.before, ".2f"))
            after = (figure(run_score.after, ".2f"), run_score.worded.text) if added else ()
            # A row is marked if the whole interval of the change is above zero, so that the fold became worse.
            rows.append(TableRow((*cells, *after), AWAY * (added and run_score.low > 0)))
        heads = ("held out", "blocks", *(("before", "after", "change, 95 %") if added else ("chi2 per value",)))
        return ReportTable(heads, tuple(rows), "All channels together: chi2 per measured value, where 1 is the noise.")
    # One row for each held-out fold, and one column for each channel.
    channels = (labels.channel(score.name) + ", before to after" * added for score in scores)
    pairs = zip(*([_level(level, score, added) for level in score.levels] for score in scores), strict=True)
    names = [level.level for level in scores[0].levels]
    level_rows = tuple(TableRow((labels.fold(name), *cells)) for name, cells in zip(names, pairs, strict=True))
    return ReportTable(("held out", *channels), level_rows)


def baseline_table(verdict: Verdict, labels: Labels) -> ReportTable | None:
    """Return the table that compares the held-out errors of simple curves with the errors of the model.

    The result is None if no curve was tried.
    """
    scores = {score.name: score for score in verdict.scores}
    rows = []
    # A curve is compared only on channels that the model predicts.
    for baseline in verdict.baselines:
        if baseline.channel in scores:
            score, curve = scores[baseline.channel], f"{baseline.curve} of {baseline.given}"
            errors = format_value(baseline.error, baseline.unit), format_value(score.after, baseline.unit)
            away = AWAY * is_better(baseline.error, score.floor, score.after)
            rows.append(TableRow((labels.channel(baseline.channel), curve, *errors), away))
    heads = ("channel", "curve", "error of the curve", "error of the model")
    caption = "Simple curves in place of the model, on the same held-out data. A mark shows where the curve is better."
    return ReportTable(heads, tuple(rows), caption) if rows else None


def _level(level: Any, score: ChannelScore, added: bool) -> str:
    """Return the errors of a channel in one held-out fold as text: "1.2 mm", or "1.2 mm to 0.8 mm" if effects were
    added.

    `level` holds the errors of the fold. The text is a dash if nothing was measured in the fold. `added` is whether
    effects were added; the second error is then that of the model with added effects.
    """
    if math.isnan(level.before) and level.level not in score.lost:
        return "-"
    before = format_value(level.before, score.unit)
    return f"{before} to {format_value(level.after, score.unit)}" if added else before


def channel_table(scores: Sequence[ChannelScore], added: bool, labels: Labels) -> ReportTable:
    """Return the table of held-out errors by channel. The channel with the largest error relative to its noise comes
    first.
    """
    heads = ("channel", "before", "after", "change, 95 %", "noise", "times the noise", "claim")
    rows = []
    for score in worst(scores):
        name, floor, times = (
            labels.channel(score.name),
            format_value(score.floor, score.unit),
            score.times(score.before),
        )
        # Without added effects there is a single error for each channel.
        if added:
            errors = format_value(score.before, score.unit), format_value(score.after, score.unit)
            ratios = f"{figure(times, '.1f')} to {figure(score.times(score.after), '.1f')}"
            cells = (name, *errors, score.worded.text, floor, ratios, score.claim)
            rows.append(TableRow(cells, AWAY * (score.worded.outcome is Outcome.WORSE)))
        else:
            rows.append(TableRow((name, format_value(score.before, score.unit), floor, figure(times, ".1f"))))
    return ReportTable(heads if added else ("channel", "held-out error", "noise", "times the noise"), tuple(rows))


def heldout_panel(scores: Sequence[ChannelScore], added: bool, labels: Labels) -> Figure:
    """Return the figure of each channel's held-out error divided by its noise, without and with the added effects.

    The axis is logarithmic. A hollow marker without a line shows a channel whose change is within the scatter, so that
    no change is claimed.
    """
    ranked = sorted(scores, key=lambda score: score.times(score.before))
    places = np.arange(len(ranked))
    before, after = np.array([(score.times(score.before), score.times(score.after)) for score in ranked]).T
    figure = Figure(figsize=(7.2, 0.24 * len(ranked) + 1.3), layout="constrained")
    axis = figure.subplots()
    # The line at 1 marks an error as large as the noise.
    axis.axvline(1, color="k", lw=0.8)
    axis.plot(before, places, "o", color=BEFORE, ms=5, label="base model")
    # An open square marks a change that the report does not claim.
    if added:
        changed = np.array([score.worded.outcome in (Outcome.BETTER, Outcome.WORSE) for score in ranked], dtype=bool)
        axis.hlines(places[changed], before[changed], after[changed], color=GREY, lw=1, zorder=1)
        axis.plot(after[changed], places[changed], "s", color=AFTER, ms=5, label="with added effects")
        axis.plot(
            after[~changed], places[~changed], "s", color=AFTER, mfc="none", ms=5, label="change within the scatter"
        )
    axis.set_yticks(places, [figure_text(labels.channel(score.name)) for score in ranked], fontsize=8.5)
    axis.set_xscale("log")
    # A short axis has too few ticks at 1, 2 and 5 of a decade.
    low, high = axis.get_xlim()
    is_short = high < MIN_LOG_RANGE * low
    axis.xaxis.set_major_locator(MaxNLocator(8, steps=(1, 2, 2.5, 5, 10)) if is_short else LogLocator(subs=(1, 2, 5)))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.set_xlabel("held-out RMSE / noise")
    axis.grid(alpha=0.25)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=8.5)
    return figure
